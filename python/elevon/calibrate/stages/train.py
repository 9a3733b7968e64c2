"""Torque balance while the motor drives: inertia, friction at working speeds, efficiency.

``(k_T i - J dw/dt)/r + F = d F(v) + d (1/eta(F) - 1)|F|`` with the direction ``d`` and the axial
load ``F`` towards extension; ``eta`` is the gear's times the screw's, which falls with the load.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.stages.block_drive import Driving, Motor
from elevon.calibrate.stages.log import motor_ratio
from elevon.calibrate.stages.rig_tables import KNOTS, hats, knots
from elevon.estimate import Estimate, Free
from elevon.estimate.residual import BalanceFit, fit_balance

_INERTIA, _UNLOADED, _LOADED = (
    "motor.inertia", "screw.efficiency_unloaded", "screw.efficiency_loaded",
)  # fmt: skip
#: What is believed before the logs, as a share of the actuator file's value.
_BELIEF = {_INERTIA: 0.5, _UNLOADED: 0.15, _LOADED: 0.15}
_TABLE = 0.5  # the same, of a knot of the friction
_NUDGE = 1e-3  # of the torque, for what its deviation moves
_OPEN = 0.1  # of the third phase's part, as in the motor's balance
_REACH = 0.3  # weight of a knot in the samples that come nearest to it
_FORCE = 20.0  # N, first deviation of the residual


@dataclass(frozen=True)
class TrainBalance:
    """What the balance determines, why it does not the rest, and its residual [N]."""

    levels: dict[str, Estimate]
    reasons: dict[str, str]
    residual: float


@dataclass(frozen=True)
class _Samples:
    """Stacked samples: balance without what is free, and what it is made of."""

    data: Floats
    acceleration: Floats
    axial: Floats
    direction: Floats
    tables: Floats
    gear: float
    force: float

    def model(self, value: Floats) -> Floats:
        """Return the resistance [N] of inertia, efficiencies and free knots."""
        inertia, unloaded, loaded = value[:3]
        size = np.abs(self.axial)
        eta = self.gear * (loaded + (unloaded - loaded) * np.exp(-size / self.force))
        lost = self.direction * (1.0 / eta - 1.0) * size
        return np.asarray(inertia * self.acceleration + lost + self.tables @ value[3:])


@dataclass(frozen=True)
class Constants:
    """What the balance takes as it is.

    Attributes
    ----------
    actuator : Actuator
        Everything that is not free.
    motor : Motor
        The torque of an ampere.
    friction : mapping of str to float
        Knots that a rig has determined: they stay.
    inertia : tuple of ndarray
        Places of the ram [m] and what turns and swings beside the motor's own inertia [kg m2].
    """

    actuator: Actuator
    motor: Motor
    friction: Mapping[str, float]
    inertia: tuple[Floats, Floats]


def torque_balance(parts: Sequence[Driving], known: Constants) -> TrainBalance:
    """BalanceFit the train to the samples in which the motor drives under a known load."""
    moves = ("extension", "retraction")
    paths = [f"friction.ffm_{direction}_{k}" for direction in moves for k in range(1, KNOTS + 1)]
    open_paths = [path for path in paths if path not in known.friction]
    factor = known.actuator.parameters.value("load.factor")
    loaded = [part for part in parts if "load" in part.channels or factor > 0.0]
    if not loaded:
        why = "no motion in which the motor drives under a known load"
        return TrainBalance(
            {}, dict.fromkeys((_INERTIA, _UNLOADED, _LOADED, *open_paths), why), np.nan
        )
    # A direction that no sample shows is not free.
    directions = {_direction(part) for part in loaded}
    free = [path for path in open_paths if path.split("_")[1] in directions]
    about = [
        Free.about(path, max(known.actuator.parameters.value(path), 1e-12), share)
        for path, share in (*_BELIEF.items(), *((path, _TABLE) for path in free))
    ]
    fit = _fitted(loaded, known, about)
    reach = np.abs(_samples(loaded, known, free).tables).max(axis=0)
    why = "the drive's logs hardly pass the speeds or loads that would show it"
    levels, reasons = fit.widened(*_choices(loaded, known, about, fit.x)).judged(lambda _path: why)
    unreached = {path: why for path, size in zip(free, reach, strict=True) if size < _REACH}
    levels = {path: item for path, item in levels.items() if path not in unreached}
    idle = {
        path: f"the motor does not drive in {path.split('_')[1]}"
        for path in open_paths
        if path not in free
    }
    return TrainBalance(levels, reasons | unreached | idle, fit.residual)


def _fitted(
    parts: Sequence[Driving],
    known: Constants,
    about: Sequence[Free],
    *,
    scale: float = 1.0,
    third: float = 1.0,
) -> BalanceFit:
    samples = _samples(parts, known, [item.path for item in about[3:]], scale, third)
    strokes = [(p.log.time[p.used], np.ones(int(p.used.sum())), p.log.period) for p in parts]
    return fit_balance(about, samples.data, samples.model, strokes, scale=_FORCE)


def _choices(
    parts: Sequence[Driving], known: Constants, about: Sequence[Free], x: Floats
) -> tuple[Floats, Floats]:
    """What the deviation of the torque's scale moves, and a share of the third phase's part."""
    motor = known.motor
    nudged = _fitted(parts, known, about, scale=1.0 + _NUDGE).x - x
    scale = nudged * (motor.torque_std / motor.torque / _NUDGE)
    return scale, _fitted(parts, known, about, third=1.0 - _OPEN).x - x


def _direction(part: Driving) -> str:
    return "extension" if part.move.extending else "retraction"


def axial_load(part: Driving, actuator: Actuator) -> Floats:
    """Force on the ram towards extension: the leg's over the stroke, and what was recorded."""
    value = actuator.parameters.value
    if part.log.stand.whole_load and "load" in part.channels:
        return part["load"]
    places = np.linspace(0.0, value("lever.stroke"), 9)
    curve = [value(f"load.force_{k}") for k in range(9)]
    factor = float(_plain(part.log.stand.parameters.get("load.factor"), value("load.factor")))
    force = factor * np.interp(part["position"], places, curve)
    return force - part["load"] if "load" in part.channels else force


