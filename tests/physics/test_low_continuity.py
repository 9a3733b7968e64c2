"""Faults that come by degrees begin at the healthy reduced-order model, without a jump."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import elevon
from tests.physics.rig import constant, make_scenario, term

LOADS = {"free": {}, "brake": {"brake": {"terms": [constant("1 N m")]}},
         "output": {"output": {"terms": [constant("20 N m")]}}}  # fmt: skip
FAULTS = ["mismatch@sensor.resolver", "offset@sensor.resolver", "gain@sensor.resolver",
          "resolver_short@sensor.resolver.cosine", "gain@sensor.current_a"]  # fmt: skip
FIDELITIES = ("high", "low")
NAMES = ("current_q", "current_q_meas", "motor_torque", "motor_speed", "voltage_q_meas")


def swing(drive: str, fault: str | None, load: str = "free", fidelity: str = "low") -> Any:
    """Half a second of a swing; position control, speed and torque all at work."""
    scenario = make_scenario(
        duration=0.5, command=[term("sine", amplitude="7 deg", frequency="2 Hz")],
        extra={"fault": [] if fault is None else [fault], "load": LOADS[load]},
    )  # fmt: skip
    actuator = elevon.Actuator.load("torino-rotary").with_values({"drive.kind": drive})
    rec = elevon.simulate(actuator, scenario, fidelity=fidelity, record=",".join(NAMES) + "@2 kHz")
    assert rec.meta["status"] == "ok"
    return {name: np.asarray(rec[name].values) for name in NAMES}


def rms(x: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(x))))


@pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("drive", ["hysteresis", "pwm"])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_next_to_nothing_is_next_to_nothing(fault: str, drive: str, load: str) -> None:
    """1e-9 changes no signal by more than 1e-6; a hundredth as much, a hundredth at most."""
    healthy = swing(drive, None, load)
    small = [swing(drive, f"{fault}={severity}", load) for severity in (1e-9, 1e-7)]
    for name in NAMES:
        tiny, hundredfold = (rms(run[name] - healthy[name]) for run in small)
        assert tiny < 1e-6 * rms(healthy[name])
        assert hundredfold < 1e-4 * rms(healthy[name])


@pytest.mark.parametrize("drive", ["hysteresis", "pwm"])
@pytest.mark.parametrize("fault", ["mismatch@sensor.resolver", "offset@sensor.resolver"])
def test_from_one_current_to_three_windings_there_is_no_step(fault: str, drive: str) -> None:
    """Severities on a grid through the change: neighbours differ by less than a
    twentieth of i_q."""
    runs = [swing(drive, f"{fault}={severity}") for severity in np.arange(1, 9) * 0.005]
    steps = [
        rms(b["current_q_meas"] - a["current_q_meas"]) / rms(a["current_q_meas"])
        for a, b in pairwise(runs)
    ]
    assert max(steps) < 0.05


def slow(x: np.ndarray) -> np.ndarray:
    """Means over 10 ms: what the reduced-order model carries."""
    return np.convolve(x, np.full(20, 0.05), "valid")


@pytest.mark.parametrize("drive", ["hysteresis", "pwm"])
@pytest.mark.parametrize("fault", [None, "mismatch@sensor.resolver=0.05"])
def test_one_current_and_three_windings_are_both_the_switching_model(
    fault: str | None, drive: str
) -> None:
    """At a mismatch of 0.05 (references off by 0.1 rad) the windings alone are stepped."""
    high, low = (swing(drive, fault, "brake", fidelity) for fidelity in FIDELITIES)
    for name, share in (("current_q", 0.05), ("motor_torque", 0.05), ("motor_speed", 0.01)):
        found, expected = slow(low[name]), slow(high[name])
        assert rms(found - expected) < share * rms(expected)
        assert rms(found) == pytest.approx(rms(expected), rel=0.015)


@pytest.mark.long
@pytest.mark.parametrize("drive", ["hysteresis", "pwm"])
@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("severity", [0.005, 0.02, 0.05])
@pytest.mark.parametrize("fault", ["mismatch@sensor.resolver", "offset@sensor.resolver"])
def test_between_both_forms_it_is_as_near_to_the_switching_model(
    fault: str, severity: float, load: str, drive: str
) -> None:
    """Filtered current and speed at every degree of the fault: a tenth in the mean square."""
    high, low = (swing(drive, f"{fault}={severity}", load, fidelity) for fidelity in FIDELITIES)
    for name in ("current_q_meas", "motor_speed"):
        assert rms(high[name] - low[name]) < 0.1 * rms(high[name])
