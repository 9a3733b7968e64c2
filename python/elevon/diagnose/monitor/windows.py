"""Windows of a stream: stretches of a log, and the features of each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.table import FeatureVector
from elevon.diagnose.monitor.cutter import CutWindow, WindowCutter
from elevon.diagnose.positions.command import noted_command
from elevon.diagnose.positions.log import RUN_IN
from elevon.diagnose.positions.reading import logged_features
from elevon.errors import InputError
from elevon.logs.brake import Brake
from elevon.logs.drive import drive_log
from elevon.logs.log import Log

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.command.note import CommandNote

_LEAST = 400  # samples of a window that may be used
_MOVING = 0.1  # of the highest speed
_COUNTS = "good"  # a channel of ours: NaN where a sample of a log does not count
#: Without these, and one of the currents, a stream cannot be watched.
NEEDED = ("speed_ref", "motor_speed", "motor_position", "output_position")
CURRENTS = ("torque_current", "current_ref")  # the measured one first
#: All that is read of a stream. ``brake_torque``: on the motor's shaft [N m], as a baseline's load
#: cell gives it.
ROLES = (*NEEDED, *CURRENTS, "torque_voltage", "brake_torque")


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


def windows_of(log: Log, width: float) -> Iterator[Log]:
    """Yield the whole windows of a log in which its unit may move, as a monitor cuts them."""
    day = Day.of(log)
    cutter = day.cutter(width, top_speed(log))
    for window in [*cutter.take(log.time, day.table(log)), *cutter.finish()]:
        if window.why == "window" and usable(window):
            yield drive_log(day.log(window))


def stretch(log: Log, first: float, last: float) -> Log:
    """Return a part of a log, on a clock of its own."""
    return log.part((log.time >= first) & (log.time < last), first, last)


def usable(window: CutWindow) -> bool:
    """Whether a window has enough samples that count."""
    return window.counts.taken - window.counts.empty >= _LEAST


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


@dataclass(frozen=True)
class Day:
    """What the samples of a day have in common.

    Attributes
    ----------
    name : str
        Of the log or stream.
    roles : tuple of str
        Of its channels, in their order.
    note : CommandNote or None
        What the operator knows.
    brake : Brake
        As measured; a channel ``brake_torque`` takes its place.
    """

    name: str
    roles: tuple[str, ...]
    note: CommandNote | None
    brake: Brake

    @classmethod
    def of(cls, log: Log) -> Day:
        """Return the day that a log is."""
        roles = stream_roles(log.name, list(log.channels))
        return cls(log.name, roles if log.good.all() else (*roles, _COUNTS), log.note, log.brake)

    @staticmethod
    def _good(log: Log) -> Floats:
        return np.where(log.good, 1.0, np.nan)

    def table(self, log: Log) -> Floats:
        """Return the channels of a log, shape (n, c)."""
        return np.column_stack(
            [self._good(log) if role == _COUNTS else log[role] for role in self.roles]
        )

    def cutter(self, width: float, top: float) -> WindowCutter:
        """Return what cuts the day; `top` is the highest speed of the motion."""
        current = next(role for role in CURRENTS if role in self.roles)
        needed = [self.roles.index(role) for role in (*NEEDED, current)]
        needed += [self.roles.index(role) for role in self.roles if role == _COUNTS]
        speed = self.roles.index("motor_speed")
        return WindowCutter(width, RUN_IN, _MOVING * top, speed, needed)

    def log(self, window: CutWindow) -> Log:
        """Return a window as a log of its own, as it came."""
        channels = {role: window.values[:, k] for k, role in enumerate(self.roles)}
        good = np.isfinite(channels.pop(_COUNTS, np.zeros(len(window.time))))
        level, brake = channels.pop("brake_torque", None), self.brake
        if level is not None:
            brake = Brake("torque", window.time, level)
        log = Log(self.name, window.time, channels, good=good, note=self.note, brake=brake)
        return log.part(np.ones(len(window.time), dtype=np.bool_), window.start, window.end)


def stream_roles(name: str, roles: Sequence[str]) -> tuple[str, ...]:
    """Return those roles that are watched.

    Raises
    ------
    InputError
        One that is needed is missing.
    """
    missing = [role for role in NEEDED if role not in roles]
    if not any(role in roles for role in CURRENTS):
        missing.append(" or ".join(CURRENTS))
    if missing:
        raise InputError(
            f"{name}: no channel has the role {', '.join(missing)}; watching needs both positions, "
            f"speed, its set point and a torque current; roles: {', '.join(roles) or 'none'}"
        )
    return tuple(role for role in ROLES if role in roles)
