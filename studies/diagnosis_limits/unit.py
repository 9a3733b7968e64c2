"""Units of the virtual bench that are unlike the model: what they are, and how they vary.

Every number of this file is ASSUMED: it states how far the bench may deviate from the actuator file
that diagnosis starts from, and how far one unit changes from day to day. Diagnosis never reads it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["BASE", "DAILY", "BenchUnit", "draw_unit", "of_the_day"]

BASE = "torino-rotary"

#: Built alike in all units, unlike the set: elastic backlash between two masses, a carrier PWM with
#: real switches, a sampled controller on encoder counts with a filtered derivative, imperfect
#: current sensors. The step is the actuator file's, 1 us: edges of the PWM fall on whole steps, and
#: at 5 us that shifts the mean voltage by up to a third of what depends on the speed.
_BUILT: dict[str, float | str] = {
    "drive.kind": "pwm",
    "backlash.model": "elastic",
    "control.position_feedback": "encoder",
    "control.sample_time": 125e-6,
    "control.derivative_filter": 10.0,
    "inverter.on_resistance": 0.3,
    "inverter.diode_drop": 1.0,
    "sensor.current.noise_deviation": 0.02,
    "sensor.current.bits": 12.0,
    "sensor.current.full_scale": 40.0,
}
#: Path to the deviation between units: share of the actuator file's value.
_BETWEEN = {
    "motor.inertia": 0.10,
    "motor.winding_resistance": 0.04,
    "motor.winding_inductance": 0.05,
    "motor.emf_constant": 0.02,
    "friction.viscous": 0.25,
    "backlash.total": 0.15,
    "backlash.stiffness": 0.20,
    "backlash.damping": 0.30,
    "load.inertia": 0.20,
    "control.position_gain": 0.03,
    "control.speed_gain": 0.08,
    "control.integral_time": 0.10,
    "pwm.proportional_gain": 0.15,
}
#: Path to the deviation from day to day: share of the unit's value.
DAILY = {
    "motor.emf_constant": 0.007,
    "friction.dynamic": 0.04,
    "friction.static": 0.04,
    "friction.viscous": 0.08,
    "inverter.supply_voltage": 0.015,
    "sensor.current.gain_a": 0.003,
    "sensor.current.gain_b": 0.003,
    "sensor.current.gain_c": 0.003,
}
_WINDING = 12.0  # K, deviation of the winding's temperature from day to day


@dataclass(frozen=True)
class BenchUnit:
    """A healthy unit of the bench.

    Attributes
    ----------
    number : int
        Key of its draws.
    actuator : Actuator
        As it is on an average day.
    """

    number: int
    actuator: Actuator


def draw_unit(seed: int, number: int) -> BenchUnit:
    """Draw a unit; odd ones have bristle friction (LuGre), even ones a Stribeck curve."""
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.candidates import of_a_magnet

    rng = np.random.default_rng([seed, 101, number])
    base = of_a_magnet(Actuator.load(BASE))
    value = base.parameters.value
    values: dict[str, float | str] = dict(_BUILT)
    for path, spread in _BETWEEN.items():
        values[path] = value(path) * _factor(rng, spread)
    values |= _friction(rng, number)
    values["inverter.supply_voltage"] = float(rng.uniform(480.0, 560.0))
    values["motor.cogging_torque"] = float(rng.uniform(0.0, 0.015))
    values["sensor.filter_cutoff"] = float(rng.uniform(90.0, 150.0))
    values["motor.electrical_offset"] = float(rng.uniform(-math.pi / 8, math.pi / 8)) * 0.1
    for phase in "abc":
        values[f"sensor.current.gain_{phase}"] = _factor(rng, 0.003)
        values[f"sensor.current.offset_{phase}"] = 0.01 * float(rng.standard_normal())
    return BenchUnit(number, base.with_values(values, source="drawn for the bench"))


def _friction(rng: np.random.Generator, number: int) -> dict[str, float | str]:
    dry = float(rng.uniform(0.22, 0.40))
    return {
        "friction.law": "lugre" if number % 2 else "stribeck",
        "friction.dynamic": dry,
        "friction.static": dry * float(rng.uniform(1.1, 1.5)),
        "friction.stribeck_speed": float(rng.uniform(0.5, 3.0)),
        "friction.bristle_stiffness": float(rng.uniform(100.0, 300.0)),
        "load.friction": float(rng.uniform(0.2, 0.6)),
    }


def of_the_day(unit: BenchUnit, seed: int) -> Actuator:
    """Return the unit as it is on one day: temperatures, friction, supply, current sensors."""
    rng = np.random.default_rng([seed, 102])
    value = unit.actuator.parameters.value
    values: dict[str, float | str] = {}
    steps = {path: _factor(rng, spread) for path, spread in DAILY.items()}
    steps["friction.static"] = steps["load.friction"] = steps["friction.dynamic"]
    for path, step in steps.items():
        values[path] = value(path) * step
    kelvin = value("motor.winding_temperature") + _WINDING * float(rng.standard_normal())
    values["motor.winding_temperature"] = kelvin
    return unit.actuator.with_values(values, source="of the day")


def _factor(rng: np.random.Generator, spread: float) -> float:
    """Gaussian about one, cut at three deviations."""
    return 1.0 + spread * float(np.clip(rng.standard_normal(), -3.0, 3.0))
