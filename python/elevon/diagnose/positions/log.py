"""A log as diagnosis by the model sees it: checked, with the command that the model is given."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.kinematics import command_fit
from elevon.diagnose.positions.features import carried, regress
from elevon.errors import InputError
from elevon.logs.command.reconstruct import reconstruct
from elevon.logs.drive import drive_log, thinned

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log


Bools = npt.NDArray[np.bool_]
_TAU = 2.0 * math.pi
_SMALL = 0.02  # RMS of the misfit over the spread, above which the note does not explain the log
_STEPS = 8  # of Gauss and Newton
_LATEST = 0.25  # of the log: a chirp begins before it
_SCAN = 0.02  # s between the starts tried
_THIN = 1200  # samples of a scan
_LEAST = 400
_OUTLIER = 8.0  # robust deviations beyond which an early sample was under another command


@dataclass(frozen=True)
class NotedWaveform:
    """What the note and the set point say together.

    Attributes
    ----------
    gain, gain_std : float
        Position gain [1/s].
    wave : ndarray, shape (n,)
        The command [rad] at the log's instants.
    window : (float, float)
        First and last instant at which it explains the log [s].
    """

    gain: float
    gain_std: float
    wave: Floats
    window: tuple[float, float]


def noted_command(log: Log, limit: float) -> NotedWaveform | None:
    """Fit the noted waveform; None where there is no note, or it does not explain the log.

    Parameters
    ----------
    log : Log
        With the output's position.
    limit : float
        Of the speed set point [rad/s]; what stands at it is left out.
    """
    note = log.note
    if note is None or not log.has("output_position") or note.waveform not in ("sine", "chirp"):
        return None
    # A drive may have another limit than stated; a sample beside one at it may be the mean of both.
    limit = min(limit, float(np.nanmax(np.abs(log.speed_ref))))
    cut = np.pad(np.abs(log.speed_ref) >= 0.999 * limit, 1)
    inside = log.good & ~(cut[:-2] | cut[1:-1] | cut[2:]) & np.isfinite(log.output)
    known = note.parameters
    if inside.sum() < _LEAST:
        return None
    if note.waveform == "sine":
        frequency = known.get("frequency", 0.0)
        return _solved(log, inside, frequency, {}) if frequency * log.duration > 0.5 else None
    if not known.get("sweep_time", 0.0) > 0.0:
        return None
    if not {"start_frequency", "end_frequency"} <= known.keys():
        return None
    return _solved(log, inside, _scanned(log, inside, known), known)


def _phase(unknown: float, time: Floats, sweep: Mapping[str, float]) -> tuple[Floats, Floats]:
    """Return the phase [rad] at instants, and what the unknown does to it.

    The unknown is a sine's frequency [Hz]; where a sweep is noted, the instant [s] at which the
    chirp starts.
    """
    if not sweep:
        return _TAU * unknown * time, _TAU * time
    first, seconds = sweep["start_frequency"], sweep["sweep_time"]
    rate = (sweep["end_frequency"] - first) / seconds
    since = np.clip(time - unknown, 0.0, seconds)
    slope = np.where((since > 0.0) & (since < seconds), -_TAU * (first + rate * since), 0.0)
    return _TAU * (first + 0.5 * rate * since) * since, slope


def _columns(log: Log, turn: Floats, at: npt.NDArray[np.intp]) -> list[Floats]:
    ref = log.speed_ref[at]
    return [np.sin(turn), np.cos(turn), np.ones(len(turn)), -ref, np.sign(ref)]


def _scanned(log: Log, inside: Bools, sweep: Mapping[str, float]) -> float:
    """Coarse search of the chirp's start, on samples behind the latest one allowed."""
    at = np.flatnonzero(inside & (log.time > _LATEST * log.duration))
    at = at[:: max(1, len(at) // _THIN)]
    target, costs = log.output[at], []
    starts = np.arange(0.0, _LATEST * log.duration, _SCAN)
    for start in starts:
        rows = np.stack(_columns(log, _phase(float(start), log.time[at], sweep)[0], at))
        right = rows @ target
        beta = np.linalg.lstsq(rows @ rows.T, right, rcond=1e-12)[0]
        costs.append(-float(beta @ right))
    return float(starts[int(np.argmin(costs))])


def _solved(
    log: Log, inside: Bools, first: float, sweep: Mapping[str, float]
) -> NotedWaveform | None:
    """Gauss and Newton in the one unknown, first on the late half, then on all it explains."""
    value = first
    at = np.flatnonzero(inside & (log.time > 0.5 * log.duration))
    for final in (False, True):
        for _ in range(_STEPS):
            beta, covariance, residual, step = _step(log, at, value, sweep)
            value += step
        if not final:
            spread = 1.4826 * float(np.median(np.abs(residual - np.median(residual))))
            turn = _phase(value, log.time, sweep)[0]
            at = _explained(log, np.flatnonzero(inside), turn, beta, spread)
    if len(at) < _LEAST or float(residual.std()) > _SMALL * float(np.std(log.output)):
        return None
    if not beta[3] > 0.0:
        return None
    turn, _ = _phase(value, log.time, sweep)
    wave = beta[0] * np.sin(turn) + beta[1] * np.cos(turn) + beta[2]
    std = float(np.sqrt(max(covariance[3, 3], 0.0)))
    window = (float(log.time[at[0]]), float(log.time[at[-1]]))
    return NotedWaveform(1.0 / float(beta[3]), std / float(beta[3]) ** 2, wave, window)


def _step(
    log: Log, at: npt.NDArray[np.intp], value: float, sweep: Mapping[str, float]
) -> tuple[Floats, Floats, Floats, float]:
    """Regression at one value of the unknown, and the step that its slope asks for."""
    turn, slope = _phase(value, log.time[at], sweep)
    columns = _columns(log, turn, at)
    beta, _ = regress(columns, log.output[at])
    bend = slope * (beta[0] * columns[1] - beta[1] * columns[0])
    both, covariance = regress([*columns, bend], log.output[at])
    residual = log.output[at] - both @ np.stack([*columns, bend])
    return beta, covariance, residual, float(both[-1])


def _explained(
    log: Log, at: npt.NDArray[np.intp], turn: Floats, beta: Floats, spread: float
) -> npt.NDArray[np.intp]:
    """Samples behind the last one that the fit of the late half does not explain."""
    off = log.output[at] - beta @ np.stack(_columns(log, turn[at], at))
    strays = np.flatnonzero(np.abs(off[: len(off) // 2]) > max(_OUTLIER * spread, 1e-9))
    return at[strays[-1] + 1 :] if strays.size else at


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
