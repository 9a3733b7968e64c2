"""Where one log begins on the other's clock, from what both saw, when no trigger tells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.bench.clock_fit import SharedLogs
from elevon.errors import InputError

__all__ = ["LEAST_R2", "Guess", "search_offset"]

FloatArray = npt.NDArray[np.float64]

LEAST_R2 = 0.5
"""Share of the load cell's variance that the drive's signals must explain: what they leave is no
noise but something else that happened, and may pass for a shift in time when it is the most."""

_RIVAL = 1.5  # an offset that leaves less than this times the best one's variance is a rival
_CLEARLY = 5.0  # the same for one that has the load cell begin before the trace: it overlaps less,
# and less is explained more easily
_LEAST_OVERLAP = 0.5  # of the shorter log
_STEP = 1.5  # periods of the slower log: half the filter's width


@dataclass(frozen=True, slots=True)
class Guess:
    """A first guess.

    Attributes
    ----------
    logs : SharedLogs
        Of those given, the signals that explain most.
    offset : float
        Seconds.
    set_aside : float or None
        An offset that explains as much, but has the second log begin before the first.
    """

    logs: SharedLogs
    offset: float
    set_aside: float | None = None


def search_offset(choices: Sequence[SharedLogs]) -> Guess | None:
    """Find the offset that explains most, on a grid as fine as the filter makes sense of.

    The load cell's file begins at the trigger, which falls into the drive's trace: an offset that
    has it begin earlier is taken only where it explains clearly more.

    Parameters
    ----------
    choices : sequence of SharedLogs
        One second log, and the sets of signals that may explain it.

    Returns
    -------
    Guess or None
        None where the logs cannot overlap by half of the shorter one.

    Raises
    ------
    InputError
        A motion that repeats, or sets that disagree: another offset explains as much.
    """
    logs = choices[0]
    span = float(np.ptp(logs.time)), float(np.ptp(logs.second))
    least = _LEAST_OVERLAP * min(span)
    early, late = float(logs.time[0] - logs.second[-1]), float(logs.time[-1] - logs.second[0])
    offsets = np.arange(early + least, late - least, _STEP * logs.period)
    if not offsets.size:
        return None
    table = np.array([[c.explained(offset) for offset in offsets.tolist()] for c in choices])
    scores = table.max(axis=0)
    within = np.flatnonzero(offsets >= logs.time[0] - logs.second[0])
    best = int(np.argmax(scores))
    aside = None
    first = _highest(scores, within) if within.size else best
    if within.size and 1.0 - scores[first] <= _CLEARLY * (1.0 - scores[best]):
        best = first
        others = _rivals(scores, best)
        inner, outer = (np.intersect1d(others, within), np.setdiff1d(others, within))
        aside = float(offsets[_highest(scores, outer)]) if outer.size else None
    else:
        inner = _rivals(scores, best)
    if inner.size:
        other = _highest(scores, inner)
        same = np.argmax(table[:, other]) == np.argmax(table[:, best])
        why = "the motion repeats" if same else "two sets of signals disagree"
        raise InputError(
            f"synchronisation: the trigger never changes, and {why}: offsets of "
            f"{offsets[best]:.3f} s and {offsets[other]:.3f} s explain the load cell as well"
        )
    return Guess(choices[int(np.argmax(table[:, best]))], float(offsets[best]), aside)


def _rivals(scores: FloatArray, best: int) -> npt.NDArray[np.intp]:
    """Return the peaks, neighbours left out, that explain as much; none where nothing does."""
    if scores[best] < LEAST_R2:
        return np.empty(0, dtype=np.intp)
    peak = (scores[1:-1] >= scores[:-2]) & (scores[1:-1] >= scores[2:])
    peaks = np.flatnonzero(peak) + 1
    near = 1.0 - scores[peaks] < _RIVAL * (1.0 - scores[best])
    return np.asarray(peaks[near & (np.abs(peaks - best) > 1)], dtype=np.intp)


def _highest(scores: FloatArray, places: npt.NDArray[np.intp]) -> int:
    return int(places[int(np.argmax(scores[places]))])
