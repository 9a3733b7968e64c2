"""A command between its samples: corners where two smooth pieces meet, steps at their edge.

Straight lines between samples cut a corner by up to an eighth of its change of slope times the
sampling period, and a servo with a stiff loop makes current of it. A corner is where the pieces on
either side, each continued, intersect; the slope is continuous everywhere else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Bools, Floats
from elevon.logs.log import Log, per_log

#: s on either side of a corner or step: what residuals are reported with and without.
ABOUT = 0.02
_JUMP = 0.02  # of the command's range within one sample, ...
_ALONE = 5.0  # ... and so many times what changes beside it: a step, not a slope
_BETWEEN = 3  # points of the curve a sample
_COMMON = 0.9  # quantile of the misses of extrapolated pieces that smooth pieces leave
_CLEAR = 6.0  # times those a corner must miss by
_EXACT = 1e-9  # of the range: rounding
_ON_SAMPLE = 1e-6  # of a sampling period: a corner so near a sample is on it
_LONGEST = 32  # samples that a piece is continued by
_JUST_BEFORE = 1e-3  # of a sampling period: where a step still has its former value


@dataclass(frozen=True, slots=True)
class CommandBreak:
    """Where a command has a corner or a step.

    Attributes
    ----------
    time : float
        s.
    low, high : float
        Between which instants it lies [s].
    step : bool
        Whether the value jumps, and not the slope alone.
    """

    time: float
    low: float
    high: float
    step: bool


@dataclass(frozen=True, eq=False)
class CommandCurve:
    """A command at every instant.

    Attributes
    ----------
    time : ndarray, shape (m,)
        Instants [s], increasing; straight lines between them.
    values : ndarray, shape (m,)
        In the command's unit.
    breaks : tuple of CommandBreak
        Corners and steps, in the order of time.
    """

    time: Floats
    values: Floats
    breaks: tuple[CommandBreak, ...] = ()

    @property
    def points(self) -> tuple[Floats, Floats]:
        """Instants and values."""
        return self.time, self.values

    def at(self, time: Floats) -> Floats:
        """Return the values at some instants [s], shape (n,)."""
        return np.asarray(np.interp(time, self.time, self.values))

    def about_breaks(self, time: Floats) -> Bools:
        """Tell which instants lie within `ABOUT` of a corner or a step, shape (n,)."""
        near = np.zeros(len(time), dtype=np.bool_)
        for item in self.breaks:
            near |= (time >= item.low - ABOUT) & (time <= item.high + ABOUT)
        return near


@per_log
def command_curve(log: Log) -> CommandCurve:
    """Return the command of a log between its samples; missing ones are left out."""
    values = log["command"]
    there = np.isfinite(values)
    return rebuilt_curve(log.time[there], values[there])


def rebuilt_curve(time: Floats, values: Floats) -> CommandCurve:
    """Return a sampled command with its corners and steps, and smooth between them.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, increasing; regular or not.
    values : ndarray, shape (n,)
        Finite.

    Returns
    -------
    CommandCurve
        Through every sample. Less than eight samples, and a noise that hides corners, leave the
        samples with a continuous slope between them.
    """
    steps = _steps(time, values)
    points: list[tuple[Floats, Floats]] = []
    # An edge is taken where it is first seen, as in the log of the controller that made it.
    spans = [(float(time[k]), float(time[k + 1])) for k in steps]
    breaks = [CommandBreak(high, low, high, True) for low, high in spans]
    starts = np.concatenate(([0], steps + 1)).astype(int)
    ends = np.concatenate((steps + 1, [len(time)])).astype(int)
    reach = float(np.ptp(values))
    for first, last in zip(starts, ends, strict=True):
        t, v = time[first:last], values[first:last]
        corners = _corners(t, v, reach)
        breaks += [item for item, _ in corners]
        t, v = _smooth_between(t, v, corners, reach)
        if last < len(time):
            until = time[last] - _JUST_BEFORE * (time[last] - time[last - 1])
            t, v = np.append(t, until), np.append(v, v[-1])
        points.append((t, v))
    whole = [np.concatenate(parts) for parts in zip(*points, strict=True)]
    return CommandCurve(whole[0], whole[1], tuple(sorted(breaks, key=lambda item: item.time)))


def _steps(time: Floats, values: Floats) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Return the samples after which the value jumps."""
    size = np.abs(np.diff(values))
    if not len(size):
        return np.empty(0, dtype=np.intp)
    neighbour = np.maximum(np.append(size[1:], 0.0), np.insert(size[:-1], 0, 0.0))
    usual = np.diff(time) < 2.0 * np.median(np.diff(time))
    jump = usual & (size > _JUMP * float(np.ptp(values))) & (size > _ALONE * neighbour)
    return np.flatnonzero(jump)