def _plain(setting: object, default: float) -> float:
    return float(setting) if isinstance(setting, (int, float)) else default


def _samples(
    parts: Sequence[Driving],
    known: Constants,
    free: Sequence[str],
    scale: float = 1.0,
    third: float = 1.0,
) -> _Samples:
    value = known.actuator.parameters.value
    travel = 1.0 / motor_ratio(known.actuator)
    data, tables = [], []
    stacked: dict[str, list[Floats]] = {"acceleration": [], "axial": [], "direction": []}
    for part in parts:
        axial = axial_load(part, known.actuator)
        known_part, row = _friction(part, known, free)
        reflected = np.interp(part["position"], *known.inertia)
        torque = known.motor.torque_of(part, scale, third) - reflected * part["acceleration"]
        data.append(torque / travel + axial - known_part)
        tables.append(row)
        stacked["acceleration"].append(part["acceleration"] / travel)
        stacked["axial"].append(axial)
        stacked["direction"].append(np.full(len(axial), part.move.direction))
    joined = {name: np.concatenate(rows) for name, rows in stacked.items()}
    gear = value("gear.efficiency_first") * value("gear.efficiency_second")
    force = value("screw.efficiency_force")
    rows = np.vstack(tables)
    return _Samples(np.concatenate(data), tables=rows, gear=gear, force=force, **joined)


def _friction(part: Driving, known: Constants, free: Sequence[str]) -> tuple[Floats, Floats]:
    """Friction of the knots that are known [N], and the weights of those that are free."""
    speed = part["speed"] / motor_ratio(known.actuator)
    weights = part.move.direction * hats(speed, knots(known.actuator))
    known_part, row = np.zeros(len(speed)), np.zeros((len(speed), len(free)))
    for k in range(KNOTS):
        path = f"friction.ffm_{_direction(part)}_{k + 1}"
        if path in known.friction:
            known_part += weights[:, k] * known.friction[path]
        else:
            row[:, list(free).index(path)] = weights[:, k]
    return known_part, row
