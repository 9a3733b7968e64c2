"""Dual-number derivatives (reduced-order) against central differences, without switching."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import elevon
from elevon.simulate.sensitivity import sensitivities
from tests.physics.rig import FREE_SHAFT, PWM, actuator, constant, make_scenario

SIGNALS = ("motor_speed", "motor_position", "current_q")
# Turning from the start and never stopping, currents off every limit: no branch changes.
SET = FREE_SHAFT | PWM | {"friction.dynamic": 0.1, "friction.static": 0.2, "friction.viscous": 0.01}


def scenario(faults: list[dict[str, Any]]) -> Any:
    """40 rad/s held against 2 N m, begun at 38 rad/s."""
    extra = {
        "initial": {"motor_speed": 38.0},
        "load": {"shaft": {"terms": [constant(2.0)]}},
        "fault": faults,
    }
    return make_scenario(duration=0.4, mode="speed", command=[constant(40.0)], extra=extra)


def final(values: dict[str, Any], faults: list[dict[str, Any]]) -> np.ndarray:
    """Every sample of the signals, shape (signals, n)."""
    rec = elevon.simulate(
        actuator(SET | values),
        scenario(faults),
        fidelity="low",
        record=f"{','.join(SIGNALS)}@1 kHz",
    )
    return np.stack([rec[name].values for name in SIGNALS])


def held_against_differences(
    exact: np.ndarray, low: np.ndarray, high: np.ndarray, h: float
) -> None:
    """Within 1e-5 of each signal's largest derivative: the truncation of the difference."""
    difference = (high - low) / (2 * h)
    scale = np.max(np.abs(exact), axis=1)
    assert np.any(scale > 0), "nothing depends on it"
    assert np.max(np.abs(exact - difference), axis=1) == pytest.approx(0.0, abs=1e-5 * scale.max())
    for row, other, size in zip(exact, difference, scale, strict=True):
        assert np.max(np.abs(row - other)) <= 1e-4 * size + 1e-7 * scale.max()


PARAMETERS = [
    "motor.inertia", "motor.emf_constant", "motor.winding_resistance", "gear.inertia",
    "friction.dynamic", "friction.viscous", "control.speed_gain", "control.integral_time",
    "control.torque_constant", "motor.winding_inductance",
]  # fmt: skip


@pytest.mark.parametrize("path", PARAMETERS)
def test_parameters(path: str) -> None:
    model = actuator(SET)
    value = float(model.parameters.value(path))
    found = sensitivities(
        model, scenario([]), [path], record=f"{','.join(SIGNALS)}@1 kHz"
    ).derivatives[path]
    exact = np.stack([found[name] for name in SIGNALS])
    if path == "motor.winding_resistance":
        # The PWM drive's current follows its reference inside the voltage limit: no dependence.
        assert np.max(np.abs(exact)) == 0.0
        return
    h = 1e-4 * value
    held_against_differences(exact, final({path: value - h}, []), final({path: value + h}, []), h)


FAULTS = [
    ("short", "motor.phase_a", 0.1),
    ("short", "motor.phase_c", 0.3),
    ("eccentricity_static", "motor", 0.2),
    ("eccentricity_dynamic", "motor", 0.2),
    ("demagnetisation", "motor", 0.1),
    ("friction", "transmission", 0.25),
    ("lubrication", "transmission", 0.5),
    ("gain_drift", "control.speed", -0.2),
    ("mismatch", "sensor.resolver", 0.2),
]


@pytest.mark.parametrize(("kind", "place", "severity"), FAULTS)
def test_fault_severities(kind: str, place: str, severity: float) -> None:
    def faults(x: float) -> list[dict[str, Any]]:
        return [{"kind": kind, "place": place, "severity": x}]

    found = sensitivities(
        actuator(SET), scenario(faults(severity)), faults=[0], record=f"{','.join(SIGNALS)}@1 kHz"
    ).derivatives["fault_1"]
    exact = np.stack([found[name] for name in SIGNALS])
    h = 1e-4 * abs(severity)
    low, high = (final({}, faults(severity + side * h)) for side in (-1, 1))
    held_against_differences(exact, low, high, h)


def test_coasting_to_rest_keeps_the_branch_derivative() -> None:
    """Position at rest is J w0^2/(2F): its derivative by F survives the stop, for f is continuous
    there; the derivative of the speed jumps to zero.
    """
    friction, speed = 0.1, 20.0
    values = FREE_SHAFT | {"friction.dynamic": friction, "friction.static": friction}
    model = actuator(values)
    standstill = make_scenario(
        duration=1.5, mode="speed", command=[], extra={"initial": {"motor_speed": speed}}
    )
    found = sensitivities(
        model, standstill, ["friction.dynamic"], record="motor_speed,motor_position@1 kHz"
    ).derivatives["friction.dynamic"]
    inertia = float(
        model.parameters.value("motor.inertia") + model.parameters.value("gear.inertia")
    )
    stop = inertia * speed / friction
    assert found["motor_position"][-1] == pytest.approx(-(stop**2) / (2 * inertia), rel=5e-3)
    assert found["motor_speed"][-1] == 0.0