def _corners(time: Floats, values: Floats, reach: float) -> list[tuple[CommandBreak, float]]:
    """Return the corners of a stretch without steps, each with the value there.

    A corner lies between two samples where the parabola through three samples misses the fourth
    on either side, and those beside it miss nothing.
    """
    count = len(time)
    if count < 8 or not reach > 0.0:
        return []
    left, right = _misses(time, values), _misses(-time[::-1], values[::-1])[::-1]
    # left[i], right[i]: from the samples up to i to the next, and from i + 1 on to the one before.
    least = np.minimum(left, right)
    limit = max(_CLEAR * float(np.quantile(least, _COMMON)), _EXACT * reach)
    clean = (np.roll(left, 1) <= limit) & (np.roll(right, -1) <= limit)
    places = np.flatnonzero(clean & (np.maximum(left, right) > limit))
    corners: list[tuple[CommandBreak, float]] = []
    for i in (int(k) for k in places if 3 <= k < count - 4):
        corner = _intersection(time, values, i, limit)
        if corner is not None and not (
            corners and corner[0].time - corners[-1][0].time < _near(time, i)
        ):
            corners.append(corner)
    return corners


def _near(time: Floats, i: int) -> float:
    """Return the distance below which two corners are one, seen from both sides of a sample."""
    return 0.5 * float(time[i + 1] - time[i])


def _misses(time: Floats, values: Floats) -> Floats:
    """Return by how much the parabola through three samples misses the next, shape (n - 1,)."""
    out = np.zeros(len(time) - 1)
    a, b, c, d = (time[k : len(time) - 3 + k] for k in range(4))
    p, q, r, s = (values[k : len(time) - 3 + k] for k in range(4))
    first, second = (q - p) / (b - a), (r - q) / (c - b)
    bend = (second - first) / (c - a)
    out[2:] = np.abs(r + (d - c) * (second + bend * (c - b)) + bend * (d - c) ** 2 - s)
    return out


def _intersection(
    time: Floats, values: Floats, i: int, limit: float
) -> tuple[CommandBreak, float] | None:
    """Return the corner between sample i and the next, where the two pieces intersect there."""
    begin, end = float(time[i]), float(time[i + 1])
    before = _piece(time[: i + 1][::-1] - begin, values[: i + 1][::-1], limit)
    after = _piece(time[i + 1 :] - begin, values[i + 1 :], limit)
    apart = np.polynomial.Polynomial(after) - np.polynomial.Polynomial(before)
    width = end - begin
    roots = [
        complex(root).real
        for root in apart.roots()
        if abs(complex(root).imag) < 1e-9 * width and abs(complex(root).real / width - 0.5) < 0.501
    ]
    if len(roots) != 1:
        return None
    at = min(max(roots[0], 0.0), width)
    slope = abs(float(apart.deriv()(at)))
    if not slope * width > limit:
        return None
    margin = min(limit / slope, width)
    resting = values[i - 1] == values[i], values[i + 1] == values[i + 2]
    value = float(np.polynomial.Polynomial(before)(at))
    if any(
        resting
    ):  # what rests does so to the last bit: a model tells a slope of rounding from none
        value = float(values[i] if resting[0] else values[i + 1])
    low, high = begin + max(at - margin, 0.0), begin + min(at + margin, width)
    place = begin + at
    if min(at, width - at) < _ON_SAMPLE * width:
        place = begin if at < 0.5 * width else end
    return CommandBreak(place, low, high, False), value


def _piece(time: Floats, values: Floats, limit: float) -> Floats:
    """Return a polynomial in time through the first samples: the longest straight or bent piece."""
    for degree in (1, 2):
        for count in (_LONGEST, 16, 8, 5):
            t, v = time[:count], values[:count]
            if len(t) < count:
                continue
            fit = np.polynomial.polynomial.polyfit(t, v, degree)
            if np.abs(np.polynomial.polynomial.polyval(t, fit) - v).max() <= limit:
                return np.asarray(fit)
    return np.asarray(np.polynomial.polynomial.polyfit(time[:3], values[:3], min(2, len(time) - 1)))


def _smooth_between(
    time: Floats, values: Floats, corners: Sequence[tuple[CommandBreak, float]], reach: float
) -> tuple[Floats, Floats]:
    """Return points of a stretch whose slope is continuous between its corners."""
    times, levels = [], []
    at = 0
    head: tuple[float, float] | None = None
    for item, value in [*corners, (None, 0.0)]:
        stop = len(time) if item is None else int(np.searchsorted(time, item.time))
        t, v = time[at:stop], values[at:stop]
        if head is not None and (not len(t) or head[0] < t[0]):
            t, v = np.append(head[0], t), np.append(head[1], v)
        if item is not None:
            t, v = np.append(t, item.time), np.append(v, value)
        t, v = _curved(t, v, reach)
        keep = len(t) if item is None else len(t) - 1  # the corner begins the next piece
        times.append(t[:keep])
        levels.append(v[:keep])
        at, head = stop, None if item is None else (item.time, value)
        if item is not None and stop < len(time) and time[stop] == item.time:
            at = stop + 1
    return np.concatenate(times), np.concatenate(levels)


def _curved(time: Floats, values: Floats, reach: float) -> tuple[Floats, Floats]:
    """Return points of a smooth piece: the samples, and what lies between on a continuous slope.

    A straight one is its ends.
    """
    if len(time) < 2:
        return time, values
    line = np.interp(time, time[[0, -1]], values[[0, -1]])
    if float(np.abs(values - line).max()) <= _EXACT * reach:
        return time[[0, -1]], values[[0, -1]]
    from scipy.interpolate import Akima1DInterpolator

    share = np.arange(_BETWEEN) / _BETWEEN
    fine = np.append((time[:-1, None] + np.diff(time)[:, None] * share).ravel(), time[-1])
    return fine, np.asarray(Akima1DInterpolator(time, values)(fine))
