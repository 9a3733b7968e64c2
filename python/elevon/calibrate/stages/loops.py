"""Loops from their own set points: gain and integral action of the speed's, the position's gain.

``y = K e + K z (integral of e)`` holds exactly wherever the output is not limited; each stretch
between two limits begins with an integral of its own.

Where no set point was logged, a cascade with its speed fed forward is one PID: with
``q = N x_c - theta`` (command less position, at the motor) the torque that it asks for is
``K q' + (K k + K/T_i) q + (K k/T_i) (integral of q)`` with ``k = k_v/N``. The speed gain shows
itself; ``k`` and ``1/T_i`` are the roots of one polynomial and change places without any change of
the current.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Bools, Floats
from elevon.calibrate.stages.context import Context, motor_ratio, quick, slope, smoothed
from elevon.calibrate.stages.rig import moves_of
from elevon.estimate import Determined, Estimate
from elevon.estimate.regression import Regression, regressed
from elevon.logs.log import Log

_COLUMNS = ("gain", "integral", "set_point", "ramp")
_SHORTEST = 100  # samples of a stretch
_READING = 2.5e-4  # s between the speed that the unit has read and the one that is recorded
_TOP = 0.98  # of the largest value: the set point is limited
_EDGE = 0.05  # s at both ends of a log
_FEWEST = 200  # samples of the position loop
#: Roles that the gains of a control unit need.
UNIT_NEEDS = ("speed_ref", "torque_voltage")
_START = 0.15  # s after the drive begins, and ...
_END = 0.05  # ... before it ends: filters of the recorder reach over both
_SUPPLY = 0.99  # of the supply, from which the demand is limited
_SLOPE = 0.5  # of the usual change, about it: the set point is on its ramp
_STANDING = 1e-3  # of the ramp: the set point stands


@dataclass(frozen=True)
class _Stretch:
    """A log's set point, speed and output, and the samples that count: one stretch."""

    time: Floats
    period: float
    set_point: Floats
    speed: Floats
    output: Floats
    used: Bools


def stretches(inside: Bools) -> list[Bools]:
    """Return the contiguous runs of samples that are long enough."""
    number = np.cumsum(np.diff(inside.astype(int), prepend=0) == 1)
    runs = [inside & (number == k) for k in range(1, int(number[-1]) + 1)]
    return [used for used in runs if used.sum() >= _SHORTEST]


def _speed_loop(parts: Sequence[_Stretch], tick: float) -> Regression | None:
    """Fit gain and integral; None without stretches.

    The set point and its ramp are columns of their own: what its reading at another instant than
    the speed's adds.
    """
    rows, data, strokes = [], [], []
    for part in parts:
        h = part.period
        error = part.set_point - part.speed
        # The unit adds the error of each tick at once: half a tick more than the integral.
        total = np.cumsum(error) * h - 0.5 * h * error + 0.5 * tick * error
        ramp = np.gradient(part.set_point, h)
        rows.append(np.stack([error, total, part.set_point, ramp], axis=1)[part.used])
        data.append(part.output[part.used])
        strokes.append((part.time[part.used], np.ones(int(part.used.sum())), h))
    if not rows:
        return None
    names = (*_COLUMNS, *(f"start{k}" for k in range(len(rows))))
    return regressed(names, with_starts(rows), data, strokes, robust=False)


def with_starts(rows: Sequence[Floats]) -> list[Floats]:
    """Return the columns of stretches with one more for the start of each."""
    each = np.eye(len(rows))
    return [np.hstack([row, np.tile(each[k], (len(row), 1))]) for k, row in enumerate(rows)]


def _gain_and_zero(fit: Regression) -> tuple[Estimate, Estimate]:
    """Return the gain and the zero (one over the integral time) of a fit."""
    gain, zero = fit.estimate("gain"), fit.of(lambda b: float(b[1] / b[0]))
    # A speed read earlier or later than it is recorded adds to the gain what the integral makes of
    # it.
    late = abs(fit["integral"]) * _READING
    return gain.widened(late), zero.widened(late * zero.value / gain.value)


