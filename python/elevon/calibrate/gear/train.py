"""Torque balance while the motor drives: inertia, friction at working speeds, efficiency.

``(k_T i - J dw/dt)/r + F = way F(v) + way (1/eta(F) - 1)|F|`` with the axial load ``F`` towards
extension; ``eta`` is the gear's times the screw's, which falls with the load.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.calibrate.blocks import stroke_blocks
from elevon.calibrate.gear.motor import Driving, Motor
from elevon.calibrate.gear.tables import KNOTS, Level, hats, knots, per_travel

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["Balance", "Known", "torque_balance"]

Floats = npt.NDArray[np.float64]
_INERTIA, _UNLOADED, _LOADED = (
    "motor.inertia", "screw.efficiency_unloaded", "screw.efficiency_loaded",
)  # fmt: skip
#: What is believed before the logs, as a share of the set's value.
_BELIEF = {_INERTIA: 0.5, _UNLOADED: 0.15, _LOADED: 0.15}
_TABLE = 0.5  # the same, of a knot of the friction
_SURE = 0.15  # of the belief: a deviation below which the logs have determined a number
_NUDGE = 1e-3  # of the torque, for what its deviation moves
_FORCE = 20.0  # N, first deviation of the residual


@dataclass(frozen=True)
class Balance:
    """What the balance determines, why it does not the rest, and its residual [N]."""

    levels: dict[str, Level]
    reasons: dict[str, str]
    residual: float


@dataclass(frozen=True)
class _Problem:
    """Stacked samples: y = axial balance without what is free."""

    names: tuple[str, ...]
    first: Floats
    belief: Floats
    data: Floats
    acceleration: Floats
    axial: Floats
    way: Floats
    tables: Floats
    gear: float
    force: float

    def model(self, x: Floats) -> Floats:
        """Return the resistance [N] of a point (shares of `first`)."""
        value = x * self.first
        inertia, unloaded, loaded = value[:3]
        size = np.abs(self.axial)
        eta = self.gear * (loaded + (unloaded - loaded) * np.exp(-size / self.force))
        lost = self.way * (1.0 / eta - 1.0) * size
        return np.asarray(inertia * self.acceleration + lost + self.tables @ value[3:])

    def slope(self, x: Floats) -> Floats:
        """Return derivatives, shape (n, p), by small differences: smooth in all of them."""
        step = 1e-6
        rows = [(self.model(x + step * e) - self.model(x - step * e)) / (2.0 * step)
                for e in np.eye(len(x))]  # fmt: skip
        return np.stack(rows, axis=1)


@dataclass(frozen=True)
class Known:
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


def torque_balance(parts: Sequence[Driving], known: Known) -> Balance:
    """Fit the train to the samples in which the motor drives under a known load."""
    ways = ("extension", "retraction")
    paths = [f"friction.ffm_{way}_{k}" for way in ways for k in range(1, KNOTS + 1)]
    open_paths = [path for path in paths if path not in known.friction]
    loaded = [part for part in parts if _knows_load(part, known.actuator)]
    if not loaded:
        why = "no motion in which the motor drives under a known load"
        return Balance({}, dict.fromkeys((_INERTIA, _UNLOADED, _LOADED, *open_paths), why), np.nan)
    # A direction that no sample shows is not free.
    shown = {_way(part) for part in loaded}
    free = [path for path in open_paths if path.split("_")[1] in shown]
    problem = _problem(loaded, known, free)
    x, covariance, degrees, residual = _solve(problem, loaded)
    spread = np.hypot(np.sqrt(np.diag(covariance)), _choices(loaded, known, free, x))
    levels, reasons = _judged(problem, x, spread, degrees)
    idle = {
        path: f"the motor does not drive in {path.split('_')[1]}"
        for path in open_paths
        if path not in free
    }
    return Balance(levels, reasons | idle, residual)


def _choices(parts: Sequence[Driving], known: Known, free: Sequence[str], x: Floats) -> Floats:
    """Deviation of a point from the scale of the torque, and from the drag with the bridge off."""
    motor = known.motor
    nudged = _solve(_problem(parts, known, free, scale=1.0 + _NUDGE), parts)[0] - x
    scale = nudged * (motor.torque_std / motor.torque / _NUDGE)
    plain = replace(known, motor=replace(motor, drag=0.0))
    drag = (_solve(_problem(parts, plain, free), parts)[0] - x) / np.sqrt(12.0)
    return np.asarray(np.hypot(scale, drag))


def _way(part: Driving) -> str:
    return "extension" if part.move.extending else "retraction"


def _knows_load(part: Driving, actuator: Actuator) -> bool:
    return "load" in part.channels or actuator.parameters.value("load.factor") > 0.0


def axial_load(part: Driving, actuator: Actuator) -> Floats:
    """Force on the ram towards extension: the leg's over the stroke, and what was recorded."""
    value = actuator.parameters.value
    if part.log.total_load and "load" in part.channels:
        return part["load"]
    places = np.linspace(0.0, value("lever.stroke"), 9)
    curve = [value(f"load.force_{k}") for k in range(9)]
    factor = float(_plain(part.log.setting("load.factor"), value("load.factor")))
    force = factor * np.interp(part["position"], places, curve)
    return force - part["load"] if "load" in part.channels else force


