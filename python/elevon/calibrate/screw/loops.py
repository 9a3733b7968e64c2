"""Position and speed loop from their own set points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.level import Level
from elevon.calibrate.regression import Regression, robust_regression, with_deviations
from elevon.calibrate.screw.log import ScrewLog
from elevon.calibrate.speed_loop import Stretch, gain_and_zero, speed_loop, stretches

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["position_loop", "speed_control"]

_LIMIT = 0.98  # of the largest value: the set point is limited
_EDGE = 0.05  # s at both ends of a log
_FEWEST = 200  # samples


def position_loop(
    logs: Sequence[ScrewLog], actuator: Actuator
) -> tuple[dict[str, Level], dict[str, str]]:
    """Return gain and feed-forward of the position loop: speed set point over error and command."""
    paths = ("control.position_gain", "control.speed_feedforward")
    usable = [
        log for log in logs
        if log.quick and log.has("command", "speed_ref", "motor_position")
        and float(np.ptp(log["command"])) > 0.0
    ]  # fmt: skip
    value = actuator.parameters.value
    ratio = value("gear.ratio") / value("screw.lead")
    rows, data, times = [], [], []
    for log in usable:
        used = _free(log, "speed_ref", value("control.speed_limit"))
        error = log["command"] - log["motor_position"] / ratio
        ahead = ratio * np.gradient(log["command"], log.period)
        bend = np.gradient(ahead, log.period)
        # A corner of the command lies between two samples.
        used &= np.abs(bend) < 10.0 * (np.median(np.abs(bend)) + 1.0)
        columns = [error, ahead, bend, np.ones(len(error))]
        rows.append(np.stack(columns, axis=1)[used])
        data.append(log["speed_ref"][used])
        times.append((log.time[used], log["motor_speed"][used], log.period))
    if sum(len(row) for row in rows) < _FEWEST:
        why = "needs the command, the motor's position and the set point of the speed"
        return {}, dict.fromkeys(paths, why)
    design = np.vstack(rows)
    fit = _fit(design, np.concatenate(data), ("gain", "ahead", "bend", "offset"), times)
    # A command read a tick earlier or later than it is recorded moves the error.
    late = value("control.sample_time") * fit["gain"] * abs(1.0 - fit["ahead"])
    levels = {
        paths[0]: Level(fit["gain"], fit.std("gain"), fit.degrees).widened(1e-3 * fit["gain"]),
        paths[1]: Level(fit["ahead"], fit.std("ahead"), fit.degrees).widened(late + 1e-3),
    }
    if not fit["gain"] > 0.0:
        return {}, dict.fromkeys(paths, "the set point does not follow the position's error")
    return levels, {}


def _fit(
    design: Floats, data: Floats, names: tuple[str, ...],
    times: Sequence[tuple[Floats, Floats, float]],
) -> Regression:  # fmt: skip
    value, residual, weight, _ = robust_regression(design, data)
    return with_deviations(names, value, design, residual, weight, times=times)


def _free(log: ScrewLog, role: str, limit: float) -> npt.NDArray[np.bool_]:
    """Samples at which a set point is not at its limit, apart from the ends."""
    size = np.abs(log[role])
    top = min(float(np.max(size)), limit)
    limited = size > _LIMIT * limit if top < _LIMIT * limit else size > _LIMIT * top
    edge = (log.time < _EDGE) | (log.time > log.time[-1] - _EDGE)
    return np.asarray(~limited & ~edge)


def speed_control(
    logs: Sequence[ScrewLog], actuator: Actuator
) -> tuple[dict[str, Level], dict[str, str]]:
    """Return gain and integral time of the speed loop: current set point over the speed's error."""
    paths = ("control.speed_gain", "control.integral_time")
    value = actuator.parameters.value
    tick, torque = value("control.sample_time"), value("control.torque_constant")
    parts = []
    for log in logs:
        if not (log.quick and log.has("speed_ref", "current_ref")):
            continue
        inside = _free(log, "current_ref", value("control.current_limit"))
        signals = (log["speed_ref"], log["motor_speed"], torque * log["current_ref"])
        parts += [Stretch(log.time, log.period, *signals, used) for used in stretches(inside)]
    fit = speed_loop(parts, tick)
    if fit is None:
        return {}, dict.fromkeys(paths, "needs the set points of speed and current")
    if not (fit["gain"] > 0.0 and fit["integral"] > 0.0):
        return {}, dict.fromkeys(paths, "the set point does not follow the speed's error")
    gain, zero = gain_and_zero(fit)
    time = 1.0 / zero.value
    return {paths[0]: gain, paths[1]: Level(time, zero.std * time**2, zero.degrees)}, {}
