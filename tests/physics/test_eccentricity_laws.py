"""The two laws of an eccentric rotor: the papers' modulation, and the slope of a periodic flux."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import elevon
from tests.physics.rig import (
    FREE_SHAFT,
    HYSTERESIS,
    PWM,
    K,
    L,
    P,
    R,
    actuator,
    constant,
    make_scenario,
    run,
    values,
)  # fmt: skip

BOTH = pytest.mark.parametrize("fidelity", ["high", "low"])
PHASES = "current_a,current_b,current_c"
AXES = 2 * math.pi / 3 * np.arange(3)[:, None]
#: All low switches closed, no gates: the EMFs drive the windings through a dead short.
SHORTED = {f"inverter.shorted_{p}_low": 1.0 for p in "abc"} | {"drive.kind": "off"}
ZETA, PHI = 0.2, 0.7
PUBLISHED, PERIODIC = ({"motor.eccentricity_law": law} for law in ("published", "periodic"))
STATIC = {"motor.eccentricity_static": ZETA, "motor.eccentricity_static_phase": PHI}
DYNAMIC = {"motor.eccentricity_dynamic": 0.3, "motor.eccentricity_dynamic_phase": -0.4}
#: Turns of the shaft that are whole numbers of samples.
SPEED = 16 * math.pi


def at_speed(
    fidelity: str, settings: dict[str, Any], speed: float = SPEED, rate: str = "2 kHz"
) -> Any:
    """A shaft whose mass keeps its speed, windings shorted, for 0.4 s."""
    names = f"current_q,motor_torque,motor_position,{PHASES if fidelity == 'high' else ''}"
    scenario = make_scenario(
        duration=0.4, mode="speed", command=[constant(0.0)],
        extra={"initial": {"motor_speed": speed}},
    )  # fmt: skip
    rec = elevon.simulate(
        actuator(FREE_SHAFT | {"motor.inertia": 1e6} | SHORTED | settings),
        scenario, fidelity=fidelity, record=f"{names.strip(',')}@{rate}",
    )  # fmt: skip
    assert rec.meta["status"] == "ok"
    return rec


def over_two_turns(rec: Any, name: str) -> np.ndarray:
    """Samples of the last two turns at `SPEED`."""
    return np.asarray(rec[name].values[-500:])


def line(rec: Any, order: float, name: str = "current_q") -> float:
    """Amplitude at `order` times the electrical angle, over two turns."""
    angle = P * over_two_turns(rec, "motor_position")
    samples = over_two_turns(rec, name)
    return float(abs(2 * np.mean(samples * np.exp(-1j * order * angle))))


def test_the_published_law_drives_direct_currents_through_shorted_windings() -> None:
    """Mean EMF k zeta omega/2 sin(phi - 2 a_j) over R: the figures of an independent program at 50
    rad/s on the actuator's own motor."""
    motor = {p: elevon.Actuator.load("torino-rotary").parameters.value(p) for p in
           ("motor.emf_constant", "motor.winding_resistance")}  # fmt: skip
    rec = at_speed("high", PUBLISHED | STATIC | motor, speed=50.0, rate="50 kHz")
    turn = rec["current_a"].time > 0.4 - 2 * math.pi / 50.0
    found = np.array([np.mean(rec[name].values[turn]) for name in PHASES.split(",")])
    assert found == pytest.approx([-1.05, -0.56, 1.61], abs=0.006)
    k, resistance = motor.values()
    law = -k * 50.0 * ZETA / 2 / resistance * np.sin(PHI - 2 * AXES[:, 0])
    assert found == pytest.approx(law, abs=1e-3)


@BOTH
def test_a_direct_current_turns_once_an_electrical_turn_in_the_rotor(fidelity: str) -> None:
    """The published law's direct currents are k zeta omega/(2 R) at the electrical frequency."""
    size = K * ZETA * SPEED / (2 * R)
    assert line(at_speed(fidelity, PUBLISHED | STATIC), 1) == pytest.approx(size, rel=2e-3)


