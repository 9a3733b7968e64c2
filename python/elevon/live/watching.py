"""The monitor on the stream of a live run: a change is seen a window after it began.

Its baseline is the first stretch of a motion that the diagnosis calls healthy: a unit is compared
with itself. Another command, load or parameter begins another motion.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from elevon.errors import ElevonError
from elevon.plain import Plain
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.monitor import Monitor
    from elevon.live.trace import LiveMotion
    from elevon.logs.log import Log


_NARROWEST = 1.0  # s: a window has some hundred samples both ways
_STREAM = 600.0  # s for which thresholds are simulated
_STANDING = ("constant", "step")


@dataclass(frozen=True)
class Watch(Plain):
    """What the monitor says.

    Attributes
    ----------
    statistic : float
        Of the latest window, in units of its threshold: an alarm above one.
    windows : int
        How many were used.
    alarm : bool
        Whether it has been above one since the motion's last healthy stretch.
    since : float or None
        Where the change most likely began [s].
    """

    statistic: float
    windows: int
    alarm: bool = False
    since: float | None = None


def window_of(command: Mapping[str, Any] | None) -> float | None:
    """Return a window's width [s]: whole periods of a command that has one; None where it has none.

    Parameters
    ----------
    command : mapping or None
        As in a scenario file.
    """
    terms = [] if command is None else command.get("terms", [])
    moving = [term for term in terms if term["kind"] not in _STANDING]
    if not moving or any(term["kind"] not in ("sine", "triangle") for term in moving):
        return None
    rates = {parse_quantity(term["frequency"], "Hz", "frequency") for term in moving}
    rate = rates.pop()
    if rates or not rate > 0.0:
        return None
    return math.ceil(_NARROWEST * rate) / rate


class StreamWatch:
    """Watches the stretches of one motion after the other.

    Parameters
    ----------
    actuator : Actuator
        The healthy unit.
    """

    def __init__(self, actuator: Actuator) -> None:
        self._actuator = actuator
        self._motion: LiveMotion | None = None
        self._monitor: Monitor | None = None
        self._refused = False
        self._fed = -math.inf
        self._statistic = 0.0

    def take(self, log: Log, motion: LiveMotion, *, healthy: bool) -> Watch | None:
        """Feed what is new in a stretch; None where nothing is watched yet.

        Parameters
        ----------
        log : Log
            The stretch, from the instant ``motion.begin`` on.
        motion : LiveMotion
            What it belongs to.
        healthy : bool
            Whether the diagnosis calls it so; where it began after the alarm, watching begins anew.
        """
        self._of(motion)
        if self._monitor is None:
            return None
        alarm = self._monitor.alarm
        if healthy and alarm is not None and motion.begin > self._origin + alarm.time:
            self._monitor, self._statistic = self._monitor.fresh(), 0.0
        self._feed(log, motion.begin)
        return self._watch()

    def learn(self, log: Log, motion: LiveMotion) -> None:
        """Take a healthy stretch as the baseline of its motion, if it has none yet.

        Seconds of processor time: what every fault does to a window is simulated.
        """
        from elevon.diagnose.monitor import Monitor

        self._of(motion)
        if self._monitor is not None or self._refused or motion.window is None:
            return
        try:
            self._monitor = Monitor(self._actuator, [log], window=motion.window, longest=_STREAM)
        except ElevonError:  # too few windows, or no command: the diagnosis is alone
            self._refused = True
        self._fed = motion.begin + float(log.time[-1])

    def _of(self, motion: LiveMotion) -> None:
        """Begin anew where the motion is another one."""
        if self._motion is None or self._motion.since != motion.since:
            self._monitor, self._refused, self._statistic = None, False, 0.0
        self._motion = replace(motion)

    @property
    def _origin(self) -> float:
        origin = None if self._monitor is None else self._monitor.origin
        return 0.0 if origin is None else origin

    def _feed(self, log: Log, begin: float) -> None:
        assert self._monitor is not None
        time = log.time + begin
        new = time > self._fed
        if not new.any():
            return
        channels = {role: log[role][new] for role in self._monitor.roles if log.has(role)}
        for step in self._monitor.feed({"time": time[new], **channels}):
            if not step.skipped:
                self._statistic = step.statistic
        self._fed = float(time[-1])

    def _watch(self) -> Watch:
        assert self._monitor is not None
        alarm = self._monitor.alarm
        since = None if alarm is None else self._origin + alarm.since
        return Watch(self._statistic, self._monitor.windows, alarm is not None, since)
