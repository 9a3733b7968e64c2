"""What differs from day to day of a healthy unit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from elevon.actuator import Actuator


#: Deviation of what changes from day to day, by the end of a parameter's path, and how: added, a
#: factor, or a factor of what an efficiency loses. ASSUMED: 15 K of winding and 10 K of magnets
#: (-0.1 %/K), friction that depends on temperature and running-in, a supply within its regulation,
#: 10 K of lubricant, springs and delays by some percent.
DAILY: Mapping[str, tuple[float, str]] = {
    "motor.winding_temperature": (15.0, "add"),
    "motor.emf_constant": (0.01, "scale"),
    "friction.dynamic": (0.05, "scale"),
    "friction.static": (0.05, "scale"),
    "friction.viscous": (0.10, "scale"),
    "friction.ff_": (0.05, "scale"),
    "friction.ffm_": (0.05, "scale"),
    "screw.preload": (0.05, "scale"),
    "screw.efficiency": (0.05, "loss"),
    "screw.efficiency_aiding": (0.05, "loss"),
    "screw.efficiency_unloaded": (0.05, "loss"),
    "screw.efficiency_loaded": (0.05, "loss"),
    "motor.detent_torque": (0.05, "scale"),
    "lubricant.temperature": (10.0, "add"),
    "load.friction": (0.10, "scale"),
    "inverter.supply_voltage": (0.01, "scale"),
    "brake.release_delay": (0.10, "scale"),
    "brake.engage_delay": (0.10, "scale"),
    "lock.spring_force": (0.03, "scale"),
}
#: Numbers that change together.
_TOGETHER: Mapping[str, str] = {
    "friction.static": "friction.dynamic",
    "friction.ffm_": "friction.ff_",
    "screw.efficiency_aiding": "screw.efficiency",
    "screw.efficiency_loaded": "screw.efficiency_unloaded",
}


def factors_of(actuator: Actuator) -> tuple[str, ...]:
    """Return the names of what varies independently of each other in this actuator."""
    names = (_TOGETHER.get(name, name) for path in actuator.parameters for name in _named(path))
    return tuple(dict.fromkeys(names))


def daily(actuator: Actuator, steps: Mapping[str, float]) -> dict[str, float]:
    """Return what a healthy unit has when its factors deviate by so much, by path."""
    values = {}
    for path in actuator.parameters:
        for name in _named(path):
            spread, way = DAILY[name]
            step = spread * steps[_TOGETHER.get(name, name)]
            values[path] = moved_value(actuator.parameters.value(path), step, way)
    return values


def _named(path: str) -> list[str]:
    """The line of `DAILY` that a parameter stands under, if any."""
    return [n for n in DAILY if path == n or (n.endswith("_") and path.startswith(n))]


def moved_value(old: float, step: float, way: str) -> float:
    """Return a value of another day, by the way of its line of `DAILY`."""
    if way == "add":
        return old + step
    if way == "loss":
        return 1.0 - (1.0 - old) * max(1.0 + step, 0.05)
    return old * max(1.0 + step, 0.05)


def drawn(actuator: Actuator, rng: np.random.Generator) -> Actuator:
    """Return a healthy unit of another day."""
    names = factors_of(actuator)
    steps = dict(zip(names, rng.standard_normal(len(names)).tolist(), strict=True))
    return actuator.with_values(daily(actuator, steps), source="run-to-run spread")
