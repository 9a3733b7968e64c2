"""How well each number is known: colour of residuals, misfit of the model, what is confounded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.blocks import block_length
from elevon.calibrate.closed_loop.fit import Fitted
from elevon.calibrate.closed_loop.free import CURRENT_GAIN, LOAD_SHARE, STICK, Free, outer
from elevon.calibrate.closed_loop.model import LoopModel
from elevon.calibrate.closed_loop.objective import Objective
from elevon.calibrate.closed_loop.refine import FALL
from elevon.calibrate.closed_loop.solve import Point, jacobian

__all__ = ["SILENT", "Knowledge", "known"]

_SHARE = 0.2  # of a logarithm: a deviation above which a number is not determined
_TENTH = 0.5  # of its meaningful size, for an offset or a delay
_SILENT = 1.0  # deviations of all residuals together that a whole spread moves
_TOGETHER = 0.7  # correlation that is named
_LEAST_LATER = 5e-4  # s, by which the alternative's step is longer
_LATE = 1.5e-3  # s between reading and acting of a drive with a tick of a millisecond
#: Share by which a number is off where a lag of the current loop stands for the delay of a drive
#: that samples: a lag takes from an amplitude, a delay does not. ASSUMED: what fits of 24 foreign
#: drives with 2 to 2.5 ms of delay showed; no log at 10 ms tells one from the other.
_LAG_FOR_DELAY = {
    "control.pid_gain": 0.025,
    "control.pid_derivative_time": 0.003,
    "motor.inertia": 0.008,
    "control.current_limit": 0.005,
    "control.pid_integral_time": 0.004,
}
_WEIGHTS = (0.25, 4.0)  # of a channel or log against the others: what a misfit would change
#: Reasons of numbers that the logs do not feel: they stay as given.
SILENT = ("changes nothing that the logs show", "the logs do not reach this limit")
_RATIO = "friction.reverse_scale"
_LIMITS = ("control.current_limit", "control.speed_limit", "inverter.supply_voltage")


@dataclass(frozen=True)
class Knowledge:
    """What is known of one number.

    Attributes
    ----------
    free : Free
        Which.
    x : float
        Fitted variable.
    std : float
        Its deviation, in the fitted variable.
    reason : str
        Why it is not determined; empty: it is.
    """

    free: Free
    x: float
    std: float
    reason: str

    @property
    def value(self) -> float:
        """SI."""
        return self.free.outer(self.x)

    @property
    def deviation(self) -> float:
        """Standard deviation, SI."""
        return abs(self.free.slope(self.x)) * self.std

    def interval(self, width: float) -> tuple[float, float]:
        """Return the interval of some deviations' half width, inside the bounds."""
        low, high = (self.free.outer(self.x + s * width * self.std) for s in (-1.0, 1.0))
        return max(low, self.free.low), min(high, self.free.high)


def known(fitted: Fitted) -> tuple[list[Knowledge], float]:
    """Return what is known of each number, and the degrees of freedom of the intervals."""
    objective, x = fitted.objective, fitted.x
    residual = objective.residual(x[None, :])[0]
    point = Point(x, residual, objective.cost(residual, x))
    jac = jacobian(objective, [point], central=True)[0]
    weight = objective.weight(residual)
    belief = objective.belief**2 * np.eye(len(x))
    normal = jac.T @ (weight[:, None] * jac) + belief
    bread = np.linalg.inv(normal)
    sums = _block_sums(objective, jac, weight * residual)
    degrees = float(max(len(sums) - len(x), 1))
    colour = sums.T @ sums * (len(sums) / degrees)
    covariance = bread @ (colour + belief) @ bread + _misfit(objective, point, jac, weight)
    covariance = covariance + _choices(objective, point, bread @ (jac.T * weight))
    covariance = covariance + _directions(objective, x) + _lagged(objective, x)
    strength = np.sqrt(np.einsum("np,n,np->p", jac, weight, jac))
    return [
        Knowledge(f, float(x[k]), float(np.sqrt(covariance[k, k])), reason)
        for k, (f, reason) in enumerate(
            zip(objective.free, _reasons(objective, x, covariance, strength), strict=True)
        )
    ], degrees


