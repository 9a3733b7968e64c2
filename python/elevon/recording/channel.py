"""One recorded quantity."""

from __future__ import annotations

import keyword
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError, UnitError, unknown
from elevon.units import check_kind, parse_unit, si_unit, to_display, to_si

LONGEST_NAME = 31
"""MATLAB's limit for the fields of a version 5 file."""

_FORM = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_MATLAB = (
    "break case catch classdef continue else elseif end for function global if otherwise "
    "parfor persistent return spmd switch try while"
)
_RESERVED = frozenset({"time", "clock", "units", "elevon"})


def check_name(name: str, what: str = "channel") -> str:
    """Check the name of a channel or a clock.

    Parameters
    ----------
    name : str
        The name.
    what : str
        What it names; used in the error.

    Returns
    -------
    str
        The same name.

    Raises
    ------
    InputError
        Not an ASCII identifier of at most 31 characters starting with a letter, or a word that
        Python, MATLAB or the file formats reserve.
    """
    if not _FORM.fullmatch(str(name)):
        raise InputError(
            f"{what} {name!r}: a name is a letter followed by letters, digits and underscores"
        )
    if len(name) > LONGEST_NAME:
        raise InputError(
            f"{what} {name!r}: {len(name)} characters; the limit is {LONGEST_NAME} (MATLAB)"
        )
    if keyword.iskeyword(name) or name in _MATLAB.split() or name in _RESERVED:
        raise InputError(f"{what} {name!r}: the word is reserved")
    return name


_FLOAT = np.dtype(np.float64)


@dataclass(frozen=True, eq=False)
class Clock:
    """A time base: its instants, its nominal rate, and where samples are missing.

    Parameters
    ----------
    name : str
        ASCII identifier of at most 31 characters.
    time : array_like, shape (n,)
        Instants in s, finite and strictly increasing; they may be irregular.
    rate : float, optional
        Nominal rate in Hz; None for a clock without one.
    gaps : sequence of int, optional
        Indices k such that samples are missing between ``time[k]`` and ``time[k + 1]``. When absent
        and the rate is known: the intervals longer than one and a half nominal periods.

    Raises
    ------
    InputError
        Time not finite, not increasing (the index is named), not one-dimensional; rate not
        positive; gap index out of range.
    """

    name: str
    time: Floats
    rate: float | None = None
    gaps: tuple[int, ...] = None  # type: ignore[assignment]  # never None once constructed

    def __init__(
        self,
        name: str,
        time: npt.ArrayLike,
        rate: float | None = None,
        gaps: Sequence[int] | None = None,
    ) -> None:
        check_name(name, "clock")
        instants = frozen(time, f"clock {name!r}: time")
        _check_time(name, instants)
        if rate is not None:
            rate = float(rate)
            if not (math.isfinite(rate) and rate > 0):
                raise InputError(f"clock {name!r}: the rate {rate} Hz is not a positive number")
        missing = _find_gaps(instants, rate) if gaps is None else _check_gaps(name, instants, gaps)
        for key, value in (("name", name), ("time", instants), ("rate", rate), ("gaps", missing)):
            object.__setattr__(self, key, value)

    def __len__(self) -> int:
        return int(self.time.size)

    def __repr__(self) -> str:
        rate = "irregular" if self.rate is None else f"{self.rate:g} Hz"
        span = f", {self.time[0]:g}..{self.time[-1]:g} s" if len(self) else ""
        gaps = f", {len(self.gaps)} gaps" if self.gaps else ""
        return f"Clock({self.name!r}, {rate}, {len(self)} samples{span}{gaps})"

    @property
    def gap_intervals(self) -> list[tuple[float, float]]:
        """Last instant before and first instant after each gap, in s."""
        return [(float(self.time[k]), float(self.time[k + 1])) for k in self.gaps]

    @property
    def instants(self) -> Channel:
        """Its time as a channel, ``time`` in s."""
        channel = object.__new__(Channel)
        channel.__dict__.update(name="time", unit="s", values=self.time, clock=self, text="time")
        return channel

    def equals(self, other: Clock) -> bool:
        """Return whether two clocks are the same, to the last bit of time."""
        same = (self.name, self.rate, self.gaps) == (other.name, other.rate, other.gaps)
        return same and self.time.tobytes() == other.time.tobytes()


