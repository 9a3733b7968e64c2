"""An actuator like the published one, but with values of its own, drawn by a seed."""

from __future__ import annotations

import math

import numpy as np

from elevon.actuator import Actuator
from elevon.parameters.relations import torque_constant

#: What the demonstration expects to find again, and how far a value may be off (relative). Of the
#: inertias only the sum on the motor shaft acts, so the sum is what is held against the truth.
RECOVERED: dict[str, float] = {
    "friction.dynamic": 0.02,
    "friction.viscous": 0.02,
    "backlash.total": 0.02,
    "motor.emf_constant": 0.02,
    "derived.inertia": 0.02,
    "control.speed_gain": 0.02,
    "control.integral_time": 0.02,
}


def hidden_actuator(base: Actuator, seed: int) -> Actuator:
    """Draw the actuator on the bench.

    The spreads are ASSUMED: what a printed gearbox, another batch of magnets and a tuned drive may
    differ by. The drive is a PWM drive, as the real one is, and knows its motor's torque constant.

    Parameters
    ----------
    base : Actuator
        The published set.
    seed : int
        Of the draw.
    """
    rng = np.random.default_rng([seed, 7])
    value = base.parameters.value
    friction = rng.uniform(0.75, 1.35)
    scale = {
        "friction.dynamic": friction,
        "friction.static": friction,
        "friction.viscous": rng.uniform(0.7, 1.3),
        "motor.emf_constant": rng.uniform(0.94, 1.06),
        "motor.inertia": rng.uniform(0.85, 1.2),
        "control.speed_gain": rng.uniform(0.85, 1.2),
        "control.integral_time": rng.uniform(0.8, 1.25),
    }
    values: dict[str, str | float] = {path: value(path) * float(f) for path, f in scale.items()}
    emf = float(values["motor.emf_constant"])
    values |= {
        "control.torque_constant": torque_constant(emf),
        "pwm.emf_constant": emf,
        "drive.kind": "pwm",
        "backlash.total": value("backlash.total") + math.radians(rng.uniform(0.2, 1.0)),
        "sensor.encoder.offset": math.radians(rng.normal(0.0, 0.2)),
        "sensor.current.offset_a": float(rng.normal(0.0, 0.01)),
        "sensor.current.offset_b": float(rng.normal(0.0, 0.01)),
        "sensor.current.noise_deviation": 0.02,
    }
    return base.with_values(values, source="hidden from the calibration")
