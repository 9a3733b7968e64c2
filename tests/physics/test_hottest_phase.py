"""The hottest phase: at standstill one carries twice the mean heat of the three."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import elevon
from tests.physics.rig import (
    FREE_SHAFT,
    HYSTERESIS,
    LOCKED,
    PWM,
    K,
    P,
    R,
    actuator,
    constant,
    make_scenario,
    values,
)  # fmt: skip

BOTH = pytest.mark.parametrize("fidelity", ["high", "low"])
DRIVES = {"pwm": PWM, "hysteresis": HYSTERESIS,
          "located": HYSTERESIS | {"inverter.relay_crossing": "located"}}  # fmt: skip
RESISTANCE, CAPACITY = 0.5, 0.4  # K/W and J/K: 0.2 s
NETWORK = {"thermal.model": "dynamic", "thermal.winding_to_surface": RESISTANCE,
           "thermal.winding_mass": CAPACITY / 400.0, "thermal.winding_heat": 400.0,
           "thermal.sample_time": 0.002, "thermal.trip": 1e4, "thermal.warning": 9e3}  # fmt: skip
NAMES = ("winding_temperature_hottest", "winding_temperature", "heat_phase_hottest", "heat_copper",
         "heat_loop")  # fmt: skip
CURRENT = 4.0


def at_current(
    fidelity: str, drive: dict[str, Any], angle: float, *, speed: float = 0.0, **more: Any
) -> dict[str, np.ndarray]:
    """Currents of 4 A at an electrical angle, locked, or at a speed that a mass keeps."""
    shaft = LOCKED if speed == 0.0 else {"motor.inertia": 1e6}
    rec = elevon.simulate(
        actuator(FREE_SHAFT | drive | NETWORK | shaft | more.get("settings", {})),
        make_scenario(
            duration=0.3, mode="torque", command=[constant(1.5 * K * CURRENT)],
            extra={"initial": {"motor_position": angle / P, "motor_speed": speed},
                   "fault": more.get("fault", [])},
        ),
        fidelity=fidelity, record=f"{','.join(NAMES if fidelity == 'high' else NAMES[:4])}@500 Hz",
    )  # fmt: skip
    assert rec.meta["status"] == "ok", rec.meta["message"]
    found = dict(zip(NAMES, values(rec, *NAMES[:4]), strict=False))
    return found | {"time": rec[NAMES[0]].time, "rec": rec}


@BOTH
@pytest.mark.parametrize("drive", DRIVES)
def test_at_standstill_one_phase_has_two_thirds_of_the_heat(drive: str, fidelity: str) -> None:
    """i_a = i, i_b = i_c = -i/2: P_a = 2/3 P, and its rise over the mean R_th P (1 - exp(-t/T))."""
    if (drive, fidelity) == ("located", "low"):
        pytest.skip("the reduced-order model has no crossings")
    seen = at_current(fidelity, DRIVES[drive], math.pi / 2)
    late = seen["time"] > 0.1
    heat, total = (seen[n][late] for n in ("heat_phase_hottest", "heat_copper"))
    exact = drive == "pwm"
    # The relays' ripple is shared evenly, and the band leaves an error of the currents.
    assert np.mean(heat) == pytest.approx(2 / 3 * np.mean(total), rel=2e-3 if exact else 0.05)
    assert np.mean(total) == pytest.approx(1.5 * R * CURRENT**2, rel=2e-3 if exact else 0.1)
    rise = (seen["winding_temperature_hottest"] - seen["winding_temperature"])[-1]
    settled = 1.0 - math.exp(-0.3 / (RESISTANCE * CAPACITY))
    law = RESISTANCE * 3 * (np.mean(heat) - np.mean(total) / 3) * settled
    assert rise == pytest.approx(law, rel=0.02 if exact else 0.05)


@BOTH
def test_between_two_phases_both_are_at_a_half(fidelity: str) -> None:
    """At theta_e = 0: i_b = -i_c, half of the heat each; the rise is half of that of one phase."""
    one, two = (at_current(fidelity, PWM, angle) for angle in (math.pi / 2, 0.0))
    share = two["heat_phase_hottest"][-1] / two["heat_copper"][-1]
    assert share == pytest.approx(0.5, rel=2e-3)
    rises = [(x["winding_temperature_hottest"] - x["winding_temperature"])[-1] for x in (one, two)]
    assert rises[1] == pytest.approx(0.5 * rises[0], rel=5e-3)


@BOTH
def test_a_motor_that_turns_heats_its_phases_alike(fidelity: str) -> None:
    """Whole turns within the winding's time: no phase is hotter by more than a hundredth."""
    seen = at_current(fidelity, PWM, 0.0, speed=100 * math.pi / P)
    rise = seen["winding_temperature"] - seen["winding_temperature"][0]
    apart = seen["winding_temperature_hottest"] - seen["winding_temperature"]
    assert apart[-1] < 0.03 * rise[-1]
    assert rise[-1] > 3.0


@pytest.mark.parametrize("model", ["reduced", "loop"])
@BOTH
def test_shorted_turns_heat_their_phase(model: str, fidelity: str) -> None:
    """Turning: a loop's own current makes its phase the hottest; turns that are missing do not."""
    short = [{"kind": "short", "place": "motor.phase_b", "severity": 0.2}]
    seen = at_current(fidelity, PWM, 0.0, speed=100 * math.pi / P, fault=short,
                settings={"motor.short_model": model})  # fmt: skip
    share = 3 * np.mean(seen["heat_phase_hottest"][-20:]) / np.mean(seen["heat_copper"][-20:])
    assert (share > 2.0) == (model == "loop")


@BOTH
def test_without_a_network_no_phase_differs(fidelity: str) -> None:
    rec = elevon.simulate(
        actuator(FREE_SHAFT | PWM | {"motor.winding_temperature": 333.0}),
        make_scenario(duration=0.01, mode="torque", command=[constant(1.0)]),
        fidelity=fidelity,
        record="winding_temperature_hottest,heat_phase_hottest,heat_copper@1 kHz",
    )  # fmt: skip
    hottest, heat, copper = values(
        rec, "winding_temperature_hottest", "heat_phase_hottest", "heat_copper"
    )
    assert np.all(hottest == 333.0)
    # The heat is that of the present currents: of three sines the largest has half to two thirds.
    assert np.all(heat[1:] >= (0.5 - 1e-3) * copper[1:])
    assert np.all(heat[1:] <= (2.0 / 3.0 + 1e-3) * copper[1:])
