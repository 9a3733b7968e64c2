"""Two clocks brought together: the drive's trace and the load cell.

The trigger edge in the drive's trace marks the load cell's zero. Where there is no edge the two are
aligned by what they both saw. Either way the load cell's clock runs at its own speed, so a drift is
estimated too, with the uncertainty of both:

    time on the drive's clock = offset + (1 + drift) * time on the load cell's clock

A drift that the logs do not determine is not applied: its deviation is then what a resonator may be
off.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.logs.clocks.clock_fit import ClockEstimate, SharedLogs, fit_clock

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


_MOST_DRIFT = 0.02  # an RC oscillator's worst: a fit beyond it is none of two clocks
_SMOOTHING = 3.0  # periods of the slower log
_ENDS = 2.0  # of the filter's width: what it makes of a log's ends is not used
_FEWEST = 20  # samples of each
_CONSTANT = 1e-12  # of a signal's size: rounding, no motion


@dataclass(frozen=True, slots=True)
class TriggerEdge:
    """The first change of the trigger.

    Attributes
    ----------
    time : float
        Best estimate [s]: the middle of the sampling interval in which it happened.
    std : float
        Standard deviation [s]: uniform in that interval.
    later : int
        Changes after the first (bounces, or the trigger's end).
    """

    time: float
    std: float
    later: int


@dataclass(frozen=True, slots=True)
class ClockFit:
    """Relation of a second clock to the first.

    Attributes
    ----------
    offset, offset_std : float
        Seconds: where the second clock's zero lies on the first.
    drift, drift_std : float
        Relative: 1e-3 is a second clock that loses 1 ms a second. Where the logs hardly determine
        it, the drift is 0 with the deviation of a resonator; where they share nothing, with an
        infinite one.
    method : str
        ``trigger``, ``correlation`` or ``trigger and correlation``.
    explained : float
        Share of the second log's variance explained by the first's signals; NaN for the trigger
        alone.
    residual, residual_std : float
        Seconds: by how much the first log's signals are late against the second's value beside the
        clocks' offset (filters, a converter that settles). Without a trigger it cannot be
        determined from the offset, whose deviation then holds it; NaN for the trigger alone.
    set_aside : float or None
        Without a trigger, an offset [s] that explains as much but has the second log begin before
        the first.
    refused : tuple of (float, float) or None
        Drift and deviation that the logs hint at without determining it: not applied.
    """

    offset: float
    offset_std: float
    drift: float
    drift_std: float
    method: str
    explained: float
    residual: float = math.nan
    residual_std: float = math.nan
    set_aside: float | None = None
    refused: tuple[float, float] | None = None

    def to_first(self, time: npt.ArrayLike) -> Floats:
        """Return times of the second clock on the first one."""
        second = np.asarray(time, dtype=np.float64)
        return np.asarray(self.offset + (1.0 + self.drift) * second, dtype=np.float64)


def find_trigger(time: npt.ArrayLike, trigger: npt.ArrayLike) -> TriggerEdge | None:
    """Find the first change of a trigger channel, whichever its levels and polarity.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds.
    trigger : array_like, shape (n,)
        The digital inputs' word; NaN where missing.

    Returns
    -------
    TriggerEdge or None
        None when the trigger never changes.
    """
    t, level = (np.asarray(a, dtype=np.float64) for a in (time, trigger))
    good = np.isfinite(level)
    t, level = t[good], level[good]
    changes = np.flatnonzero(np.diff(level) != 0.0)
    if not changes.size:
        return None
    before, after = float(t[changes[0]]), float(t[changes[0] + 1])
    std = (after - before) / math.sqrt(12.0)
    return TriggerEdge(0.5 * (before + after), std, int(changes.size) - 1)


def align_clocks(
    time: npt.ArrayLike,
    signals: npt.ArrayLike,
    second_time: npt.ArrayLike,
    value: npt.ArrayLike,
    *,
    edge: TriggerEdge | None = None,
    alternatives: Sequence[npt.ArrayLike] = (),
) -> ClockFit:
    """Relate the load cell's clock to the drive's.

    Parameters
    ----------
    time : array_like, shape (n,)
        Drive's clock [s].
    signals : array_like, shape (n,) or (n, m)
        What the drive recorded of the same thing (torque current, speed, ...): the load cell's
        value is taken as a linear combination of these and a constant.
    second_time : array_like, shape (k,)
        Load cell's clock [s].
    value : array_like, shape (k,)
        Load cell's value.
    edge : TriggerEdge, optional
        From `find_trigger`: holds the offset to within its uncertainty.
    alternatives : sequence of array_like
        Other sets of signals; of all sets the one that explains most is used.

    Returns
    -------
    ClockFit
        The drift is undetermined (infinite standard deviation) where the two logs share no motion.

    Raises
    ------
    InputError
        Too few samples, or neither an edge nor anything the two logs share.
    """
    choices = _choices(time, (signals, *alternatives), second_time, value)
    guess = _guess(choices, edge)
    known = None if edge is None else (edge.time, edge.std)
    fit = None if guess is None else fit_clock(guess.logs, guess.offset, known)
    if guess is None or fit is None or fit.explained < LEAST_R2 or abs(fit.drift[0]) > _MOST_DRIFT:
        if edge is not None:
            return ClockFit(edge.time, edge.std, 0.0, math.inf, "trigger", math.nan)
        raise InputError(f"synchronisation: the trigger never changes, and {_why_not(guess, fit)}")
    return ClockFit(
        *fit.offset,
        *fit.drift,
        "correlation" if edge is None else "trigger and correlation",
        fit.explained,
        *fit.residual,
        guess.set_aside,
        fit.refused,
    )


def _why_not(guess: OffsetGuess | None, fit: ClockEstimate | None) -> str:
    """Say why there is no offset to be had from what both logs saw."""
    seen = 0.0
    if fit is not None:
        seen = fit.explained
    elif guess is not None:
        seen = guess.logs.explained(guess.offset)
    if seen < LEAST_R2:
        return (
            f"the drive's signals explain only {100 * seen:.0f} % of the load cell's variance "
            f"({100 * LEAST_R2:.0f} % needed)"
        )
    if fit is None:
        return "the two logs share too short a motion to tell an offset from chance"
    return (
        f"what both saw gives a clock drift of {fit.drift[0]:.3g}, more than any two clocks have "
        f"(limit {_MOST_DRIFT:g})"
    )


def _choices(
    time: npt.ArrayLike,
    sets: Sequence[npt.ArrayLike],
    second_time: npt.ArrayLike,
    value: npt.ArrayLike,
) -> list[SharedLogs]:
    """Return the sets that move, the second log with each; a set of missing values is none."""
    choices, failures = [], []
    for columns in sets:
        try:
            logs = _shared(*_arrays(time, columns, second_time, value))
        except InputError as error:
            failures.append(error)
            continue
        if np.std(logs.value) > 0.0 and np.any(logs.signals != 0.0):
            choices.append(logs)
    if len(failures) == len(sets):
        raise failures[0]
    return choices


def _guess(choices: Sequence[SharedLogs], edge: TriggerEdge | None) -> OffsetGuess | None:
    if not choices:
        return None
    if edge is None:
        return search_offset(choices)
    return OffsetGuess(max(choices, key=lambda logs: logs.explained(edge.time)), edge.time)


def _arrays(
    time: npt.ArrayLike, signals: npt.ArrayLike, second_time: npt.ArrayLike, value: npt.ArrayLike
) -> tuple[Floats, Floats, Floats, Floats]:
    t, s, y = (np.asarray(a, dtype=np.float64) for a in (time, second_time, value))
    x = np.asarray(signals, dtype=np.float64)
    x = x[:, None] if x.ndim == 1 else x
    if len(t) != len(x) or len(s) != len(y):
        raise InputError(
            f"synchronisation: {len(t)} instants for {len(x)} signal samples, "
            f"{len(s)} for {len(y)} values"
        )
    good, fine = np.isfinite(x).all(axis=1), np.isfinite(y)
    t, x, s, y = t[good], x[good], s[fine], y[fine]
    if min(len(t), len(s)) < _FEWEST:
        raise InputError(
            f"synchronisation: {len(t)} and {len(s)} samples; {_FEWEST} of each are needed"
        )
    for name, clock in (("drive", t), ("load cell", s)):
        if np.any(np.diff(clock) <= 0.0):
            at = float(clock[int(np.argmax(np.diff(clock) <= 0.0))])
            raise InputError(f"synchronisation: the {name}'s time does not increase at {at:g} s")
    spread = np.std(x, axis=0)
    moves = spread > _CONSTANT * np.abs(x).max(axis=0)
    return t, np.where(moves, (x - x.mean(axis=0)) / np.where(moves, spread, 1.0), 0.0), s, y


def _shared(t: Floats, x: Floats, s: Floats, y: Floats) -> SharedLogs:
    """Pass both logs through one Gaussian filter of a few of the slower one's periods.

    Interpolated noise would make the misfit jagged in the offset; one filter on both sides leaves
    their linear relation as it is.
    """
    from scipy.ndimage import gaussian_filter1d

    steps = float(np.median(np.diff(t))), float(np.median(np.diff(s)))
    period = max(steps)
    width = _SMOOTHING * period
    smooth_x = gaussian_filter1d(x, width / steps[0], axis=0, mode="nearest")
    smooth_y = gaussian_filter1d(y, width / steps[1], mode="nearest")
    first, second = (
        (clock >= clock[0] + _ENDS * width) & (clock <= clock[-1] - _ENDS * width)
        for clock in (t, s)
    )
    if min(int(first.sum()), int(second.sum())) < _FEWEST:
        raise InputError(
            f"synchronisation: {np.ptp(t):.3g} and {np.ptp(s):.3g} s of log are too short: "
            f"{_FEWEST} samples of each must lie {_ENDS * width:.3g} s from its ends"
        )
    return SharedLogs(t[first], smooth_x[first], s[second], smooth_y[second], period, width)