@BOTH
@pytest.mark.parametrize("pairs", [1, P])
@pytest.mark.parametrize("shape", ["sinusoidal", "trapezoidal"])
def test_a_periodic_flux_drives_no_direct_current(shape: str, pairs: int, fidelity: str) -> None:
    """Static and dynamic part together: no mean in any phase, whatever shape and pole pairs."""
    settings = PERIODIC | STATIC | DYNAMIC | {"motor.emf_shape": shape}
    rec = at_speed(fidelity, settings | {"motor.pole_pairs": pairs})
    amplitude = K * SPEED / math.hypot(R, pairs * SPEED * L)
    if fidelity == "high":
        means = [np.mean(over_two_turns(rec, name)) for name in PHASES.split(",")]
        assert means == pytest.approx([0, 0, 0], abs=1e-3 * amplitude)
    if pairs == P:
        # A turning part has its lines between the electrical ones, so this one is direct current.
        assert line(rec, 1) < 1e-3 * amplitude
        assert line(rec, 2) > 0.05 * amplitude


@BOTH
@pytest.mark.parametrize("law", [PUBLISHED, PERIODIC], ids=["published", "periodic"])
def test_torque_is_the_power_of_the_emfs_over_the_speed(law: dict[str, Any], fidelity: str) -> None:
    """Windings shorted for whole turns: what the shaft gives is what the copper takes."""
    rec = run(
        FREE_SHAFT | {"motor.inertia": 1e6, "thermal.model": "quasi_static"}
        | SHORTED | law | STATIC | DYNAMIC,
        duration=0.5, mode="speed", command=[constant(0.0)], fidelity=fidelity,
        scenario={"initial": {"motor_speed": SPEED}},
        record=f"motor_torque,energy_copper@{2 if fidelity == 'low' else 20} kHz",
    )  # fmt: skip
    torque, copper = values(rec, "motor_torque", "energy_copper")
    late = torque.size // 2
    given = -SPEED * np.mean(torque[-late:]) * 0.25
    assert copper[-1] - copper[-late - 1] == pytest.approx(given, rel=2e-3)
    assert given > 1.0


@pytest.mark.signature("eccentricity_static", "motor")
@BOTH
@pytest.mark.parametrize("drive", [PWM, HYSTERESIS], ids=["pwm", "hysteresis"])
def test_unequal_amplitudes_ripple_at_twice_the_electrical_frequency(
    drive: dict[str, Any], fidelity: str
) -> None:
    """Under load: T = 3/2 k i_q - 3/4 k zeta i_q cos(2 theta_e + phi), and no line at the first
    order, where the published law has its own."""
    names = "motor_torque,motor_position,current_q"
    rec = run(
        FREE_SHAFT | drive | PERIODIC | {"motor.inertia": 1e6},
        duration=0.375, mode="torque", command=[constant(4.0)], fidelity=fidelity,
        record=f"{names}@{'2 kHz' if fidelity == 'low' else '50 kHz'}",
        scenario={
            "initial": {"motor_speed": SPEED},
            "load": {"shaft": {"terms": [constant(4.0)]}},
            "fault": [{"kind": "eccentricity_static", "place": "motor", "severity": ZETA,
                       "phase": PHI}],
        },
    )  # fmt: skip
    late = rec["motor_torque"].time > 0.125
    torque, angle, current = (rec[n].values[late] for n in names.split(","))
    ripple = 2 * np.mean(torque * np.exp(-2j * P * angle))
    # With held currents; a drive that lets them swing keeps most of it.
    law = -0.75 * K * ZETA * np.mean(current) * np.exp(1j * PHI)
    assert abs(ripple - law) < 0.25 * abs(law)
    assert abs(2 * np.mean(torque * np.exp(-1j * P * angle))) < 0.1 * abs(law)