def position_loop(ctx: Context) -> None:
    """Gain and feed-forward of the position loop: speed set point over error and command."""
    paths = ("control.position_gain", "control.speed_feedforward")
    usable = [
        log for log in ctx.logs
        if quick(log) and log.has("command", "speed_ref", "motor_position")
        and float(np.ptp(log["command"])) > 0.0
    ]  # fmt: skip
    value, ratio = ctx.given_value, ctx.ratio
    rows, data, strokes = [], [], []
    for log in usable:
        used = _free(log, "speed_ref", value("control.speed_limit"))
        error = log["command"] - log["motor_position"] / ratio
        ahead = ratio * np.gradient(log["command"], log.period)
        bend = np.gradient(ahead, log.period)
        # A corner of the command lies between two samples.
        used &= np.abs(bend) < 10.0 * (np.median(np.abs(bend)) + 1.0)
        # A position read earlier than it is recorded adds what the error has changed by since.
        rate = np.gradient(error, log.period)
        columns = [error, ahead, bend, rate, np.ones(len(error))]
        rows.append(np.stack(columns, axis=1)[used])
        data.append(log["speed_ref"][used])
        strokes.append((log.time[used], log["motor_speed"][used], log.period))
    if sum(len(row) for row in rows) < _FEWEST:
        why = "needs the command, the motor's position and the set point of the speed"
        ctx.add({}, dict.fromkeys(paths, why))
        return
    fit = regressed(("gain", "ahead", "bend", "rate", "offset"), rows, data, strokes)
    # A command read a tick earlier or later than it is recorded moves the error.
    late = value("control.sample_time") * fit["gain"] * abs(1.0 - fit["ahead"])
    levels = {
        paths[0]: fit.estimate("gain").widened(1e-3 * fit["gain"]),
        paths[1]: fit.estimate("ahead").widened(late + 1e-3),
    }
    why = "the set point does not follow the position's error"
    ctx.add(levels if fit["gain"] > 0.0 else {}, dict.fromkeys(paths, why))


def _free(log: Log, role: str, limit: float) -> Bools:
    """Samples at which a set point is not at its limit, apart from the ends."""
    size = np.abs(log[role])
    top = min(float(np.max(size)), limit)
    limited = size > _TOP * limit if top < _TOP * limit else size > _TOP * top
    edge = (log.time < _EDGE) | (log.time > log.time[-1] - _EDGE)
    return np.asarray(~limited & ~edge)


def speed_control(ctx: Context) -> None:
    """Gain and integral time of a servo's speed loop: current set point over the speed's error."""
    paths = ("control.speed_gain", "control.integral_time")
    value = ctx.given_value
    parts = []
    for log in ctx.logs:
        if not (quick(log) and log.has("speed_ref", "current_ref")):
            continue
        inside = _free(log, "current_ref", value("control.current_limit"))
        torque = value("control.torque_constant") * log["current_ref"]
        parts += _stretched(log, torque, inside)
    # A servo's integral takes the error of a tick after it: half a tick less than the integral.
    fit = _speed_loop(parts, -value("control.sample_time"))
    if fit is None:
        ctx.add({}, dict.fromkeys(paths, "needs the set points of speed and current"))
    elif not (fit["gain"] > 0.0 and fit["integral"] > 0.0):
        ctx.add({}, dict.fromkeys(paths, "the set point does not follow the speed's error"))
    else:
        # A speed read late by d integrates to d less: what is left of its gain is K (1 - z d), that
        # of the set point, which the unit computes itself, is K.
        gain, zero = (
            fit.of(lambda b: float(b[0] + b[2])),
            fit.of(lambda b: float(b[1] / (b[0] + b[2]))),
        )
        # Whether set points are recorded before or after their tick is open.
        late = abs(fit["integral"]) * value("control.sample_time")
        zero = zero.widened(late * zero.value / gain.value)
        ctx.add({paths[0]: gain.widened(late), paths[1]: zero.inverted()})


