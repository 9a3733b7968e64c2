"""The forest plot of a calibration: new values over old ones, with their intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from elevon.calibrate.estimate import Estimate
from elevon.report.figures import COLOURS, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["forest"]


def forest(
    estimates: Sequence[Estimate], truth: Mapping[str, float] | None = None
) -> Figure | None:
    """Return the plot of what a set holds and held before; None where that is nothing.

    Parameters
    ----------
    estimates : sequence of Estimate
        Those without an old value of the same sign cannot be shown as a ratio.
    truth : mapping, optional
        True values of a virtual unit, SI.
    """
    known = truth or {}
    shown = [i for i in estimates if i.in_set and i.old and i.value and i.old * i.value > 0.0]
    if not shown:
        return None
    with new_figure(width=8.0, height=0.28 * len(shown) + 1.2) as (figure, axes):
        for row, item in enumerate(reversed(shown)):
            assert item.old is not None
            low, high = (end / item.old for end in item.interval)
            axes.plot([low, high], [row, row], color=COLOURS["blue"], lw=3, solid_capstyle="butt")
            axes.plot(item.value / item.old, row, "o", color=COLOURS["blue"], ms=4)
            if item.path in known:
                axes.plot(known[item.path] / item.old, row, "x", color=COLOURS["red"], ms=7)
        axes.axvline(1.0, color=COLOURS["grey"], lw=0.8)
        axes.set(
            yticks=range(len(shown)),
            yticklabels=[item.path for item in reversed(shown)],
            xlabel="New value over old (cross: truth)" if known else "New value over old",
        )
    return figure
