"""The control unit: gains of its speed control from its own set point and demand; its limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from elevon.calibrate.gear.log import GearLog
from elevon.calibrate.level import Level
from elevon.calibrate.speed_loop import Stretch, gain_and_zero, speed_loop, stretches

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["NEEDS", "gains", "set_points"]

#: Roles that the gains need.
NEEDS = ("speed_ref", "torque_voltage")
_START = 0.15  # s after the drive begins, and ...
_END = 0.05  # ... before it ends: filters of the recorder reach over both
_LIMIT = 0.99  # of the supply, from which the demand is limited
_SLOPE = 0.5  # of the usual change, about it: the set point is on its ramp
_STANDING = 1e-3  # of the ramp: the set point stands


def gains(logs: Sequence[GearLog], actuator: Actuator) -> tuple[dict[str, Level], dict[str, str]]:
    """Return gain and zero of the speed control by direction, and why one is not determined.

    ``V = K e + K z (integral of e)``, exact where the demand is not limited. The set point and
    its ramp are columns of their own: what its reading at another instant than the speed's adds.
    """
    determined: dict[str, Level] = {}
    reasons: dict[str, str] = {}
    tick = actuator.parameters.value("control.period")
    for name, extending in (("extension", True), ("retraction", False)):
        paths = [f"control.gain_{name}", f"control.zero_{name}"]
        complete = [log for log in logs if any(m.extending == extending for m in log.moves)]
        usable = [log for log in complete if log.has(*NEEDS)]
        if not usable:
            why = f"no log of a motion in {name}"
            if complete:
                why = "the logs show no set point of the speed, or no demanded voltage"
            reasons |= dict.fromkeys(paths, why)
            continue
        fit = speed_loop(_parts(usable, extending=extending), tick)
        if fit is None or not (fit["gain"] > 0.0 and fit["integral"] > 0.0):
            reasons |= dict.fromkeys(paths, "the demand is at the supply's limit throughout")
            continue
        determined |= dict(zip(paths, gain_and_zero(fit), strict=True))
    return determined, reasons


def _parts(logs: Sequence[GearLog], *, extending: bool) -> list[Stretch]:
    """Stretches of all motions in one direction in which the demand is not limited."""
    parts = []
    for log in logs:
        for move in log.moves:
            if move.extending != extending:
                continue
            inside = (log.time > move.begin + _START) & (log.time < move.end - _END)
            if log.has("supply_voltage"):
                inside &= np.abs(log["torque_voltage"]) < _LIMIT * log["supply_voltage"]
            complete = (log["speed_ref"], log["motor_speed"], log["torque_voltage"])
            parts += [Stretch(log.time, log.period, *complete, used) for used in stretches(inside)]
    return parts


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
            steady = target[1:][np.abs(change) < _STANDING * typical]
            steady = steady[steady > 0.0]
            if len(steady):
                levels["high"].append(float(np.max(steady)))
                levels["low"].append(float(np.min(steady)))
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