def unit_gains(ctx: Context) -> None:
    """Gain and zero of a control unit's speed control, by direction: demand over error."""
    for name, extending in (("extension", True), ("retraction", False)):
        paths = [f"control.gain_{name}", f"control.zero_{name}"]
        complete = [log for log in ctx.logs if any(m.extending == extending for m in moves_of(log))]
        usable = [log for log in complete if log.has(*UNIT_NEEDS)]
        parts = [part for log in usable for part in _driven(log, extending=extending)]
        fit = _speed_loop(parts, ctx.given_value("control.period"))
        if fit is not None and fit["gain"] > 0.0 and fit["integral"] > 0.0:
            ctx.add(dict(zip(paths, _gain_and_zero(fit), strict=True)))
            continue
        why = f"no log of a motion in {name}"
        if complete:
            why = "the logs show no set point of the speed, or no demanded voltage"
        if usable:
            why = "the demand is at the supply's limit throughout"
        ctx.add({}, dict.fromkeys(paths, why))


def _driven(log: Log, *, extending: bool) -> list[_Stretch]:
    """Stretches of all motions in one direction in which the demand is not limited."""
    parts = []
    for move in moves_of(log):
        if move.extending == extending:
            inside = (log.time > move.begin + _START) & (log.time < move.end - _END)
            if log.has("supply_voltage"):
                inside &= np.abs(log["torque_voltage"]) < _SUPPLY * log["supply_voltage"]
            parts += _stretched(log, log["torque_voltage"], inside)
    return parts


def _stretched(log: Log, output: Floats, inside: Bools) -> list[_Stretch]:
    signals = (log["speed_ref"], log["motor_speed"], output)
    return [_Stretch(log.time, log.period, *signals, used) for used in stretches(inside)]


def set_points(ctx: Context) -> None:
    """The set point's ramp and its two levels, as the unit shows them."""
    slopes: list[float] = []
    levels: dict[str, list[float]] = {"high": [], "low": []}
    for log in ctx.logs:
        if not log.has("speed_ref"):
            continue
        for move in moves_of(log):
            inside = (log.time >= move.begin) & (log.time <= move.end)
            target = np.abs(log["speed_ref"][inside])
            if len(target) < 50:
                continue
            change = np.diff(target) / log.period
            moving = np.abs(change[change != 0.0])
            if not len(moving):
                continue
            # A jump (the unit starts afresh) is no ramp, a sample half on the ramp neither.
            typical = float(np.median(moving))
            slopes.append(float(np.median(moving[np.abs(moving - typical) < _SLOPE * typical])))
            steady = target[1:][np.abs(change) < _STANDING * typical]
            steady = steady[steady > 0.0]
            if len(steady):
                levels["high"].append(float(np.max(steady)))
                levels["low"].append(float(np.min(steady)))
    result = {"control.acceleration_limit": _level(slopes)} if slopes else {}
    if levels["high"] and max(levels["high"]) > 1.05 * min(levels["low"]):
        result |= {f"control.speed_{name}": _level(values) for name, values in levels.items()}
    paths = ("control.acceleration_limit", "control.speed_high", "control.speed_low")
    ctx.add(result, dict.fromkeys(paths, "no motion with the set point of the speed recorded"))


def _level(values: Sequence[float]) -> Estimate:
    """Median of what several motions show; a number the unit writes itself."""
    middle = float(np.median(values))
    spread = float(np.std(values)) / np.sqrt(len(values))
    return Estimate(middle, max(spread, 1e-4 * middle))


PATHS = ("control.speed_gain", "control.position_gain", "control.integral_time")
#: What they stand on.
GIVEN = ("control.torque_constant", "control.speed_feedforward")
_NEEDED = ("command", "motor_position", "torque_current")
_CURRENT, _OF_SPEED = (
    0.9,
    0.8,
)  # of the limits: the speed's set point is guessed with the file's gain
_FROM_LIMIT = 0.06  # s from a limit
_BOTH_ENDS = 0.1  # s at both ends of a log
_FEWEST_OF_STRETCH = 300  # samples of a stretch
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
    fit, other = (_fitted_pid(usable, actuator, smooth=smooth) for smooth in (False, True))
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


def _fitted_pid(logs: Sequence[Log], actuator: Actuator, *, smooth: bool) -> Regression | None:
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
            if used.sum() >= _FEWEST_OF_STRETCH:
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
    limited |= np.abs(demand) > _OF_SPEED * value("control.speed_limit")
    limited |= (log.time < _BOTH_ENDS) | (log.time > log.time[-1] - _BOTH_ENDS)
    width = 2 * round(_FROM_LIMIT / log.period) + 1
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
