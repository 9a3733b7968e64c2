"""An actuator like the published one, but with values of its own, drawn by a seed."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from elevon.actuator import Actuator
from elevon.data import packaged_toml
from elevon.parameters.relations import torque_constant

_TABLES = packaged_toml("elevon.bench", "hidden.toml")
RECOVERED: Mapping[str, float] = _TABLES["recovered"]
"""Paths that the demonstration expects to find again, each with its relative tolerance."""


def hidden_actuator(base: Actuator, seed: int) -> Actuator:
    """Draw the actuator on the bench.

    The drive is a PWM drive, as the real one is, and knows its motor's torque constant.

    Parameters
    ----------
    base : Actuator
        The published set.
    seed : int
        Of the draw.
    """
    rng = np.random.default_rng([seed, 7])
    value = base.parameters.value
    scale = {path: rng.uniform(*ends) for path, ends in _TABLES["spread"].items()}
    scale["friction.static"] = scale["friction.dynamic"]
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
