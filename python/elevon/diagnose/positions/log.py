"""A log as diagnosis by the model sees it: checked, with the command that the model is given."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.kinematics import command_fit
from elevon.diagnose.positions.command import noted_command
from elevon.diagnose.positions.features import regress
from elevon.diagnose.positions.lost_motion import carried
from elevon.errors import InputError
from elevon.logs.command.reconstruct import reconstruct
from elevon.logs.drive import drive_log, thinned

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

RUN_IN = 1.0  # s left out: the start of the motion
_RATIO = 0.05  # relative: a gear ratio seen in the log this far off is another actuator's
LONGEST = 40.0  # s that are read: every candidate is run through them
_RATE = 400.0  # Hz, at least, of a log that is longer: the model's signals have no more
_LEAST_TIME = 4.0  # s of log
_LEAST_LEFT = _LEAST_TIME - RUN_IN  # s of it that can be used
_MOVING = 0.1  # of the highest speed


def prepared(log: Log, actuator: Actuator) -> Log:
    """Check that a log can be diagnosed, and rebuild its command.

    Returns
    -------
    Log
        With the channel ``command``, which the model is given: the waveform, else rebuilt from set
        point and position; with the position gain where a waveform explains it; samples of the
        run-in do not count.

    Raises
    ------
    InputError
        Too short, no motion, motion one way only, no position, or of another actuator.
    """
    if prepared in log.memory:
        return log
    log = _first_part(drive_log(log))
    if not log.has("output_position", "motor_position"):
        raise InputError(f"{log.name}: diagnosis by the model needs both positions (r4820, r4821)")
    if log.duration < _LEAST_TIME:
        raise InputError(f"{log.name}: lasts {log.duration:.3g} s; {_LEAST_TIME:g} s are needed")
    good = log.good & (log.time >= RUN_IN) & np.isfinite(log.motor) & np.isfinite(log.output)
    left = float(good.mean()) * log.duration
    if left < _LEAST_LEFT:
        raise InputError(
            f"{log.name}: only {left:.2g} s of {log.duration:.3g} s can be used, the rest is "
            f"missing or run-in; {_LEAST_LEFT:g} s are needed"
        )
    _check_motion(log, good, actuator)
    wave, gain = _command(log, actuator)
    ready = replace(log.with_channels(command=wave), gain=gain, good=good)
    ready.memory[prepared] = True
    return ready


def _first_part(log: Log) -> Log:
    """A long log as far as it is read, from the run-in before it moves, at the model's rate."""
    if log.duration <= LONGEST * (1.0 + 1e-9):
        return log
    speed = np.where(log.good, np.abs(log.speed), 0.0)
    first = float(log.time[int(np.argmax(speed > _MOVING * speed.max()))])
    start = max(min(first - RUN_IN, log.duration - LONGEST), 0.0)
    keep = (log.time >= start) & (log.time <= start + LONGEST)
    begin = float(log.time[int(np.argmax(keep))])
    return thinned(log.part(keep, begin, begin + LONGEST), _RATE)


def _command(log: Log, actuator: Actuator) -> tuple[Floats, tuple[float, float] | None]:
    """What the model is given, and the position gain with its deviation if a waveform shows it."""
    value = actuator.parameters.value
    gain, limit = value("control.position_gain"), value("control.speed_limit")
    trace = reconstruct(log.time, log.speed_ref, log.output, gain=gain, limit=limit)
    if trace.coverage < 0.05:
        raise InputError(f"{log.name}: the speed set point is at its limit; no command is seen")
    rebuilt = np.interp(log.time, log.time[trace.valid], trace.position[trace.valid])
    noted = noted_command(log, limit)
    if noted is not None:
        wave = _joined(log, trace.valid, rebuilt, noted.wave, noted.window)
        return wave, (noted.gain, noted.gain_std)
    fit = command_fit(log, gain, limit)
    if fit is None:
        return rebuilt, None
    wave = _joined(log, trace.valid, rebuilt, fit.values, fit.waveform.window)
    return wave, (fit.gain, fit.gain_std)


def _joined(
    log: Log,
    valid: npt.NDArray[np.bool_],
    rebuilt: Floats,
    wave: Floats,
    window: tuple[float, float],
) -> Floats:
    """Return the waveform where it explains the log or the set point is cut off; else rebuilt."""
    inside = (log.time >= window[0]) & (log.time <= window[1])
    return np.where(inside | (~valid & (log.time <= window[1])), wave, rebuilt)


def _check_motion(log: Log, good: npt.NDArray[np.bool_], actuator: Actuator) -> None:
    top = float(np.abs(log.speed[good]).max()) if good.any() else 0.0
    count = actuator.parameters.value("gear.ratio") * 1e-3
    if top < 1.0 or float(np.ptp(log.motor[good])) < count:
        raise InputError(
            f"{log.name}: nothing moves (motor up to {top:.3g} rad/s); a jam, an open phase or a "
            "supply that is gone would do that, and more cannot be found without motion"
        )
    for way, text in ((1.0, "forwards"), (-1.0, "backwards")):
        if (good & (way * log.speed > _MOVING * top)).sum() < 100:
            raise InputError(
                f"{log.name}: hardly any motion {text}; friction and backlash need both"
            )
    ratio = actuator.parameters.value("gear.ratio")
    moving = good & (np.abs(log.speed) > _MOVING * top)
    # Past the backlash only, and with the direction beside the position: backlash would tilt the
    # line of a short motion.
    gap = log.motor / ratio - log.output
    past = moving & carried(log.motor / ratio, float(np.ptp(gap[moving])))
    moving = past if past.sum() > 100 else moving
    columns = [log.output[moving], np.sign(log.speed[moving]), np.ones(int(moving.sum()))]
    slope = float(regress(columns, log.motor[moving])[0][0])
    if not abs(slope / ratio - 1.0) < _RATIO:
        raise InputError(
            f"{log.name}: the motor turns {slope:.4g} times as far as the output, {actuator.name} "
            f"has a gear ratio of {ratio:.4g}: a log of another actuator, or another shaft"
        )