def frozen(values: object, place: str) -> Floats:
    """Return values as a read-only float64 vector, without copying one that already is.

    Raises
    ------
    InputError
        No numbers, more than one dimension, or a mask that hides values.
    """
    if np.ma.is_masked(values):
        hidden = int(np.sum(np.ma.getmaskarray(np.ma.asarray(values))))
        raise InputError(f"{place}: a mask hides {hidden} values; NaN says that one is missing")
    if type(values) is np.ndarray and values.dtype is _FLOAT and values.ndim == 1:
        vector = values.view() if values.flags.writeable else values
        vector.flags.writeable = False
        return vector
    try:
        array = np.asarray(values)
        if array.dtype.kind not in "fiub":
            raise InputError(f"{place}: {array.dtype} are not numbers")
        vector = array.astype(np.float64, copy=False).view()
    except (TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{place}: not an array of numbers") from error
    if vector.ndim != 1:
        raise InputError(f"{place}: has shape {vector.shape}, expected one dimension")
    vector.flags.writeable = False
    return vector


def _check_time(name: str, time: Floats) -> None:
    if not np.isfinite(time).all():
        index = int(np.flatnonzero(~np.isfinite(time))[0])
        raise InputError(f"clock {name!r}: time[{index}] = {time[index]} is not finite")
    steps = np.diff(time)
    if (steps <= 0).any():
        index = int(np.flatnonzero(steps <= 0)[0])
        raise InputError(
            f"clock {name!r}: time does not increase: "
            f"time[{index}] = {time[index]}, time[{index + 1}] = {time[index + 1]} s"
        )


def _find_gaps(time: Floats, rate: float | None) -> tuple[int, ...]:
    if rate is None:
        return ()
    return tuple(np.flatnonzero(np.diff(time) > 1.5 / rate).tolist())


def _check_gaps(name: str, time: Floats, gaps: Sequence[int]) -> tuple[int, ...]:
    indices = tuple(sorted({int(gap) for gap in gaps}))
    if indices and not 0 <= indices[0] <= indices[-1] < time.size - 1:
        raise InputError(f"clock {name!r}: gap indices {indices} outside 0..{time.size - 2}")
    return indices


_LONGEST_TEXT = 1000


@dataclass(frozen=True, eq=False)
class Channel:
    """A named quantity sampled on a clock, in SI units.

    Parameters
    ----------
    name : str
        ASCII identifier of at most 31 characters.
    unit : str
        SI unit (``"rad"``, ``"N m"``, ``"1"``). `Recording.build` converts other units.
    values : array_like, shape (n,)
        One value for each instant of the clock; NaN marks a missing sample.
    clock : Clock
        The time base.
    text : str
        What the quantity is, for labels and documentation; printable, at most 1000 characters.

    Raises
    ------
    InputError
        Bad name or text, not one value an instant, values that are not numbers.
    UnitError
        Unknown unit, or one that is not of the SI.
    """

    name: str
    unit: str
    values: Floats
    clock: Clock
    text: str = ""

    def __init__(
        self, name: str, unit: str, values: npt.ArrayLike, clock: Clock, text: str = ""
    ) -> None:
        _check_description(name, unit, text)
        vector = frozen(values, f"channel {name!r}")
        if vector.size != len(clock):
            raise InputError(
                f"channel {name!r}: {vector.size} values for the {len(clock)} instants "
                f"of clock {clock.name!r}"
            )
        fields = self.__dict__
        fields["name"], fields["unit"], fields["text"] = name, unit, text
        fields["values"], fields["clock"] = vector, clock

    @property
    def time(self) -> Floats:
        """Instants of the samples in s, shape (n,), read-only."""
        return self.clock.time

    def __len__(self) -> int:
        return int(self.values.size)

    def __repr__(self) -> str:
        return f"Channel({self.name!r}, {self.unit!r}, {len(self)} samples on {self.clock.name!r})"

    def to(self, unit: str) -> Floats:
        """Return the values in another unit of the same kind, shape (n,).

        Raises
        ------
        UnitError
            Unknown unit, or one of another kind.
        """
        check_kind(unit, self.unit, f"channel {self.name!r}")
        return to_display(self.values, unit)

    def equals(self, other: Channel) -> bool:
        """Return whether two channels are the same, to the last bit of every value."""
        same = (self.name, self.unit, self.text) == (other.name, other.unit, other.text)
        return (
            same
            and self.clock.equals(other.clock)
            and self.values.tobytes() == other.values.tobytes()
        )


@lru_cache(maxsize=4096)
def _check_description(name: str, unit: str, text: str) -> None:
    """Raise where a name, a unit or a text cannot be; the runs of a batch have the same ones."""
    check_name(name)
    parsed = parse_unit(unit, f"channel {name!r}")
    if parsed.factor != 1.0 or parsed.offset:
        raise UnitError(f"channel {name!r}: unit {unit!r} is not SI; Recording.build converts")
    if len(text) > _LONGEST_TEXT or not text.isprintable():
        raise InputError(
            f"channel {name!r}: its text has control characters or more than {_LONGEST_TEXT}"
        )


def in_si(name: str, unit: str, values: npt.ArrayLike, clock: Clock) -> Channel:
    """Make a channel of values in any unit; those already SI keep every bit and their unit."""
    parsed = parse_unit(unit, f"channel {name!r}")
    if parsed.factor == 1.0 and not parsed.offset:
        return Channel(name, unit or "1", values, clock)
    return Channel(name, si_unit(unit), to_si(values, unit), clock)


class ChannelSet:
    """Channels by name, each on one of the clocks.

    Parameters
    ----------
    channels : iterable of Channel
        Channels; two of them on one clock must hold the same `Clock`.
    clocks : iterable of Clock
        Clocks that carry no channel.

    Raises
    ------
    InputError
        A name given twice (names differing only by case count as one), two clocks of one name.
    """

    def __init__(self, channels: Iterable[Channel], clocks: Iterable[Clock]) -> None:
        self._channels: dict[str, Channel] = {}
        self.clocks: dict[str, Clock] = {}
        for clock in clocks:
            self._add_clock(clock)
        seen: dict[str, str] = {}
        for channel in channels:
            other = seen.setdefault(channel.name.lower(), channel.name)
            if channel.name in self._channels or other != channel.name:
                raise InputError(f"channel {channel.name!r}: the name is given twice")
            self._add_clock(channel.clock)
            self._channels[channel.name] = channel

    def _add_clock(self, clock: Clock) -> None:
        if self.clocks.setdefault(clock.name, clock) is not clock:
            raise InputError(f"clock {clock.name!r}: two different clocks have this name")

    @property
    def names(self) -> list[str]:
        """Names of the channels, in recorded order."""
        return list(self._channels)

    @property
    def channels(self) -> list[Channel]:
        """The channels, in recorded order."""
        return list(self._channels.values())

    @property
    def time(self) -> Floats:
        """Instants of the only clock [s], shape (n,); `InputError` where there are several."""
        return self.clock().time

    def __getitem__(self, name: str) -> Channel:
        if name == "time":
            return self.clock().instants
        try:
            return self._channels[name]
        except KeyError:
            raise unknown("channel", str(name), self._channels, "recording") from None

    def __contains__(self, name: object) -> bool:
        return name in self._channels

    def __iter__(self) -> Iterator[str]:
        return iter(self._channels)

    def __len__(self) -> int:
        return len(self._channels)

    def _ipython_key_completions_(self) -> list[str]:
        return self.names

    def clock(self, name: str | None = None) -> Clock:
        """Return a clock by name, or the only one.

        Raises
        ------
        InputError
            No such clock, or no name and several clocks.
        """
        if name is None and len(self.clocks) == 1:
            return next(iter(self.clocks.values()))
        if name is None:
            raise InputError(
                f"the recording has {len(self.clocks)} clocks; name one of "
                f"{', '.join(map(repr, self.clocks)) or 'none'}"
            )
        if name not in self.clocks:
            raise unknown("clock", name, self.clocks, "recording")
        return self.clocks[name]

    def on_clock(self, name: str | None = None) -> list[Channel]:
        """Return the channels of one clock, in recorded order; errors as `clock`."""
        clock = self.clock(name)
        return [channel for channel in self._channels.values() if channel.clock is clock]
