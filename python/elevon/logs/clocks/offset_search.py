"""Where one log begins on the other's clock, from what both saw, when no trigger tells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.logs.clocks.clock_fit import SharedLogs

LEAST_R2 = 0.5
"""Share of the load cell's variance that the drive's signals must explain: what they leave is no
noise but something else that happened, and may pass for a shift in time when it is the most."""

_RIVAL = 1.5  # an offset that leaves less than this times the best one's variance is a rival,
_LEAST_MORE = 0.01  # one that leaves less than this share of all variance more than the best one:
# what the signals lack (cogging, a wobbling brake) may be as much, and repeats with the motion,
_ODDS = 1e4  # and one to which chance alone gives the larger variance once in less than this many
# times: a hundred peaks or so are compared
_CLEARLY = 5.0  # the same for one that has the load cell begin before the trace: it overlaps less,
# and less is explained more easily
_FLOOR = 1e-300
_LEAST_OVERLAP = 0.5  # of the shorter log
_STEP = 1.5  # periods of the slower log: half the filter's width


@dataclass(frozen=True, slots=True)
class OffsetGuess:
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


def search_offset(choices: Sequence[SharedLogs]) -> OffsetGuess | None:
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
        Another offset cannot be distinguished from the best one: the motion repeats, sets of
        signals disagree, or the logs are too short.
    """
    logs = choices[0]
    span = float(np.ptp(logs.time)), float(np.ptp(logs.second))
    least = _LEAST_OVERLAP * min(span)
    early, late = float(logs.time[0] - logs.second[-1]), float(logs.time[-1] - logs.second[0])
    offsets = np.arange(early + least, late - least, _STEP * logs.period)
    if not offsets.size:
        return None
    table = np.array([[c.explained(offset) for offset in offsets.tolist()] for c in choices])
    search = _Search(choices, offsets, table)
    scores = table.max(axis=0)
    within = np.flatnonzero(offsets >= logs.time[0] - logs.second[0])
    best = int(np.argmax(scores))
    aside = None
    first = _highest(scores, within) if within.size else best
    if within.size and 1.0 - scores[first] <= _CLEARLY * (1.0 - scores[best]):
        best = first
        others = search.rivals(best)
        inner, outer = np.intersect1d(others, within), np.setdiff1d(others, within)
        aside = float(offsets[_highest(scores, outer)]) if outer.size else None
    else:
        inner = search.rivals(best)
    if inner.size:
        other = _highest(scores, inner)
        raise InputError(
            f"synchronisation: the trigger never changes, and {search.ambiguity(best, other)}"
        )
    return OffsetGuess(search.logs(best), float(offsets[best]), aside)


@dataclass(frozen=True)
class _Search:
    """Every offset tried: `table` holds what each set of signals explains at each."""

    choices: Sequence[SharedLogs]
    offsets: Floats
    table: Floats

    def logs(self, place: int) -> SharedLogs:
        """Return the signals that explain most at an offset."""
        return self.choices[int(np.argmax(self.table[:, place]))]

    def rivals(self, best: int) -> npt.NDArray[np.intp]:
        """Return the peaks, neighbours left out, that cannot be distinguished from the best.

        None where nothing explains enough to be taken anyway.
        """
        scores = self.table.max(axis=0)
        if scores[best] < LEAST_R2:
            return np.empty(0, dtype=np.intp)
        peak = (scores[1:-1] >= scores[:-2]) & (scores[1:-1] >= scores[2:])
        peaks = np.flatnonzero(peak) + 1
        near = [k for k in peaks.tolist() if abs(k - best) > 1 and self._alike(best, k)]
        return np.asarray(near, dtype=np.intp)

    def ambiguity(self, best: int, other: int) -> str:
        """Say how near a rival comes, and why."""
        left, most, worth, unknowns = self._against(best, other)
        same = self.logs(best) is self.logs(other)
        why = "the motion repeats" if same else "two sets of signals disagree"
        return (
            f"{why}: offsets of {self.offsets[best]:.3f} s and {self.offsets[other]:.3f} s cannot "
            f"be distinguished (where both overlap, {100 * left:.2g} % and {100 * most:.2g} % of "
            f"the load cell stay unexplained, over what is worth {worth:.2g} independent samples "
            f"for {unknowns} unknowns)"
        )

    def _alike(self, best: int, other: int) -> bool:
        left, most, worth, unknowns = self._against(best, other)
        if most < _RIVAL * left or most < left + _LEAST_MORE:
            return True
        evidence = 0.5 * max(worth - unknowns, 0.0) * math.log(most / max(left, _FLOOR))
        return evidence < math.log(_ODDS)

    def _against(self, best: int, other: int) -> tuple[float, float, float, int]:
        """Compare two offsets over the samples that both of them place inside the first log.

        Over all of its own samples the offset that overlaps less would look better than it is.

        Returns
        -------
        left, most : float
            Shares of the variance that the best one and the other leave unexplained.
        worth : float
            Independent samples that what the best one leaves is worth.
        unknowns : int
            That were fitted to them: weights and the offset itself.
        """
        one, two = (self.logs(place) for place in (best, other))
        start, end = (float(self.offsets[place]) for place in (best, other))
        both = one.inside(start) & two.inside(end)
        if not both.any():
            return 1.0, 1.0, 0.0, 0
        value = one.value[both] - one.value[both].mean()
        power = max(float(value @ value), _FLOOR)
        (misfit, rank), (more, _) = one.misfit(start, both), two.misfit(end, both)
        shares = float(misfit @ misfit) / power, float(more @ more) / power
        return *shares, one.independent(misfit), rank + 1


def _highest(scores: Floats, places: npt.NDArray[np.intp]) -> int:
    return int(places[int(np.argmax(scores[places]))])