@pytest.mark.signature("eccentricity_dynamic", "motor")
@pytest.mark.parametrize("drive", [PWM, HYSTERESIS], ids=["pwm", "hysteresis"])
def test_every_sample_follows_the_slope_of_the_flux(drive: dict[str, Any]) -> None:
    """T = sum k_j i_j with k_j of the periodic law, the turning part's own slope included."""
    settings = drive | PERIODIC | STATIC | DYNAMIC
    rec = run(
        FREE_SHAFT | settings,
        duration=0.2, mode="speed", command=[constant(40.0)],
        record=f"motor_torque,motor_position,{PHASES}@10 kHz",
        scenario={"load": {"shaft": {"terms": [constant(2.0)]}}},
    )  # fmt: skip
    theta = rec["motor_position"].values
    electrical, around = P * theta - AXES, theta + 0.4 - AXES
    k = np.sin(electrical) * (1 + 0.3 * np.cos(around))
    k = k + np.cos(electrical) * 0.3 * np.sin(around) / P
    k = K * k * (1 + ZETA * np.cos(PHI - AXES))
    torque = (k * np.stack(values(rec, *PHASES.split(",")))).sum(axis=0)
    assert rec["motor_torque"].values == pytest.approx(torque, abs=1e-9 * np.max(np.abs(torque)))


@pytest.mark.filterwarnings("ignore::elevon.errors.NotActingWarning")
@BOTH
@pytest.mark.parametrize("drive", ["pwm", "hysteresis", "located", "six_step"])
def test_both_laws_at_severity_zero_are_the_healthy_run(drive: str, fidelity: str) -> None:
    """To the bit, in every drive, under load."""
    choice: dict[str, dict[str, Any]] = {
        "pwm": PWM, "hysteresis": HYSTERESIS,
        "located": HYSTERESIS | {"inverter.relay_crossing": "located"},
        "six_step": HYSTERESIS | {"drive.commutation": "six_step"},
    }  # fmt: skip
    if (drive, fidelity) == ("located", "low"):
        pytest.skip("the reduced-order model has no crossings")
    none = [{"kind": f"eccentricity_{kind}", "place": "motor", "severity": 0.0, "phase": PHI}
            for kind in ("static", "dynamic")]  # fmt: skip
    runs = [
        run(
            FREE_SHAFT | choice[drive] | law, duration=0.05, mode="speed",
            command=[constant(40.0)], record="motor_speed,motor_torque,current_q@1 kHz",
            scenario={"load": {"shaft": {"terms": [constant(2.0)]}}, "fault": faults},
            fidelity=fidelity,
        )
        for law, faults in (({}, []), (PUBLISHED, none), (PERIODIC, none))
    ]  # fmt: skip
    for name in ("motor_speed", "motor_torque", "current_q"):
        first, *others = (rec[name].values for rec in runs)
        assert all(np.array_equal(first, other) for other in others)


@pytest.mark.signature("eccentricity_static", "motor")
@BOTH
def test_a_pair_of_the_landing_gear_has_the_mean_of_its_amplitudes(fidelity: str) -> None:
    """T/(2 k i) on the flats, by the periodic law: constant within each pair of phases."""
    from tests.physics.test_landing_gear_signatures import of_the_pair, pairs, per_ampere

    fault = {"kind": "eccentricity_static", "place": "motor", "severity": 0.3, "phase": PHI}
    seen = of_the_pair(fidelity, fault, values=PERIODIC)
    ratio, conducting = per_ampere(seen)
    amplitude = dict(zip("abc", 1 + 0.3 * np.cos(PHI - AXES[:, 0]), strict=True))
    law = np.array([0.5 * (amplitude[x] + amplitude[y]) for x, y in pairs(seen)])
    assert np.mean(np.abs(ratio - law[conducting]) < 1e-9) > 0.9
    assert np.ptp(law) > 0.2