def _slices(objective: Objective) -> dict[tuple[int, str], slice]:
    begin, slices = 0, {}
    for key in objective.keys:
        count = int(objective.masks[key].sum())
        slices[key] = slice(begin, begin + count)
        begin += count
    return slices


def _block_sums(objective: Objective, jac: Floats, weighted: Floats) -> Floats:
    """Scores of all channels summed over blocks of time longer than any residual's memory."""
    places = _slices(objective)
    sums = []
    for k, log in enumerate(objective.model.logs):
        keys = [key for key in objective.keys if key[0] == k]
        memory = max(block_length(weighted[places[key]], log.period) for key in keys)
        total = np.zeros((int(log.duration / memory) + 1, jac.shape[1]))
        for key in keys:
            block = np.floor(log.time[objective.masks[key]] / memory).astype(np.int64)
            score = jac[places[key]] * weighted[places[key], None]
            np.add.at(total, block, score)
        sums.append(total[np.any(total != 0.0, axis=1)])
    return np.vstack(sums)


def _misfit(objective: Objective, point: Point, jac: Floats, weight: Floats) -> Floats:
    """Spread of the values over other weights of channels and logs, by one step of Newton each.

    A model that is not the machine fits each channel with values of its own; where they agree,
    weights do not matter.
    """
    places = _slices(objective)
    groups = [[key for key in places if key[1] == name] for name in objective.model.channels]
    groups += [[key for key in places if key[0] == k] for k in range(len(objective.model.logs))]
    groups = [group for group in groups if group and len(group) < len(places)]
    size = jac.shape[1]
    total = np.zeros((size, size))
    count = 0
    for group in groups:
        for factor in _WEIGHTS:
            w = weight.copy()
            for key in group:
                w[places[key]] *= factor
            normal = jac.T @ (w[:, None] * jac) + objective.belief**2 * np.eye(size)
            slope = jac.T @ (w * point.residual) + objective.belief * objective.prior(point.x)
            moved = -np.linalg.solve(normal, slope)
            total += np.outer(moved, moved)
            count += 1
    return total / max(count, 1)


def _choices(objective: Objective, point: Point, gain: Floats) -> Floats:
    """What choices of the model that no slow log settles would change, by one step of Newton each.

    Each alternative is run once at the same values; the late drive as a longer step of the model,
    its effect scaled to `_LATE` where the lag of the current loop was not fitted. Where it was, the
    lag is shorter by what the longer step waits: a delay takes nothing from an amplitude.
    """
    model = objective.model
    later = _later(model)
    lags = any(item.path == CURRENT_GAIN for item in objective.free)
    total = np.zeros((gain.shape[0], gain.shape[0]))
    for changes in _alternatives(objective, point.x):
        other = model.actuator.with_values(changes, source="calibration")
        changed = LoopModel(other, model.logs, model.structure, model.check)
        run = Objective(changed, objective.free)
        run.scales = objective.scales
        x = _hastened(objective, point.x, 0.5 * later) if "low.step" in changes else point.x
        moved = gain @ (run.residual(x[None, :])[0] - point.residual)
        if "low.step" in changes and not lags:
            moved = moved * (_LATE / later)
        total += np.outer(moved, moved)
    return total


def _lagged(objective: Objective, x: Floats) -> Floats:
    """What the lag of the current loop in place of a drive's delay takes from others."""
    free = objective.free
    if all(item.path != CURRENT_GAIN for item in free):
        return np.zeros((len(x), len(x)))
    moved = [
        _LAG_FOR_DELAY.get(item.path, 0.0) * abs(item.outer(float(v)) / item.slope(float(v)))
        for item, v in zip(free, x, strict=True)
    ]
    return np.diag(np.square(moved))


def _hastened(objective: Objective, x: Floats, by: float) -> Floats:
    """Return the point with a shorter lag of the current loop, where that is fitted."""
    x = np.array(x)
    inductance = objective.model.actuator.parameters.value("motor.winding_inductance")
    for k, item in enumerate(objective.free):
        if item.path == CURRENT_GAIN:
            lag = max(inductance / item.outer(float(x[k])) - by, inductance / item.high)
            x[k] = item.inner(inductance / lag)
    return x


