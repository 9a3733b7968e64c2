"""Pictures of the metrics: predictions of units whose ends came."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.prognose.metrics import (
    Track,
    convergence,
    coverage,
    cumulative_relative_accuracy,
    prognostic_horizon,
    relative_accuracy,
)
from elevon.report.figures import COLOURS, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
