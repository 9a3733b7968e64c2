"""Metrics of a series of predictions against the end that came.

Definitions: Saxena, Celaya, Saha, Saha, Goebel, "Metrics for offline evaluation of prognostic
performance", IJPHM 1 (2010). Where that paper leaves a choice, the strict one is made and stated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.report.figures import COLOURS, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Track:
    """Predictions of one unit's remaining life, in the order of use.

    Attributes
    ----------
    usage : ndarray, shape (m,)
        When they were made, rising.
    median, low, high : ndarray, shape (m,)
        Of the remaining useful life.
    end : float
        The use at which life ended.
    start : float
        Use at which the life began; shares of life are counted from there.
    """

    usage: Floats
    median: Floats
    low: Floats
    high: Floats
    end: float
    start: float = 0.0

    def __post_init__(self) -> None:
        sizes = {len(self.usage), len(self.median), len(self.low), len(self.high)}
        if len(sizes) != 1 or not len(self.usage):
            raise InputError("a track needs as many medians, lows and highs as uses, one at least")
        if (np.diff(self.usage) <= 0.0).any():
            raise InputError("the uses of a track must rise")
        if not self.end > self.start:
            raise InputError(f"life ends at {self.end:g}, not after its start at {self.start:g}")

    @property
    def true(self) -> Floats:
        """True remaining life at each prediction."""
        return self.end - self.usage

    def at(self, share: float) -> int:
        """Return the last prediction made at or before a share of life; -1: none."""
        limit = self.start + share * (self.end - self.start)
        return int(np.searchsorted(self.usage, limit * (1.0 + 1e-12), side="right")) - 1

    def predicted(self, share: float) -> tuple[float, float, float]:
        """Return median, low, high of the remaining life at a share of life.

        From the last prediction, less what has been used since.
        """
        k = self.at(share)
        if k < 0:
            raise InputError(f"no prediction was made before {share:.0%} of life")
        since = self.start + share * (self.end - self.start) - float(self.usage[k])
        rows = (self.median, self.low, self.high)
        return tuple(max(float(row[k]) - since, 0.0) for row in rows)  # type: ignore[return-value]


def relative_accuracy(track: Track, share: float) -> float:
    """Return 1 - |true - median| / true of the remaining life at a share of life; 1 is perfect."""
    if not 0.0 <= share < 1.0:
        raise InputError(f"share of life {share:g} is outside 0 to 1")
    true = (1.0 - share) * (track.end - track.start)
    return 1.0 - abs(track.predicted(share)[0] - true) / true


def cumulative_relative_accuracy(track: Track, shares: Sequence[float]) -> float:
    """Return the mean of the relative accuracy over shares of life, all with the same weight."""
    return float(np.mean([relative_accuracy(track, share) for share in shares]))


def prognostic_horizon(track: Track, alpha: float = 0.2) -> float:
    """Return the share of life before its end from which on medians stay within the band.

    The band is ``alpha`` of the whole life about the true remaining life. Strict: the horizon
    begins where the LAST stretch inside begins, not where a median falls inside for the first
    time; 0 where the last prediction is outside.
    """
    life = track.end - track.start
    inside = np.abs(track.median - track.true) <= alpha * life
    if not inside[-1]:
        return 0.0
    outside = np.flatnonzero(~inside)
    first = int(outside[-1]) + 1 if len(outside) else 0
    return float(track.true[first]) / life


def alpha_lambda(track: Track, share: float, alpha: float = 0.2) -> bool:
    """Return whether the median at a share of life is within ``alpha`` of what truly remains."""
    return relative_accuracy(track, share) >= 1.0 - alpha - 1e-12


def convergence(track: Track) -> float:
    """Return how late the error's weight lies: distance of its centre from the first prediction.

    The centre of the area under the absolute error over use; over the length of the track in use
    and the error of the first prediction alike, so that small is fast. NaN with fewer than two
    predictions or without error.
    """
    if len(track.usage) < 2:
        return float("nan")
    error = np.abs(track.median - track.true)
    scale = float(error.max())
    if scale == 0.0:
        return float("nan")
    way = (track.usage - track.usage[0]) / (track.usage[-1] - track.usage[0])
    error = error / scale
    area = np.trapezoid(error, way)
    x = np.trapezoid(error * way, way) / area
    y = 0.5 * np.trapezoid(error**2, way) / area
    return float(np.hypot(x, y))


def coverage(tracks: Sequence[Track], share: float) -> float:
    """Return the share of units whose interval holds the true remaining life at a share of life."""
    hits = []
    for track in tracks:
        _, low, high = track.predicted(share)
        true = (1.0 - share) * (track.end - track.start)
        hits.append(low <= true <= high)
    return float(np.mean(hits))


def wilson(hits: float, count: int, z: float = 1.959964) -> tuple[float, float]:
    """Return the 95 % interval of a share of `count` units (Wilson 1927)."""
    if count < 1:
        raise InputError("an interval of a share needs at least one unit")
    middle = (hits + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z / (1 + z**2 / count) * np.sqrt(hits * (1 - hits) / count + z**2 / (4 * count**2))
    return float(middle - half), float(middle + half)


_SHARES = (0.5, 0.6, 0.7, 0.8, 0.9)


def metrics_figure(
    tracks: Sequence[Track], *, alpha: float = 0.2, shares: Sequence[float] = _SHARES
) -> Figure:
    """Draw alpha-lambda, the prognostic horizon, relative accuracy and coverage of some units.

    Parameters
    ----------
    tracks : sequence of Track
        One a unit.
    alpha : float
        Half width of the bands: of what truly remains (alpha-lambda), of the whole life (horizon).
    shares : sequence of float
        Of life at which accuracy and coverage are drawn; each track must have begun before.
    """
    with new_figure(1, 3, width=10.5, height=3.4) as (figure, (wedge, band, rates)):
        _draw_wedge(wedge, tracks, alpha)
        _draw_horizon(band, tracks, alpha)
        _draw_rates(rates, tracks, shares)
    return figure


def _draw_wedge(axis: Any, tracks: Sequence[Track], alpha: float) -> None:
    share = np.linspace(0.0, 1.0, 50)
    left = 1.0 - share
    low, high = (1.0 - alpha) * left, (1.0 + alpha) * left
    axis.fill_between(share, low, high, color=COLOURS["green"], alpha=0.2, lw=0)
    axis.plot(share, left, color=COLOURS["green"])
    for track in tracks:
        life = track.end - track.start
        at = (track.usage - track.start) / life
        axis.plot(at, track.median / life, color=COLOURS["orange"], lw=0.8, alpha=0.7)
    axis.set(xlim=(0.0, 1.0), ylim=(0.0, 1.6), xlabel="share of life", ylabel="remaining [lives]")
    axis.set_title(f"Remaining, and {alpha:.0%} about it")


def _draw_horizon(axis: Any, tracks: Sequence[Track], alpha: float) -> None:
    """Errors in lives; a dot where the last stretch inside the band begins."""
    axis.axhspan(-alpha, alpha, color=COLOURS["green"], alpha=0.2, lw=0)
    horizons = [prognostic_horizon(track, alpha) for track in tracks]
    for track, horizon in zip(tracks, horizons, strict=True):
        life = track.end - track.start
        at, error = (track.usage - track.start) / life, (track.median - track.true) / life
        axis.plot(at, error, color=COLOURS["orange"], lw=0.8, alpha=0.7)
        if horizon > 0.0:
            start = np.interp(1.0 - horizon, at, error)
            axis.plot([1.0 - horizon], [start], "o", ms=4, color=COLOURS["blue"])
    most = max(3.0 * alpha, 0.1)
    axis.set(xlim=(0.0, 1.0), ylim=(-most, most), xlabel="share of life", ylabel="error [lives]")
    axis.set_title(f"Horizon, median {np.median(horizons):.2f} of life")


def _draw_rates(axis: Any, tracks: Sequence[Track], shares: Sequence[float]) -> None:
    accuracy = np.array([[relative_accuracy(t, s) for s in shares] for t in tracks])
    low, middle, high = np.quantile(accuracy, [0.1, 0.5, 0.9], axis=0)
    axis.fill_between(shares, low, high, color=COLOURS["blue"], alpha=0.2, lw=0)
    axis.plot(shares, middle, "o-", ms=4, color=COLOURS["blue"], label="relative accuracy")
    rates = [coverage(tracks, share) for share in shares]
    axis.plot(shares, rates, "s--", ms=4, color=COLOURS["orange"], label="coverage of intervals")
    mean = np.mean([cumulative_relative_accuracy(t, shares) for t in tracks])
    centre = np.nanmedian([convergence(t) for t in tracks]) if len(tracks[0].usage) > 1 else np.nan
    axis.set(ylim=(0.0, 1.05), xlabel="share of life")
    axis.set_title(f"Accuracy {mean:.2f}, convergence {centre:.2f}")
    axis.legend(loc="lower left")