def _directions(objective: Objective, x: Floats) -> Floats:
    """What a constant load may take from the friction of both directions.

    Friction f and load L show as f + L in one direction and r f - L in the other, whatever moves:
    two sums of three numbers. The third comes from what is believed of the ratio r, and from laws
    of friction.
    """
    values = outer(objective.free, x)
    total = np.zeros((len(x), len(x)))
    if not {"friction.dynamic", _RATIO, "load.constant"} <= values.keys():
        return total
    dry, ratio = values["friction.dynamic"], values[_RATIO]
    place = {item.path: k for k, item in enumerate(objective.free)}
    change = -objective.free[place[_RATIO]].spread * ratio / (1.0 + ratio)
    moved = np.zeros(len(x))
    for path, amount in (
        ("friction.dynamic", change * dry),
        ("load.constant", -change * dry * objective.model.per_output),
        (_RATIO, -change * (1.0 + ratio)),
    ):
        k = place[path]
        moved[k] = amount / objective.free[k].slope(float(x[k]))
    return np.asarray(total + np.outer(moved, moved))


def _later(model: LoopModel) -> float:
    return max(0.5 * model.actuator.parameters.value("low.step"), _LEAST_LATER)


def _alternatives(objective: Objective, x: Floats) -> list[dict[str, str | float]]:
    """List other models that would follow the logs as well.

    A drive acts some time after it has read; friction may fall with speed or grow with the torque.
    Where it does, it may fall over half or twice the speed, and what the torque adds to it may
    stick as much above its moving value as the rest.
    """
    model = objective.model
    parameters = model.actuator.parameters
    steps: list[dict[str, str | float]] = [
        {"low.step": parameters.value("low.step") + _later(model)}
    ]
    if str(parameters["friction.law"].value) != "load_dependent":
        speed = max(float(np.nanmax(np.abs(log.motion(model.per_output)[0]))) for log in model.logs)
        steps += [
            {"friction.law": law, "friction.stribeck_speed": FALL * speed}
            for law in ("stribeck", "load_dependent")
        ]
        return steps
    fall, values = parameters.value("friction.stribeck_speed"), outer(objective.free, x)
    share = values.get(LOAD_SHARE, parameters.value(LOAD_SHARE))
    sticking = min((values.get(STICK, 1.0) - 1.0) * share, 0.98 - share)
    steps += [{"friction.stribeck_speed": factor * fall} for factor in (0.5, 2.0)]
    return [*steps, {"friction.load_motor_stribeck": max(sticking, 0.0)}]


def _reasons(objective: Objective, x: Floats, covariance: Floats, strength: Floats) -> list[str]:
    """Why each number is not determined; empty where it is."""
    spread = np.sqrt(np.diag(covariance))
    together = covariance / np.outer(spread, spread)
    reasons = []
    for k, f in enumerate(objective.free):
        wide = spread[k] * f.spread > _SHARE if f.log_scale else spread[k] > _TENTH
        bound = min(x[k] - objective.low[k], objective.high[k] - x[k]) < 1e-6
        if not wide and not bound:
            reasons.append("")
        elif strength[k] < _SILENT and f.path in _LIMITS:
            reasons.append(SILENT[1])
        elif strength[k] < _SILENT:
            reasons.append(SILENT[0])
        elif bound and f.path != "friction.stick":
            reasons.append(f"ends at its bound, {f.outer(float(x[k])):.4g} {f.unit}")
        else:
            reasons.append(_confounded(objective.free, together[k], k, wide))
    return reasons


def _confounded(free: Sequence[Free], row: Floats, k: int, wide: bool) -> str:
    order = [j for j in np.argsort(-np.abs(row)) if j != k and abs(row[j]) > _TOGETHER]
    if not wide:
        return ""
    if order:
        return "changes the logs as " + " and ".join(free[j].path for j in order[:2]) + " would"
    return "the residuals are larger than its effect"
