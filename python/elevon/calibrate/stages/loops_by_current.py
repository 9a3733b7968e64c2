"""Both loops where no set point was logged: a cascade with its speed fed forward is one PID.

With ``q = N x_c - theta`` (command less position, at the motor) the torque that a cascade with feed
forward 1 asks for is ``K q' + (K k + K/T_i) q + (K k/T_i) (integral of q)`` with ``k = k_v/N``. The
speed gain shows itself; ``k`` and ``1/T_i`` are the roots of one polynomial and change places
without any change of the current.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Bools, Floats
from elevon.calibrate.stages.context import Context
from elevon.calibrate.stages.log import motor_ratio
from elevon.calibrate.stages.loops import stretches, with_starts
from elevon.calibrate.stages.smooth import quick, slope, smoothed
from elevon.estimate import Determined, Estimate
from elevon.estimate.regression import Regression, regressed
from elevon.logs.log import Log

PATHS = ("control.speed_gain", "control.position_gain", "control.integral_time")
#: What they stand on.
GIVEN = ("control.torque_constant", "control.speed_feedforward")
_NEEDED = ("command", "motor_position", "torque_current")
_CURRENT, _SPEED = 0.9, 0.8  # of the limits: the speed's set point is guessed with the file's gain
_APART = 0.06  # s from a limit
_EDGE = 0.1  # s at both ends of a log
_FEWEST = 300  # samples of a stretch
_PARTED = 0.15  # of a root: a deviation from which the two are not separated
_CLEAR = 1.5  # ratio of the actuator file's k and 1/T_i from which their order is taken as known


@dataclass(frozen=True)
class _Roots:
    """Sum and product of ``k`` and ``1/T_i``."""

    total: Estimate
    product: Estimate

    def pair(self) -> tuple[Estimate, Estimate]:
        """Return the larger and the smaller root; one middle where they cannot be parted."""
        middle = 0.5 * self.total.value
        gap = middle**2 - self.product.value
        open_ = float(np.hypot(middle * self.total.std, self.product.std))
        half = float(np.sqrt(max(gap, 0.0)))
        # Near a double root the gap's deviation is its own root.
        std = float(np.hypot(0.5 * self.total.std, open_ / (2.0 * max(half, 0.5 * open_**0.5))))
        degrees = self.total.degrees
        return Estimate(middle + half, std, degrees), Estimate(middle - half, std, degrees)


def loops_by_current(ctx: Context) -> None:
    """Speed gain, position gain and integral time, where the loops' own set points gave neither."""
    if PATHS[0] in ctx.levels or PATHS[1] in ctx.levels:
        return
    ctx.add(*_determined(ctx.logs, ctx.actuator))
    ctx.stands_on(PATHS, GIVEN)


def _determined(logs: Sequence[Log], actuator: Actuator) -> Determined:
    """Return what command, motor's position and current determine, and why not the rest."""
    value = actuator.parameters.value
    usable = [log for log in logs if quick(log) and log.has(*_NEEDED)]
    if value("control.speed_feedforward") != 1.0:
        return {}, dict.fromkeys(PATHS, "needs the set points of speed and current")
    fit, other = (_fitted(usable, actuator, smooth=smooth) for smooth in (False, True))
    if fit is None or other is None or not (fit["rate"] > 0.0 < other["rate"]):
        return {}, dict.fromkeys(PATHS, "needs command, motor's position and current below limits")
    both = [_ratios(item) for item in (fit, other)]
    # How quick a part of the current counts is open: its own loop is no part of the balance.
    gain, total, product = (_between(*pair) for pair in zip(*both, strict=True))
    levels = _assigned(_Roots(total, product), actuator)
    why = (
        f"the speed is fed forward: k_v/N and 1/T_i change places without any change of the "
        f"current, and lie near each other; their sum is {total.value:.3g} 1/s"
    )
    parted = {p: item for p, item in levels.items() if item.std < _PARTED * item.value}
    return {PATHS[0]: gain, **parted}, {p: why for p in levels if p not in parted}


def _fitted(logs: Sequence[Log], actuator: Actuator, *, smooth: bool) -> Regression | None:
    value = actuator.parameters.value
    constant, tick = value("control.torque_constant"), value("control.sample_time")
    ratio = motor_ratio(actuator)
    rows, data, strokes = [], [], []
    for log in logs:
        h = log.period
        error = ratio * log["command"] - log["motor_position"]
        ahead = ratio * slope(log["command"], h)
        total = np.cumsum(error) * h - 0.5 * (h - tick) * error
        columns = [ahead - log["motor_speed"], error, total, slope(log["torque_current"], h)]
        demand = constant * log["torque_current"]
        if smooth:
            columns, demand = [smoothed(x, h) for x in columns], smoothed(demand, h)
        for used in stretches(_unlimited(log, error, ahead, actuator)):
            if used.sum() >= _FEWEST:
                rows.append(np.stack(columns, axis=1)[used])
                data.append(demand[used])
                strokes.append((log.time[used], log["motor_speed"][used], h))
    if not rows:
        return None
    names = ("rate", "error", "total", "lag", *(f"start{k}" for k in range(len(rows))))
    return regressed(names, with_starts(rows), data, strokes)


def _unlimited(log: Log, error: Floats, ahead: Floats, actuator: Actuator) -> Bools:
    value = actuator.parameters.value
    demand = value("control.position_gain") / motor_ratio(actuator) * error + ahead
    limited = np.abs(log["torque_current"]) > _CURRENT * value("control.current_limit")
    limited |= np.abs(demand) > _SPEED * value("control.speed_limit")
    limited |= (log.time < _EDGE) | (log.time > log.time[-1] - _EDGE)
    width = 2 * round(_APART / log.period) + 1
    return np.convolve(limited.astype(float), np.ones(width), mode="same") < 0.5


def _between(first: Estimate, second: Estimate) -> Estimate:
    """Middle of two readings that are as good; half of what parts them is open."""
    half = 0.5 * (second.value - first.value)
    return Estimate(first.value + half, max(first.std, second.std), first.degrees).widened(half)


def _ratios(fit: Regression) -> tuple[Estimate, Estimate, Estimate]:
    """Gain, and sum and product of the roots."""
    total, product = (fit.of(lambda b, k=k: float(b[k] / b[0])) for k in (1, 2))  # type: ignore[misc]
    return fit.estimate("rate"), total, product


def _assigned(roots: _Roots, actuator: Actuator) -> dict[str, Estimate]:
    """Give each loop its root, by the actuator file's order; if unclear, both their middle."""
    value, ratio = actuator.parameters.value, motor_ratio(actuator)
    position, integral = value(PATHS[1]) / ratio, 1.0 / value(PATHS[2])
    fast, slow = roots.pair()
    if max(position, integral) < _CLEAR * min(position, integral):
        middle = 0.5 * (fast.value + slow.value)
        fast = slow = Estimate(middle, fast.std, fast.degrees).widened(fast.value - middle)
    first, second = (fast, slow) if position > integral else (slow, fast)
    return {PATHS[1]: first.scaled(ratio), PATHS[2]: second.inverted()}
