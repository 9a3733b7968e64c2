"""Units the surrogate learns from: how they differ, from day to day, and what is broken in them.

Nothing here is measured: the ranges are ASSUMED wide, so that a unit whose actuator file is
calibrated lies among them whatever its drive, friction and sensors are. What changes from day to
day is the stated spread of diagnosis by the model (`elevon.diagnose.positions.reading.SPREAD`).
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elevon.diagnose.engine.candidates import CANDIDATES, CandidateFault
from elevon.diagnose.positions.reading import SPREAD
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator

#: What the surrogate knows, in the order of its answers.
FAULTS = (
    "backlash@transmission",
    "friction@transmission",
    "lubrication@transmission",
    "short@motor.phase_a",
    "eccentricity_static@motor",
    "demagnetisation@motor",
    "gain_drift@control.position",
    "gain_drift@control.speed",
    "gain@sensor.encoder",
)
HEALTHY, SINGLE = 0.1, 0.65  # ASSUMED shares of the runs that may be faulty; the rest are pairs
ALIKE = 8  # units in a row that are built alike
LEAST = 0.1  # root of the least severity over the greatest

#: Factors of a unit's values, drawn between the two evenly in their logarithm. ASSUMED.
_FACTORS: Mapping[str, tuple[float, float]] = {
    "friction.dynamic": (0.5, 2.0),
    "friction.viscous": (0.4, 2.5),
    "gear.inertia": (0.75, 1.35),
    "motor.emf_constant": (0.94, 1.06),
    "motor.winding_resistance": (0.85, 1.15),
    "motor.winding_inductance": (0.85, 1.15),
    "backlash.total": (0.5, 2.2),
    "backlash.stiffness": (0.5, 2.5),
    "control.position_gain": (0.8, 1.25),
    "control.speed_gain": (0.7, 1.5),
    "control.integral_time": (0.6, 1.7),
    "control.derivative_time": (0.3, 1.2),
    "sensor.filter_cutoff": (0.6, 1.6),
}
#: Values of a unit, drawn between the two. ASSUMED.
_VALUES: Mapping[str, tuple[float, float]] = {
    "inverter.supply_voltage": (340.0, 560.0),
    "sensor.encoder.gain": (0.996, 1.004),
    "sensor.current.gain_a": (0.99, 1.01),
    "sensor.current.gain_b": (0.99, 1.01),
    "sensor.current.gain_c": (0.99, 1.01),
    "sensor.current.offset_a": (-0.03, 0.03),
    "sensor.current.offset_b": (-0.03, 0.03),
    "friction.reverse_scale": (0.9, 1.1),
}
_STATIC = (1.0, 1.6)  # over the dynamic friction
_OUTPUT_FRICTION = (
    0.1,
    1.0,
)  # N m behind an elastic backlash: without any the output swings freely
#: Greatest deviation of a unit's noise on the log. ASSUMED.
NOISE: Mapping[str, float] = {"motor_speed": 0.1, "current_q_meas": 0.05, "voltage_q_ref": 1.0}
#: How units are built, and how often. ASSUMED.
_SHARES: Mapping[str, tuple[tuple[str, ...], tuple[float, ...]]] = {
    "drive.kind": (("pwm", "hysteresis"), (0.6, 0.4)),
    "backlash.model": (("operator", "elastic"), (0.5, 0.5)),
    "friction.law": (("borello", "stribeck", "lugre"), (0.7, 0.15, 0.15)),
    "control.position_feedback": (("output", "encoder"), (0.5, 0.5)),
}
_SAMPLED = (0.0, 125e-6, 1e-3)  # s; of the controller, 0: continuous. ASSUMED, equally often
_STRIBECK, _BRISTLES = (0.5, 3.0), (100.0, 300.0)  # rad/s; N m/rad. ASSUMED
#: What makes runs eight times faster: semi-implicit steps [s], and the derivative's filter that
#: they need. The features are those of steps of 1 us but for the voltage's ripple, which is up
#: to three times as large in a healthy unit: the carrier's edges fall on whole steps.
_STEPS: Mapping[str, float] = {"pwm": 2.5e-6, "hysteresis": 5e-6}
_DERIVATIVE_FILTER = 100.0
_ROOM = 1.15  # gain over the drawn one at which the speed loop must still be accepted
_SHORTEST = 1e-4  # s of derivative time


@dataclass(frozen=True)
class UnitDay:
    """A unit on one day.

    Attributes
    ----------
    actuator : Actuator
        The unit, as warm as it is.
    cell : float
        Brake torque measured over the true one.
    """

    actuator: Actuator
    cell: float


def learned() -> list[CandidateFault]:
    """Return the candidates in the order of `FAULTS`."""
    known = {c.key: c for c in CANDIDATES}
    return [known[key] for key in FAULTS]


def build_of(rng: np.random.Generator) -> dict[str, float | str]:
    """Return how units are built: drive, backlash, friction's law, controller.

    Units that are built alike run side by side in a batch.
    """
    out: dict[str, float | str] = {}
    for path, (names, shares) in _SHARES.items():
        out[path] = str(rng.choice(names, p=shares))
    out["control.sample_time"] = float(rng.choice(_SAMPLED))
    out["control.derivative_filter"] = _DERIVATIVE_FILTER
    out["solver.method"] = "semi_implicit"
    out["solver.step"] = _STEPS[str(out["drive.kind"])]
    return out


def unit_of(
    actuator: Actuator, build: Mapping[str, float | str], rng: np.random.Generator
) -> Actuator:
    """Return another unit of the kind, built as `build_of` says."""
    values = dict(build)
    for path, (low, high) in _FACTORS.items():
        factor = math.exp(rng.uniform(math.log(low), math.log(high)))
        values[path] = actuator.parameters.value(path) * factor
    for path, (low, high) in _VALUES.items():
        values[path] = float(rng.uniform(low, high))
    values["friction.static"] = float(values["friction.dynamic"]) * rng.uniform(*_STATIC)
    values["friction.stribeck_speed"] = float(rng.uniform(*_STRIBECK))
    values["friction.bristle_stiffness"] = float(rng.uniform(*_BRISTLES))
    if values["backlash.model"] == "elastic":
        values["load.friction"] = float(rng.uniform(*_OUTPUT_FRICTION))
    return _stable(actuator.with_values(values, source="drawn unit"))


def _stable(unit: Actuator) -> Actuator:
    """Return the unit with a derivative that its current loop bears, on warmer days as well."""
    from elevon.simulate.acting import check_values

    gain, time = (unit.parameters.value(f"control.{n}") for n in ("speed_gain", "derivative_time"))
    while time > _SHORTEST:
        with contextlib.suppress(InputError):
            check_values(unit.with_values({"control.speed_gain": _ROOM * gain}), "high")
            break
        time *= 0.7
        unit = unit.with_values({"control.derivative_time": time}, source="drawn unit")
    return unit


def day_of(unit: Actuator, rng: np.random.Generator) -> UnitDay:
    """Return the unit as it is on another day."""
    values: dict[str, float | str] = {}
    cell = 1.0
    for path, (spread, way) in SPREAD.items():
        step = spread * float(rng.standard_normal())
        if way == "brake":
            cell += step
            continue
        name = "sensor.current.gain_" + path[-1] if way == "fault" else path
        old = unit.parameters.value(name)
        values[name] = old + step if way == "add" else old * max(1.0 + step, 0.05)
        if path == "friction.dynamic":
            static = unit.parameters.value("friction.static")
            values["friction.static"] = static * max(1.0 + step, 0.05)
    return UnitDay(unit.with_values(values, source="day"), cell)


def drawn_faults(
    rng: np.random.Generator, candidates: Sequence[CandidateFault]
) -> dict[str, float]:
    """Return severities of no, one or two faults; small ones are drawn more often than large."""
    share = rng.random()
    count = 0 if share < HEALTHY else 1 if share < HEALTHY + SINGLE else 2
    out = {}
    for k in sorted(rng.choice(len(candidates), count, replace=False).tolist()):
        c = candidates[k]
        end = c.low if c.low < 0.0 and rng.random() < 0.5 else c.high
        out[c.key] = end * float(rng.uniform(LEAST, 1.0)) ** 2
    return out
