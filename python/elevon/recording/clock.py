"""The time base of a group of channels."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.recording.names import check_name

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

    def equals(self, other: "Clock") -> bool:
        """Return whether two clocks are the same, to the last bit of time."""
        same = (self.name, self.rate, self.gaps) == (other.name, other.rate, other.gaps)
        return same and self.time.tobytes() == other.time.tobytes()


def frozen(values: object, place: str) -> Floats:
    """Return values as a read-only float64 vector, without copying one that already is."""
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
