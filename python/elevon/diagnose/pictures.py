"""Pictures of a diagnosis: signals against the healthy model, and what moved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.diagnose.engine.answer import Diagnosis, Moved
    from elevon.diagnose.engine.reading import SignalPanel

_POINTS = 800  # means drawn of a signal
_MOST = 12  # features drawn, those that deviate most


@dataclass(frozen=True)
class Traces:
    """A log's signals beside the model's, on the instants of `time` [s], shape (n,).

    `baseline`: whether it is one, not a log that was diagnosed.
    """

    name: str
    time: Floats
    panels: Sequence[SignalPanel]
    baseline: bool = False


def named_faults(result: Diagnosis) -> Mapping[str, float]:
    """Return what a diagnosis names, ``KIND@PLACE`` to the median severity; empty if healthy."""
    if result.status == "healthy":
        return {}
    for item in result.hypotheses:
        severities = {f"{f.kind}@{f.place}": f.severity for f in item.faults}
        if sorted(severities) == sorted(result.best):
            return severities
    seen = {f"{c.kind}@{c.place}": c.severity for c in result.faults}
    return {key: seen[key] for key in result.best if key in seen}


def traces_figure(traces: Traces) -> Figure:
    """Draw a log's signals over the healthy model's, and over the model with what is named."""
    from elevon.report.figures import COLOURS, new_figure

    count = len(traces.panels)
    size = {"width": 9.0, "height": 0.6 + 1.9 * count}
    with new_figure(count, 1, sharex=True, squeeze=False, **size) as (figure, grid):
        panels = sorted(traces.panels, key=lambda item: -item.apart)
        for axis, panel in zip(grid[:, 0], panels, strict=True):
            # The wide ones first: none hides another where they agree.
            lines = [("grey", "healthy model", 4.5, panel.healthy)]
            if panel.named is not None:
                lines.append(("orange", "model with what is named", 3.0, panel.named))
            lines.append(("blue", "baseline" if traces.baseline else "log", 1.0, panel.log))
            for colour, label, width, values in lines:
                line = _means(traces.time, values)
                axis.plot(*line, color=COLOURS[colour], lw=width, label=label)
            axis.set(ylabel=f"[{panel.unit}]", title=panel.name)
            axis.margins(x=0.0)
        grid[0, 0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
        grid[-1, 0].set(xlabel="time [s]")
    return figure


def _means(time: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Means over stretches of equal length: what a switched current ripples about."""
    width = max(1, len(time) // _POINTS)
    starts = np.arange(0, len(time) - width + 1, width)
    sums = np.add.reduceat(values[: starts[-1] + width], starts)
    return time[starts] + 0.5 * (width - 1) * (time[1] - time[0]), sums / width


def features_figure(moved: Sequence[Moved]) -> Figure:
    """Draw how far each number is off a healthy unit, and what the named faults account for."""
    from elevon.report.figures import COLOURS, new_figure

    ranked = sorted(moved, key=lambda item: -abs(item.score))[:_MOST][::-1]
    several = len({item.log for item in moved}) > 1
    names = [f"{m.name} ({m.log})" if several else m.name for m in ranked]
    at = np.arange(len(ranked))
    with new_figure(width=9.0, height=1.0 + 0.27 * len(ranked)) as (figure, axis):
        axis.axvspan(-2.0, 2.0, color=COLOURS["green"], alpha=0.15, lw=0, label="95 % of healthy")
        axis.barh(at, [m.score for m in ranked], color=COLOURS["blue"], height=0.6, label="log")
        explained = np.array([m.explained / m.deviation for m in ranked])
        if np.isfinite(explained).any() and np.any(explained != 0.0):
            axis.plot(explained, at, "D", ms=5, color=COLOURS["orange"], label="what is named")
        axis.set(yticks=at, yticklabels=names, xlabel="deviation from the healthy unit [sigma]")
        axis.grid(visible=False, axis="y")
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
    return figure
