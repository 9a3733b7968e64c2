"""The control unit: gains of its speed control from its own set point and demand; its limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.calibrate.gear.log import GearLog, Move
from elevon.calibrate.gear.tables import Level
from elevon.calibrate.regression import Regression, with_deviations

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["NEEDS", "gains", "set_points"]

Floats = npt.NDArray[np.float64]
#: Roles that the gains need.
NEEDS = ("speed_ref", "torque_voltage")
_COLUMNS = ("gain", "integral", "set_point", "ramp")
_START = 0.15  # s after the drive begins, and ...
_END = 0.05  # ... before it ends: filters of the recorder reach over both
_READING = 0.25  # of a tick, between the speed that the unit has read and the one that is shown
_FEWEST = 100  # samples of a stretch
_LIMIT = 0.99  # of the supply, from which the demand is limited
_SLOPE = 0.5  # of the usual change, about it: the set point is on its ramp
_STILL = 1e-3  # of the ramp: the set point stands


def gains(logs: Sequence[GearLog], actuator: Actuator) -> tuple[dict[str, Level], dict[str, str]]:
    """Return gain and zero of the speed control by direction, and why one is not determined.

    ``V = K e + K z (integral of e)``, exact where the demand is not limited. The set point and
    its ramp are columns of their own: what its reading at another instant than the speed's adds.
    """
    determined: dict[str, Level] = {}
    reasons: dict[str, str] = {}
    for name, extending in (("extension", True), ("retraction", False)):
        paths = [f"control.gain_{name}", f"control.zero_{name}"]
        shown = [log for log in logs if any(m.extending == extending for m in log.moves)]
        usable = [log for log in shown if log.has(*NEEDS)]
        if not usable:
            why = f"no log of a motion in {name}"
            if shown:
                why = "the logs show no set point of the speed, or no demanded voltage"
            reasons |= dict.fromkeys(paths, why)
            continue
        fit = _regression(usable, actuator, extending=extending)
        if fit is None or not (fit["gain"] > 0.0 and fit["integral"] > 0.0):
            reasons |= dict.fromkeys(paths, "the demand is at the supply's limit throughout")
            continue
        determined |= _gain_levels(fit, name, actuator.parameters.value("control.period"))
    return determined, reasons


def _regression(
    logs: Sequence[GearLog], actuator: Actuator, *, extending: bool
) -> Regression | None:
    tick = actuator.parameters.value("control.period")
    parts, data, times = [], [], []
    moves = [(one, move) for one in logs for move in one.moves if move.extending == extending]
    pairs = [(one, used) for one, move in moves for used in _stretches(one, move)]
    for log, used in pairs:
        h = log.period
        error = log["speed_ref"] - log["motor_speed"]
        # The unit adds the error of each tick at once: half a tick more than the integral.
        total = np.cumsum(error) * h - 0.5 * h * error + 0.5 * tick * error
        ramp = np.gradient(log["speed_ref"], h)
        parts.append(np.stack([error, total, log["speed_ref"], ramp], axis=1)[used])
        data.append(log["torque_voltage"][used])
        times.append((log.time[used], np.ones(int(used.sum())), h))
    if not parts:
        return None
    # Each stretch begins with an integral of its own.
    start = np.repeat(np.eye(len(parts)), [len(part) for part in parts], axis=0)
    design, values = np.hstack([np.vstack(parts), start]), np.concatenate(data)
    value, *_ = np.linalg.lstsq(design, values, rcond=None)
    names = (*_COLUMNS, *(f"start{k}" for k in range(len(parts))))
    rest = values - design @ value
    return with_deviations(names, value, design, rest, np.ones(len(rest)), times=times)


def _stretches(log: GearLog, move: Move) -> list[npt.NDArray[np.bool_]]:
    """Samples of a motion between two instants at which the demand is limited."""
    inside = (log.time > move.begin + _START) & (log.time < move.end - _END)
    if log.has("supply_voltage"):
        inside &= np.abs(log["torque_voltage"]) < _LIMIT * log["supply_voltage"]
    number = np.cumsum(np.diff(inside.astype(int), prepend=0) == 1)
    stretches = [inside & (number == k) for k in range(1, int(number[-1]) + 1)]
    return [used for used in stretches if used.sum() >= _FEWEST]


def _gain_levels(fit: Regression, name: str, tick: float) -> dict[str, Level]:
    gain, integral = fit["gain"], fit["integral"]
    zero = integral / gain
    slope = np.zeros(len(fit.value))
    slope[0], slope[1] = -integral / gain**2, 1.0 / gain
    spread = float(np.sqrt(slope @ fit.covariance @ slope))
    # A speed read earlier or later than it is shown adds to the gain what the integral makes of it.
    late = abs(integral) * _READING * tick
    return {
        f"control.gain_{name}": Level(gain, float(np.hypot(fit.std("gain"), late)), fit.degrees),
        f"control.zero_{name}": Level(
            zero, float(np.hypot(spread, late * zero / gain)), fit.degrees
        ),
    }


def set_points(logs: Sequence[GearLog]) -> dict[str, Level]:
    """Return the set point's ramp and its two levels, as the unit shows them."""
    slopes: list[float] = []
    levels: dict[str, list[float]] = {"high": [], "low": []}
    for log in logs:
        if not log.has("speed_ref"):
            continue
        for move in log.moves:
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
            still = target[1:][np.abs(change) < _STILL * typical]
            still = still[still > 0.0]
            if len(still):
                levels["high"].append(float(np.max(still)))
                levels["low"].append(float(np.min(still)))
    if not slopes:
        return {}
    result = {"control.acceleration_limit": _level(slopes)}
    if levels["high"] and max(levels["high"]) > 1.05 * min(levels["low"]):
        result |= {f"control.speed_{name}": _level(values) for name, values in levels.items()}
    return result


def _level(values: Sequence[float]) -> Level:
    """Median of what several motions show; a number the unit writes itself."""
    middle = float(np.median(values))
    spread = float(np.std(values)) / np.sqrt(len(values))
    return Level(middle, max(spread, 1e-4 * middle))
