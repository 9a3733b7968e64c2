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
from elevon.logs.clocks.offset_search import LEAST_R2, OffsetGuess, search_offset

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