def _plain(setting: object, default: float) -> float:
    return float(setting) if isinstance(setting, (int, float)) else default


def _problem(
    parts: Sequence[Driving], known: Known, free: Sequence[str], *, scale: float = 1.0
) -> _Problem:
    value = known.actuator.parameters.value
    travel = 1.0 / per_travel(known.actuator)
    names = (_INERTIA, _UNLOADED, _LOADED, *free)
    data, tables = [], []
    stacked: dict[str, list[Floats]] = {"acceleration": [], "axial": [], "way": []}
    for part in parts:
        axial = axial_load(part, known.actuator)
        held, row = _friction(part, known, free)
        beside = np.interp(part["position"], *known.inertia)
        torque = known.motor.torque_of(part, scale) - beside * part["acceleration"]
        data.append(torque / travel + axial - held)
        tables.append(row)
        stacked["acceleration"].append(part["acceleration"] / travel)
        stacked["axial"].append(axial)
        stacked["way"].append(np.full(len(axial), part.move.way))
    joined = {name: np.concatenate(rows) for name, rows in stacked.items()}
    return _Problem(
        names,
        np.array([max(value(name), 1e-12) for name in names]),
        np.array([_BELIEF.get(name, _TABLE) for name in names]),
        np.concatenate(data),
        tables=np.vstack(tables),
        gear=value("gear.efficiency_first") * value("gear.efficiency_second"),
        force=value("screw.efficiency_force"),
        **joined,
    )


def _friction(part: Driving, known: Known, free: Sequence[str]) -> tuple[Floats, Floats]:
    """Friction of the knots that are known [N], and the weights of those that are free."""
    speed = part["speed"] / per_travel(known.actuator)
    weights = part.move.way * hats(speed, knots(known.actuator))
    held, row = np.zeros(len(speed)), np.zeros((len(speed), len(free)))
    for k in range(KNOTS):
        path = f"friction.ffm_{_way(part)}_{k + 1}"
        if path in known.friction:
            held += weights[:, k] * known.friction[path]
        else:
            row[:, list(free).index(path)] = weights[:, k]
    return held, row


def _solve(problem: _Problem, parts: Sequence[Driving]) -> tuple[Floats, Floats, float, float]:
    """Gauss and Newton with robust weights; covariance from scores over blocks."""
    x = np.ones(len(problem.first))
    scale = _FORCE
    prior = np.diag(problem.belief**-2.0)
    for _ in range(12):
        rest = problem.data - problem.model(x)
        slope = problem.slope(x)
        weight = 1.0 / np.maximum(1.0, np.abs(rest) / (2.0 * scale))
        heavy = slope * (weight / scale**2)[:, None]
        step = np.linalg.solve(heavy.T @ slope + prior, heavy.T @ rest - prior @ (x - 1.0))
        x = np.maximum(x + np.clip(step, -0.3, 0.3), 0.05)
        if np.max(np.abs(step)) < 1e-9:
            break
    rest = problem.data - problem.model(x)
    slope = problem.slope(x)
    blocks, at, scores = [], 0, []
    for part in parts:
        count = int(part.used.sum())
        mine = rest[at : at + count]
        scores.append(slope[at : at + count] * (mine / scale**2)[:, None])
        blocks.append(
            stroke_blocks(part.log.time[part.used], np.ones(count), mine, part.log.period)
        )
        at += count
    normal = slope.T @ slope / scale**2
    degrees = float(max(sum(int(b.max()) + 1 for b in blocks) - 3, 2))
    bread = np.linalg.inv(normal + prior)
    total = np.vstack([_sums(s, b) for s, b in zip(scores, blocks, strict=True)])
    meat = total.T @ total * (len(total) / degrees) + prior
    return x, bread @ meat @ bread, degrees, float(np.std(rest))


def _sums(score: Floats, block: npt.NDArray[np.int64]) -> Floats:
    total = np.zeros((int(block.max()) + 1, score.shape[1]))
    np.add.at(total, block, score)
    return total


def _judged(
    problem: _Problem, x: Floats, spread: Floats, degrees: float
) -> tuple[dict[str, Level], dict[str, str]]:
    levels, reasons = {}, {}
    why = "the drive's logs hardly pass the speeds or loads that would show it"
    for k, name in enumerate(problem.names):
        if spread[k] > _SURE * problem.belief[k]:
            reasons[name] = why
            continue
        first = float(problem.first[k])
        levels[name] = Level(float(x[k]) * first, float(spread[k]) * first, degrees)
    return levels, reasons
