"""Windows of a stream: stretches of a log, and the features of each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.replay import logged_features
from elevon.diagnose.positions.command import noted_command
from elevon.diagnose.positions.features import FeatureVector
from elevon.diagnose.positions.log import RUN_IN
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.command.note import CommandNote
    from elevon.logs.log import Log

_LEAST = 400  # samples of a window that may be used
_MOVING = 0.1  # of the highest speed
#: Signals of a stream, by the names they have everywhere, and the role of each.
CHANNELS: Mapping[str, str] = {
    "encoder_position": "output_position",
    "resolver_position": "motor_position",
    "speed_ref": "speed_ref",
    "motor_speed": "motor_speed",
    "current_ref": "current_ref",
    "current_q_meas": "torque_current",
}


def period(log: Log, window: float | None) -> float:
    """Return the width of a window [s]: the one given, or one period of a noted sine.

    Raises
    ------
    InputError
        Neither is there, or a window is not positive.
    """
    if window is not None:
        if not window > 0.0:
            raise InputError(f"window of {window:g} s: must be above zero")
        return window
    note = log.note
    frequency = note.parameters.get("frequency", 0.0) if note is not None else 0.0
    if note is None or note.waveform != "sine" or not frequency > 0.0:
        raise InputError(
            f"{log.name}: its note names no sine, so the window must be given: one period of the "
            "motion, or a whole number of them; a motion that does not repeat (a chirp, a brake on "
            "a ramp) is not watched: elevon diagnose takes such a log as a whole"
        )
    return 1.0 / frequency


def top_speed(log: Log) -> float:
    """Return the highest motor speed of a log [rad/s]."""
    return float(np.nanmax(np.where(log.good, np.abs(log.speed), 0.0), initial=0.0))


def run_in(log: Log, top: float) -> float | None:
    """Return how much of a day's beginning is no window [s]: rest, and the start of the motion.

    A drive that sets off shows inertia and ripple that no window of the motion itself shows.

    Parameters
    ----------
    log : Log
        What the day begins with.
    top : float
        Highest speed of the motion [rad/s].

    Returns
    -------
    float or None
        None where it rests throughout.
    """
    fast = log.good & (np.abs(log.speed) > _MOVING * top)
    if not fast.any():
        return None
    # Half a sample before one, so that rounding decides nothing.
    return float(log.time[np.argmax(fast)] - log.time[0]) + RUN_IN - 0.5 * log.period


def cut(log: Log, width: float, *, start: float = 0.0) -> Iterator[tuple[float, Log]]:
    """Yield the whole windows of a log, each with the instant it begins [s]."""
    first = start
    while first + width <= log.duration + log.period:
        yield first, stretch(log, first, first + width)
        first += width


def stretch(log: Log, first: float, last: float) -> Log:
    """Return a part of a log, on a clock of its own."""
    return log.part((log.time >= first) & (log.time < last), first, last)


def window_features(log: Log, actuator: Actuator) -> FeatureVector | None:
    """Return the features of a window; None where it does not move both ways or lacks samples."""
    if not log.has("output_position", "motor_position"):
        raise InputError(f"{log.name}: watching needs both positions")
    good = log.good & np.isfinite(log.motor) & np.isfinite(log.output)
    top = float(np.abs(log.speed[good]).max()) if good.any() else 0.0
    ways = [int((good & (way * log.speed > _MOVING * top)).sum()) for way in (1.0, -1.0)]
    if good.sum() < _LEAST or top < 1.0 or min(ways) < _LEAST // 4:
        return None
    noted = noted_command(log, actuator.parameters.value("control.speed_limit"))
    gain = None if noted is None else (noted.gain, noted.gain_std)
    return logged_features(replace(log, gain=gain, good=good), actuator)


def motion(log: Log) -> tuple[float, float, float]:
    """Return what tells one motion from another: spread of position, RMS speed, brake's mean."""
    brake = float(np.mean(log.brake.level)) if log.brake.measured and len(log.brake.level) else 0.0
    speed = float(np.sqrt(np.nanmean(log.speed**2)))
    return float(np.nanstd(log.output)), speed, brake


def of_samples(samples: Mapping[str, Floats], note: CommandNote | None, name: str) -> Log:
    """Return the log of samples, shape (n,) each, SI.

    `time`, `CHANNELS`, and where there are any ``voltage_q_ref`` and ``brake_torque``.
    """
    from elevon.logs.brake import Brake
    from elevon.logs.log import Log

    time = samples["time"] - samples["time"][0]
    level = samples.get("brake_torque")
    brake = Brake.none() if level is None else Brake("torque", time, level)
    channels = {role: samples[signal] for signal, role in CHANNELS.items()}
    good = np.all([np.isfinite(values) for values in channels.values()], axis=0)
    if "voltage_q_ref" in samples:
        channels["torque_voltage"] = samples["voltage_q_ref"]
    start = float(samples["time"][0])
    return Log(name, time, channels, good=good, start=start, note=note, brake=brake)
