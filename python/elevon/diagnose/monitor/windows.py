"""Windows of a stream: what is read of each, the same of a log and of samples as they come.

A turning servo's windows are read by its positions, any other actuator's by the roles of its logs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.engine.table import FeatureVector
from elevon.diagnose.monitor.cutter import CutWindow, WindowCutter
from elevon.errors import InputError, unknown
from elevon.logs.brake import Brake
from elevon.logs.log import Log
from elevon.logs.maps.column_map import known_roles, known_signals

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.candidates import CandidateFault
    from elevon.diagnose.engine.replay import Replay
    from elevon.logs.command.note import CommandNote


COUNTS = "good"  # a channel of ours: NaN where a sample of a log does not count
SAME = 0.2  # relative difference of motion up to which a window is of the baselines' motion
NO_MOTION = "hardly any motion, or no samples"
OTHER = "not the baselines' motion"


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

    def table(self, log: Log) -> Floats:
        """Return the channels of a log, shape (n, c)."""
        good = np.where(log.good, 1.0, np.nan)
        return np.column_stack([good if role == COUNTS else log[role] for role in self.roles])

    def at(self, *roles: str) -> list[int]:
        """Return where channels stand, and the one that says which samples count."""
        return [k for k, role in enumerate(self.roles) if role in (*roles, COUNTS)]

    def log(self, window: CutWindow, units: Mapping[str, str] | None = None) -> Log:
        """Return a window as a log of its own, as it came."""
        channels = {role: window.values[:, k] for k, role in enumerate(self.roles)}
        good = np.isfinite(channels.pop(COUNTS, np.zeros(len(window.time))))
        level, brake = channels.pop("brake_torque", None), self.brake
        if level is not None:
            brake = Brake("torque", window.time, level)
        log = Log(
            self.name, window.time, channels, units or {}, good=good, note=self.note, brake=brake
        )
        return log.part(np.ones(len(window.time), dtype=np.bool_), window.start, window.end)


class Windows(ABC):
    """What is read of the windows of one motion.

    Attributes
    ----------
    actuator : Actuator
        The healthy unit.
    baselines : list of Log
        Of it, ready.
    width : float
        Of a window [s].
    roles : tuple of str
        All that is read of a stream.
    within_day : float
        Least deviation from window to window, over that from day to day.
    of_faults : float
        Least deviation of what the model says a fault does to a number, likewise.
    """

    actuator: Actuator
    baselines: list[Log]
    width: float
    roles: tuple[str, ...]
    within_day: float = 0.0
    of_faults: float = 0.0

    @abstractmethod
    def ready(self, log: Log) -> Log:
        """Return a log as it is fed: on one clock, its gaps as they are."""

    @abstractmethod
    def watched(self, name: str, roles: Sequence[str]) -> tuple[str, ...]:
        """Return those roles of a day that are watched.

        Raises
        ------
        InputError
            One that is needed is missing.
        """

    @abstractmethod
    def cutter(self, day: Day) -> WindowCutter:
        """Return what cuts a day."""

    @abstractmethod
    def read(self, day: Day, window: CutWindow, *, any_motion: bool = False) -> FeatureVector | str:
        """Return the features of a window, or why it is not used.

        Parameters
        ----------
        day : Day
            Of the window.
        window : CutWindow
            As it was cut.
        any_motion : bool
            Whether its motion may be another than the baselines'.
        """

    @abstractmethod
    def model(self, candidates: Sequence[CandidateFault]) -> Replay:
        """Return what the model shows in a window, healthy and with each fault."""

    def day(self, log: Log) -> Day:
        """Return the day that a log is."""
        roles = self.watched(log.name, list(log.channels))
        return Day(log.name, roles if log.good.all() else (*roles, COUNTS), log.note, log.brake)

    def of(self, log: Log) -> Iterator[FeatureVector]:
        """Yield the features of the whole windows of a log in which its unit moves."""
        for day, window in self.cut(log):
            got = self.read(day, window, any_motion=True)
            if not isinstance(got, str):
                yield got

    def cut(self, log: Log) -> Iterator[tuple[Day, CutWindow]]:
        """Yield the whole windows of a log's motion, as a monitor cuts them."""
        day = self.day(log)
        cutter = self.cutter(day)
        for window in [*cutter.take(log.time, day.table(log)), *cutter.finish()]:
            if window.why == "window":
                yield day, window


def stretch(log: Log, first: float, last: float) -> Log:
    """Return a part of a log, on a clock of its own."""
    return log.part((log.time >= first) & (log.time < last), first, last)


def usable(window: CutWindow, least: int) -> bool:
    """Whether a window has enough samples that count."""
    return window.counts.taken - window.counts.empty >= least


def apart(a: Sequence[float], b: Sequence[float]) -> bool:
    """Whether two motions differ in one of their numbers."""
    return any(abs(x - y) > SAME * max(abs(x), abs(y)) for x, y in zip(a, b, strict=True))


LATEST = 1e12  # s: a time stamp beyond that is none


def by_role(
    samples: Mapping[str, npt.ArrayLike], read: Collection[str]
) -> tuple[Floats, dict[str, Floats]]:
    """Return time stamps, shape (n,), and channels by role, of samples by role or signal.

    Signals whose role is not among those that are read are left out.

    Raises
    ------
    InputError
        No time or none that is finite, a name that is neither, two channels with one role, no
        numbers, lengths that differ.
    """
    out: dict[str, Floats] = {}
    for name, values in samples.items():
        role = _role(name, read)
        if role in out:
            raise InputError(f"stream: {name!r} has the role {role}, and so has another channel")
        if role:
            out[role] = _column(name, values)
    if "time" not in out:
        raise InputError("stream: 'time' is missing")
    time = out.pop("time")
    odd = {role: len(values) for role, values in out.items() if len(values) != len(time)}
    if odd:
        role, count = odd.popitem()
        raise InputError(f"stream: {len(time)} time stamps, {count} values of {role}")
    if not (np.abs(time) <= LATEST).all():
        wrong = time[~(np.abs(time) <= LATEST)][0]
        raise InputError(f"stream: time stamp {wrong:g} s: must be finite, at most {LATEST:g} s")
    return time, out


def _role(name: str, read: Collection[str]) -> str:
    """Return the role of a name; empty of a signal that nothing here reads."""
    if name in read or name in known_roles():
        return name
    signals = known_signals()
    if name not in signals:
        raise unknown("channel", name, [*known_roles(), *signals], "stream")
    role = signals[name].role
    return role if role in read else ""


def _column(name: str, values: npt.ArrayLike) -> Floats:
    try:
        column = np.atleast_1d(np.asarray(values, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise InputError(f"stream: {name}: no numbers: {error}") from error
    if column.ndim != 1:
        raise InputError(f"stream: {name} has the shape {column.shape}; one value a sample")
    return np.where(np.isfinite(column), column, np.nan)
