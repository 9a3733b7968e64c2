"""Short words for the physics tests: build an actuator, run it, read channels. Public API only."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

import elevon

# One motor for every closed form, so that no test depends on what an actuator file chooses.
R, L, K, P = 2.75, 30.5e-3, 1.1 / 1.5, 4
RATIO = 124.0
MOTOR_INERTIA, GEAR_INERTIA = 7.7e-4, 1.905e-3
INERTIA = MOTOR_INERTIA + GEAR_INERTIA
SUPPLY = 380.0

MOTOR = {
    "motor.winding_resistance": R,
    "motor.winding_inductance": L,
    "motor.emf_constant": K,
    "motor.pole_pairs": P,
    "motor.inertia": MOTOR_INERTIA,
    "motor.torque_limit": 1e3,
    "motor.electrical_offset": 0.0,
    "gear.ratio": RATIO,
    "gear.inertia": GEAR_INERTIA,
    "control.torque_constant": 1.5 * K,
    "control.current_limit": 20.0,
    "control.speed_limit": 1e4,
    "inverter.supply_voltage": SUPPLY,
    "inverter.hysteresis_band": 0.5,
    "motor.temperature_coefficient": 0.0,
    "load.inertia": 0.0,
    "load.stiffness": 0.0,
    "friction.viscous_slope": 0.0,
    "control.derivative_time": 0.0,
    "control.anti_windup_back_calculation": 0.0,
    "control.conditional_integration": "on",
    "control.sample_time": 0.0,
    "control.noise_deviation": 0.0,
    "sensor.current.noise_deviation": 0.0,
}
# Nothing on the shaft but its inertia: no friction, no losses in the gear, stops out of reach,
# inverter off.
FREE_SHAFT = MOTOR | {
    "drive.kind": "off",
    "friction.static": 0.0,
    "friction.dynamic": 0.0,
    "friction.viscous": 0.0,
    "gear.efficiency": 1.0,
    "gear.efficiency_aiding": 1.0,
    "backlash.total": 0.0,
    "stop.upper": 1e6,
    "stop.lower": -1e6,
}
HYSTERESIS = {"drive.kind": "hysteresis"}
_TAU = 1 / (2 * math.pi * 200.0)
# A PI whose zero cancels the winding's pole: the current answers as a first-order lag of time
# constant tau.
PWM = {
    "drive.kind": "pwm",
    "pwm.frequency": 4000.0,
    "pwm.sample_time": 125e-6,
    "pwm.proportional_gain": L / _TAU,
    "pwm.integral_gain": R / _TAU,
    "pwm.inductance": L,
    "pwm.emf_constant": K,
}
LOCKED = {"friction.static": 1e3, "friction.dynamic": 1e3}


loaded = cache(elevon.Actuator.load)


def term(kind: str, **parameters: Any) -> dict[str, Any]:
    """One waveform term as a scenario spells it."""
    return {"kind": kind, **parameters}


def constant(value: float | str) -> dict[str, Any]:
    """A waveform that never changes."""
    return term("constant", value=value)


def actuator(values: dict[str, Any] | None = None, name: str = "torino-rotary") -> Any:
    """The set `name` with `values` written over it.

    What stands in this file is the rig's own set, carried for every drive and fidelity; the rest
    is a test's wish, and must act.
    """
    wishes = values or {}
    free = {
        path: value
        for path, value in wishes.items()
        if any(value == given.get(path) for given in (FREE_SHAFT, MOTOR, PWM))
    }
    others = {path: value for path, value in wishes.items() if path not in free}
    return loaded(name).with_values(free, request=False).with_values(others)


def run(
    values: dict[str, Any] | None = None,
    *,
    duration: float,
    record: str | list[str],
    mode: str = "position",
    command: list[dict[str, Any]] | None = None,
    scenario: dict[str, Any] | None = None,
    name: str = "torino-rotary",
    **options: Any,
) -> Any:
    """Simulate and insist on status ok."""
    rec = elevon.simulate(
        actuator(values, name),
        make_scenario(duration=duration, mode=mode, command=command, extra=scenario),
        record=[record] if isinstance(record, str) else record,
        **options,
    )
    assert rec.meta["status"] == "ok", rec.meta["message"]
    return rec


def make_scenario(
    *,
    duration: float,
    mode: str = "position",
    command: list[dict[str, Any]] | None = None,
    extra: dict[str, Any] | None = None,
) -> Any:
    """A scenario with one command and whatever else is given."""
    data: dict[str, Any] = {
        "duration": f"{duration!r} s",
        "command": {"mode": mode, "terms": command or []},
    }
    return elevon.Scenario.from_dict({**data, **(extra or {})})


def values(rec: Any, *names: str) -> list[np.ndarray]:
    """The samples of several channels."""
    return [np.asarray(rec[name].values) for name in names]
