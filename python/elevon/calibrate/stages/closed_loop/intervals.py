"""How well each number is known: colour of residuals, misfit of the model, what is confounded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.stages.closed_loop.fit import Fitted
from elevon.calibrate.stages.closed_loop.log import CURRENT_GAIN, STICK, motion
from elevon.calibrate.stages.closed_loop.model import LoopModel
from elevon.calibrate.stages.context import FALL, LOAD_SHARE
from elevon.estimate import Free
from elevon.estimate.covariance import block_covariance
from elevon.estimate.lanes import Lanes, Point

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
_RATIO = "friction.reverse_scale"
_LIMITS = ("control.current_limit", "control.speed_limit", "inverter.supply_voltage")


class Silence(StrEnum):
    """Why the logs do not feel a number: it stays as given."""

    NO_EFFECT = "changes nothing that the logs show"
    LIMIT = "the logs do not reach this limit"


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
    lanes = fitted.lanes
    point = lanes.point(fitted.x)
    jac = lanes.jacobian([point], central=True)[0]
    weight = lanes.weight(point.residual)
    normal, scores = jac.T @ (weight[:, None] * jac), weight * point.residual
    belief = lanes.belief**2 * np.eye(len(fitted.x))
    covariance, degrees = block_covariance(
        normal, jac * scores[:, None], lanes.blocks(scores), prior=belief
    )
    gain = np.asarray(np.linalg.solve(lanes.normal(jac, weight), jac.T * weight), np.float64)
    covariance = covariance + _misfit(lanes, point, jac, weight)
    covariance = covariance + _choices(fitted, point, gain)
    covariance = covariance + _directions(fitted) + _lagged(lanes.free, fitted.x)
    reasons = _reasons(lanes, fitted.x, covariance, np.sqrt(np.diag(normal)))
    return [
        Knowledge(f, float(x), float(std), reason)
        for f, x, std, reason in zip(
            lanes.free, fitted.x, np.sqrt(np.diag(covariance)), reasons, strict=True
        )
    ], degrees


def _misfit(lanes: Lanes, point: Point, jac: Floats, weight: Floats) -> Floats:
    """Spread of the values over other weights of channels and logs, by one step of Newton each.

    A model that is not the machine fits each channel with values of its own; where they agree,
    weights do not matter.
    """
    every = list(zip(lanes.channels, lanes.slices, strict=True))
    names = dict.fromkeys(item.name for item in lanes.channels)
    groups = [[place for item, place in every if item.name == name] for name in names]
    logs = dict.fromkeys(item.log for item in lanes.channels)
    groups += [[place for item, place in every if item.log == log] for log in logs]
    rows: list[Floats] = [np.zeros(jac.shape[1])]
    for group in (group for group in groups if len(group) < len(every)):
        for factor in _WEIGHTS:
            other = weight.copy()
            for place in group:
                other[place] *= factor
            slope = lanes.slope(point, jac, other)
            rows.append(np.asarray(np.linalg.solve(lanes.normal(jac, other), slope), np.float64))
    moved = np.array(rows)
    return np.asarray(moved.T @ moved / max(len(rows) - 1, 1), np.float64)


def _choices(fitted: Fitted, point: Point, gain: Floats) -> Floats:
    """What choices of the model that no slow log settles would change, by one step of Newton each.

    Each alternative is run once at the same values; the late drive as a longer step of the model,
    its effect scaled to `_LATE` where the lag of the current loop was not fitted. Where it was, the
    lag is shorter by what the longer step waits: a delay takes nothing from an amplitude.
    """
    model, free = fitted.model, fitted.lanes.free
    later = _later(model)
    lags = any(item.path == CURRENT_GAIN for item in free)
    total = np.zeros((len(free), len(free)))
    for changes in _alternatives(fitted):
        other = model.actuator.with_values(changes, source="calibration")
        run = LoopModel(other, model.logs, model.structure, model.check).lanes(free)
        run.scales = fitted.lanes.scales
        x = _hastened(fitted, 0.5 * later) if "low.step" in changes else point.x
        moved = gain @ (run.residual(x[None, :])[0] - point.residual)
        if "low.step" in changes and not lags:
            moved = moved * (_LATE / later)
        total += np.outer(moved, moved)
    return total


def _lagged(free: Sequence[Free], x: Floats) -> Floats:
    """What the lag of the current loop in place of a drive's delay takes from others."""
    if all(item.path != CURRENT_GAIN for item in free):
        return np.zeros((len(x), len(x)))
    moved = [
        _LAG_FOR_DELAY.get(item.path, 0.0) * abs(item.outer(float(v)) / item.slope(float(v)))
        for item, v in zip(free, x, strict=True)
    ]
    return np.diag(np.square(moved))


