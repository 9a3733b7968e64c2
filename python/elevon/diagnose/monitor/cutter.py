"""Samples as they come, cut into windows: what is late, doubled, missing is counted, not mended.

The same cutter serves a whole log and a stream, in whatever portions its samples come.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.monitor.filter import needed
from elevon.errors import FormatError, InputError
from elevon.logs.clocks.clock_fit import clock_quality
from elevon.plain import Plain

Bools = npt.NDArray[np.bool_]
_FIRST = 200  # samples of a day that give its period
_GAP = 1.5  # an interval longer than this many periods lacks samples
_PORTION = 4096  # samples that are looked at together
_MOST = 4_000_000  # samples of an open window
_MANY = 1e12  # more missing samples than that are not counted


@dataclass(frozen=True)
class SampleCounts(Plain):
    """Samples between the end of one window and the end of the next.

    Attributes
    ----------
    taken : int
        Of the window, those put in their place among them.
    missing : int
        By the day's period.
    empty : int
        Of `taken`: without a value that is needed.
    doubled : int
        With the time stamp of another one of the open window: the first stays.
    out_of_order : int
        Earlier than one before them, their window still open: put in their place.
    late : int
        Their window was closed: left out.
    unreadable : int
        Lines that are no sample: left out.
    """

    taken: int = 0
    missing: int = 0
    empty: int = 0
    doubled: int = 0
    out_of_order: int = 0
    late: int = 0
    unreadable: int = 0

    def __add__(self, other: SampleCounts) -> SampleCounts:
        pairs = ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self))
        return SampleCounts(*(a + b for a, b in pairs))


@dataclass(frozen=True)
class CutWindow:
    """A stretch of a day: a window, or what lies where windows would be.

    Attributes
    ----------
    start, end : float
        From the day's first sample [s].
    time : ndarray, shape (n,)
        From the day's first sample [s], increasing.
    values : ndarray, shape (n, c)
        The channels.
    counts : SampleCounts
        What came since the one before.
    why : str
        ``window``; ``rest``: before the motion; ``gap``: whole windows without a sample;
        ``late``: samples of a window's width that came after their window was closed.
    """

    start: float
    end: float
    time: Floats
    values: Floats
    counts: SampleCounts
    why: str = "window"


@dataclass
class DayPlace(Plain):
    """Where in its day a stream stands.

    Attributes
    ----------
    origin : float
        Time stamp of the day's first sample [s]; NaN before it.
    last : float
        Latest sample, here and below from `origin` [s].
    start : float
        Of the open window.
    fast : float
        First sample of the motion; NaN before it.
    run_in : bool
        Whether what the motion begins with is not past.
    seen : float
        Up to where missing samples are counted.
    back : float
        Earliest of the late samples since one was in time; NaN where there is none.
    first : tuple of float
        The day's first samples.
    level : float
        What was commanded, where windows are cut by that: at first, or last.
    """

    origin: float = math.nan
    last: float = -math.inf
    start: float = 0.0
    fast: float = math.nan
    run_in: bool = False
    seen: float = math.nan
    back: float = math.nan
    first: tuple[float, ...] = ()
    level: float = math.nan


@dataclass
class WindowCutter:
    """Cuts a day of samples into windows.

    A day begins with its first sample. While the unit rests its windows are counted from there;
    those of the motion begin `lead` after its first fast sample, half a sample before one, so that
    rounding decides nothing.

    Parameters
    ----------
    width, lead : float
        Of a window; of what a motion begins with [s].
    fast : float
        Speed above which the unit moves.
    speed : int
        Which channel is the speed.
    needed : sequence of int
        Channels without which a sample does not count.
    """

    width: float
    lead: float
    fast: float
    speed: int
    needed: Sequence[int]
    place: DayPlace = field(default_factory=DayPlace)
    pending: SampleCounts = field(default_factory=SampleCounts)
    times: list[Floats] = field(default_factory=list)
    values: list[Floats] = field(default_factory=list)
    _known: tuple[int, float] = (0, math.nan)  # so many first samples have this period

    @property
    def period(self) -> float:
        """Spacing of the day's first samples [s]; NaN of less than two."""
        count = len(self.place.first)
        if count >= 2 and count != self._known[0]:
            self._known = count, clock_quality("stream", np.array(self.place.first)).period
        return self._known[1]

    def take(self, stamps: Floats, values: Floats) -> list[CutWindow]:
        """Take samples; return the windows that became whole.

        Parameters
        ----------
        stamps : ndarray, shape (n,)
            Time stamps [s], finite.
        values : ndarray, shape (n, c)
            The channels; NaN where a value is missing.

        Raises
        ------
        InputError
            An open window with more samples than the limit.
        """
        out: list[CutWindow] = []
        if math.isnan(self.place.origin) and len(stamps):
            self.place.origin = float(stamps[0])
        time = stamps - self.place.origin
        for first in range(0, len(time), _PORTION):
            out += self._portion(time[first : first + _PORTION], values[first : first + _PORTION])
        return out

    def finish(self) -> list[CutWindow]:
        """Return the open window where it lacks no more than a sample behind its end."""
        place, period = self.place, self.period
        if place.run_in and place.last + period >= place.fast + self.lead + self.width:
            self._begin()
        if place.run_in or not place.last + period >= place.start + self.width:
            return []
        return [self._close()]

    def stored(self) -> dict[str, Floats]:
        """Return the samples of the open window, as they came."""
        width = self.values[0].shape[1] if self.values else 0
        gaps = np.concatenate([np.zeros((0, width)), *self.values])
        # What is missing stands beside the values: an array of a state is finite.
        return {
            "sample_time": np.concatenate([np.zeros(0), *self.times]),
            "sample_values": np.nan_to_num(gaps, nan=0.0),
            "sample_missing": np.isnan(gaps).astype(np.float64),
        }

    def take_stored(
        self, place: DayPlace, pending: SampleCounts, arrays: Mapping[str, Floats], source: str
    ) -> None:
        """Go on from where `stored` was called.

        Raises
        ------
        FormatError
            Samples are missing or of another shape; `source` is named.
        """
        time = needed(arrays, "sample_time", (None,), source)
        values = needed(arrays, "sample_values", (len(time), None), source)
        missing = needed(arrays, "sample_missing", values.shape, source)
        if len(time) and values.shape[1] <= max(self.needed):
            raise FormatError(f"{source}: is damaged: samples of {values.shape[1]} channels")
        self.place, self.pending = place, pending
        self.times = [time] if len(time) else []
        self.values = [np.where(missing > 0.0, np.nan, values)] if len(time) else []

    def _portion(self, time: Floats, values: Floats) -> list[CutWindow]:
        out: list[CutWindow] = []
        while len(time):
            before = np.maximum.accumulate(np.concatenate(([self.place.last], time)))[:-1]
            strays = np.flatnonzero(time <= before)
            end = int(strays[0]) if strays.size else len(time)
            out += self._in_order(time[:end], values[:end])
            if end < len(time):
                out += self._stray(float(time[end]), values[end : end + 1])
            time, values = time[end + 1 :], values[end + 1 :]
        return out

    def _in_order(self, time: Floats, values: Floats) -> list[CutWindow]:
        """Take samples later than all before them."""
        place = self.place
        out: list[CutWindow] = []
        while len(time):
            at, act = self._next(time, values)
            self._push(time[:at], values[:at])
            time, values = time[at:], values[at:]
            if act == "moves":
                self._drop(math.inf)
                place.fast, place.run_in = float(time[0]), True
            elif act == "begins":
                self._begin()
            elif act == "closes":
                out.append(self._close())
                out += self._gap(float(time[0]))
        return out

    def _next(self, time: Floats, values: Floats) -> tuple[int, str]:
        """How many samples the open window takes, and what happens at the one behind them."""
        place = self.place
        if place.run_in:
            at = int(np.searchsorted(time, place.fast + self.lead))
            return at, "begins" if at < len(time) else ""
        at = int(np.searchsorted(time, place.start + self.width))
        if math.isnan(place.fast):
            moving = self._moving(values[:at])
            moving &= np.isfinite(values[:at, self.needed]).all(axis=1)
            if moving.any():
                return int(np.argmax(moving)), "moves"
        return at, "closes" if at < len(time) else ""

    def _moving(self, values: Floats) -> Bools:
        """At which samples the unit moves."""
        return np.asarray(np.abs(values[:, self.speed]) > self.fast)

    def _push(self, time: Floats, values: Floats) -> None:
        if not len(time):
            return
        place = self.place
        place.last, place.back = float(time[-1]), math.nan
        place.first += tuple(time[: max(_FIRST - len(place.first), 0)].tolist())
        self._store(time, values)

    def _store(self, time: Floats, values: Floats) -> None:
        self.times.append(time)
        self.values.append(values)
        if len(self.times) % 256 == 0 and sum(map(len, self.times)) > _MOST:
            raise InputError(
                f"stream: more than {_MOST} samples in a window of {self.width:g} s, the limit"
            )

    def _stray(self, time: float, values: Floats) -> list[CutWindow]:
        """Take a sample that is not later than all before it."""
        place = self.place
        if time < (place.fast if place.run_in else place.start):
            return self._late(time)
        if any((stored == time).any() for stored in self.times):
            self.pending += SampleCounts(doubled=1)
        else:
            self.pending += SampleCounts(out_of_order=1)
            self._store(np.array([time]), values)
        return []

    def _late(self, time: float) -> list[CutWindow]:
        """Leave a sample out; say so by a stretch for each width of such samples in a row."""
        place = self.place
        self.pending += SampleCounts(late=1)
        first = place.back = min(time, time if math.isnan(place.back) else place.back)
        if time - first < self.width:
            return []
        place.back = time
        return [self._stretch(first, time, np.zeros(0), np.zeros((0, 0)), "late")]

    def _begin(self) -> None:
        """Begin the first window of the motion."""
        place = self.place
        half = 0.0 if math.isnan(self.period) else 0.5 * self.period
        place.start = place.fast + self.lead - min(half, self.lead)
        place.run_in = False
        self._drop(place.start)

    def _close(self) -> CutWindow:
        """Close the open window."""
        place = self.place
        time, values = self._ordered()
        self.times, self.values = [], []
        end = place.start + self.width
        empty = int((~np.isfinite(values[:, self.needed]).all(axis=1)).sum()) if len(time) else 0
        self._see(time)
        self._see_until(end)
        self.pending += SampleCounts(taken=len(time), empty=empty)
        why = "rest" if math.isnan(place.fast) else "window"
        out = self._stretch(place.start, end, time, values, why)
        place.start = end
        return out

    def _gap(self, time: float) -> list[CutWindow]:
        """Pass over whole windows without a sample, up to the next one at `time`."""
        place = self.place
        count = math.floor((time - place.start) / self.width)
        if count < 1:
            return []
        end = place.start + count * self.width
        if not (end <= time and end > place.start):  # rounding; steps below that of a float
            return []
        self._see_until(end)
        out = self._stretch(place.start, end, np.zeros(0), np.zeros((0, 0)), "gap")
        place.start = end
        return [out]

    def _drop(self, until: float) -> None:
        """Drop stored samples before an instant, which belong to no window."""
        time, values = self._ordered()
        keep = time >= until
        self._see(time[~keep])
        self.times, self.values = ([time[keep]], [values[keep]]) if keep.any() else ([], [])

    def _ordered(self) -> tuple[Floats, Floats]:
        if not self.times:
            return np.zeros(0), np.zeros((0, 0))
        time, values = np.concatenate(self.times), np.concatenate(self.values)
        order = np.argsort(time, kind="stable")
        return time[order], values[order]

    def _see(self, time: Floats) -> None:
        """Count what is missing up to and between samples."""
        if not len(time):
            return
        seen = self.place.seen
        steps = np.diff(time if math.isnan(seen) else np.concatenate(([seen], time))) / self.period
        missing = int((np.rint(np.minimum(steps[steps > _GAP], _MANY)) - 1).sum())
        self.pending += SampleCounts(missing=missing)
        self.place.seen = float(time[-1])

    def _see_until(self, end: float) -> None:
        """Count what is missing before a window's end."""
        steps = (end - self.place.seen) / self.period
        if steps > _GAP:
            missing = round(min(steps, _MANY)) - 1
            self.pending += SampleCounts(missing=missing)
            self.place.seen += missing * self.period

    def _stretch(
        self, start: float, end: float, time: Floats, values: Floats, why: str
    ) -> CutWindow:
        counts, self.pending = self.pending, SampleCounts()
        return CutWindow(start, end, time, values, counts, why)
