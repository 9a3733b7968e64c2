"""The forest plot of a calibration: new values over old ones, with their intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from elevon.estimate import Estimate
from elevon.report.figures import COLOURS, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def forest(
    estimates: Sequence[Estimate], truth: Mapping[str, float] | None = None
) -> Figure | None:
    """Return the plot of what an actuator file holds and held before; None where that is nothing.

    Parameters
    ----------
    estimates : sequence of Estimate
        Those without an old value of the same sign cannot be displayed as a ratio.
    truth : mapping, optional
        True values of a virtual unit, SI.
    """
    known = truth or {}
    changed = [i for i in estimates if i.in_set and i.old and i.value and i.old * i.value > 0.0]
    if not changed:
        return None
    with new_figure(width=8.0, height=0.28 * len(changed) + 1.2) as (figure, axes):
        for row, item in enumerate(reversed(changed)):
            assert item.old is not None
            low, high = (end / item.old for end in item.interval)
            axes.plot([low, high], [row, row], color=COLOURS["blue"], lw=3, solid_capstyle="butt")
            axes.plot(item.value / item.old, row, "o", color=COLOURS["blue"], ms=4)
            if item.path in known:
                axes.plot(known[item.path] / item.old, row, "x", color=COLOURS["red"], ms=7)
        axes.axvline(1.0, color=COLOURS["grey"], lw=0.8)
        axes.set(
            yticks=range(len(changed)),
            yticklabels=[item.path for item in reversed(changed)],
            xlabel="New value over old (cross: truth)" if known else "New value over old",
        )
    return figure