def _hastened(fitted: Fitted, by: float) -> Floats:
    """Return the point with a shorter lag of the current loop, where that is fitted."""
    x = np.array(fitted.x)
    inductance = fitted.model.actuator.parameters.value("motor.winding_inductance")
    for k, item in enumerate(fitted.lanes.free):
        if item.path == CURRENT_GAIN:
            lag = max(inductance / item.outer(float(x[k])) - by, inductance / item.high)
            x[k] = item.inner(inductance / lag)
    return x


def _directions(fitted: Fitted) -> Floats:
    """What a constant load may take from the friction of both directions.

    Friction f and load L show as f + L in one direction and r f - L in the other, whatever moves:
    two sums of three numbers. The third comes from what is believed of the ratio r, and from laws
    of friction.
    """
    free, values = fitted.lanes.free, fitted.values
    moved = np.zeros(len(free))
    if {"friction.dynamic", _RATIO, "load.constant"} <= values.keys():
        dry, ratio = values["friction.dynamic"], values[_RATIO]
        place = {item.path: k for k, item in enumerate(free)}
        change = -free[place[_RATIO]].spread * ratio / (1.0 + ratio)
        for path, amount in (
            ("friction.dynamic", change * dry),
            ("load.constant", -change * dry * fitted.model.per_output),
            (_RATIO, -change * (1.0 + ratio)),
        ):
            k = place[path]
            moved[k] = amount / free[k].slope(float(fitted.x[k]))
    return np.outer(moved, moved)


def _later(model: LoopModel) -> float:
    return max(0.5 * model.actuator.parameters.value("low.step"), _LEAST_LATER)


def _alternatives(fitted: Fitted) -> list[dict[str, str | float]]:
    """List other models that would follow the logs as well.

    A drive acts some time after it has read; friction may fall with speed or grow with the torque.
    Where it does, it may fall over half or twice the speed, and what the torque adds to it may
    stick as much above its moving value as the rest.
    """
    model, values = fitted.model, fitted.values
    parameters = model.actuator.parameters
    steps: list[dict[str, str | float]] = [
        {"low.step": parameters.value("low.step") + _later(model)}
    ]
    if str(parameters["friction.law"].value) != "load_dependent":
        tops = [np.nanmax(np.abs(motion(log, model.per_output)[0])) for log in model.logs]
        speed = float(max(tops))
        steps += [
            {"friction.law": law, "friction.stribeck_speed": FALL * speed}
            for law in ("stribeck", "load_dependent")
        ]
        return steps
    fall = parameters.value("friction.stribeck_speed")
    share = values.get(LOAD_SHARE, parameters.value(LOAD_SHARE))
    sticking = min((values.get(STICK, 1.0) - 1.0) * share, 0.98 - share)
    steps += [{"friction.stribeck_speed": factor * fall} for factor in (0.5, 2.0)]
    return [*steps, {"friction.load_motor_stribeck": max(sticking, 0.0)}]


def _reasons(lanes: Lanes, x: Floats, covariance: Floats, strength: Floats) -> list[str]:
    """Why each number is not determined; empty where it is."""
    spread = np.sqrt(np.diag(covariance))
    together = covariance / np.outer(spread, spread)
    reasons = []
    for k, f in enumerate(lanes.free):
        wide = spread[k] * f.spread > _SHARE if f.log_scale else spread[k] > _TENTH
        bound = min(x[k] - lanes.low[k], lanes.high[k] - x[k]) < 1e-6
        if not wide and not bound:
            reasons.append("")
        elif strength[k] < _SILENT:
            reasons.append(Silence.LIMIT if f.path in _LIMITS else Silence.NO_EFFECT)
        elif bound and f.path != "friction.stick":
            reasons.append(f"ends at its bound, {f.outer(float(x[k])):.4g} {f.unit}")
        else:
            reasons.append(_confounded(lanes.free, together[k], k, wide))
    return reasons


def _confounded(free: Sequence[Free], row: Floats, k: int, wide: bool) -> str:
    order = [j for j in np.argsort(-np.abs(row)) if j != k and abs(row[j]) > _TOGETHER]
    if not wide:
        return ""
    if order:
        return "changes the logs as " + " and ".join(free[j].path for j in order[:2]) + " would"
    return "the residuals are larger than its effect"
