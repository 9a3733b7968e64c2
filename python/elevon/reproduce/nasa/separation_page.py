"""What the page of `nasa-separation` draws beside its rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.nasa.corners import ACCELERATION
from elevon.reproduce.nasa.effect import POWER
from elevon.reproduce.nasa.population import spread_rows
from elevon.reproduce.nasa.separation_rows import SeparationResult, SeparationRow

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROUNDED = ", rounded"
SHAPE_COLOURS = {
    "trapezoidal": COLOURS["blue"],
    "sinusoidal": COLOURS["orange"],
    "triangular": COLOURS["green"],
    "sweep": COLOURS["violet"],
}


def page_values(result: SeparationResult) -> dict[str, object]:
    """Return the drawings, and what the tables say beside the rows."""
    places = dict.fromkeys((trace.load, trace.profile) for trace in result.traces)
    return {
        "winners": list(result.winners().values()),
        "power": POWER,
        "acceleration": ACCELERATION,
        "map": _power_map(result),
        "effects": _effects_figure(result),
        "best": _winners(result),
        "traces": [
            (load, shape, [t for t in result.traces if (t.load, t.profile) == (load, shape)])
            for load, shape in places
        ],
        "spread": spread_rows(),
    }


def _groups(result: SeparationResult) -> dict[tuple[str, float], list[SeparationRow]]:
    groups: dict[tuple[str, float], list[SeparationRow]] = {}
    for row in result.rows:
        groups.setdefault((row.fault, row.load), []).append(row)
    return groups


def _winners(result: SeparationResult) -> list[list[object]]:
    rows: list[list[object]] = []
    for (fault, load), group in _groups(result).items():
        largest = max(group, key=lambda row: abs(row.effect.size))
        winner = next((row.profile for row in group if row.winner), None)
        if winner is None and not any(row.effect.significant for row in group):
            verdict = "not shown by any"
        else:
            verdict = winner or "none named"
        rows.append(
            [fault, f"{load:.0f}", largest.feature.replace("current reference", "current"),
             verdict, f"{abs(largest.effect.size):.3g}", f"{100 * largest.power:.0f} %",
             _draws(largest, verdict)]
        )  # fmt: skip
    return rows


def _power_map(result: SeparationResult) -> Figure:
    groups = _groups(result)
    shapes = list(dict.fromkeys(row.profile for row in result.rows))
    sizes = np.zeros((len(groups), len(shapes)))
    best: list[tuple[int, int]] = []
    for line, group in enumerate(groups.values()):
        for row in group:
            column = shapes.index(row.profile)
            sizes[line, column] = max(sizes[line, column], abs(row.effect.size))
            if row.winner:
                best.append((line, column))
    with new_figure(width=8.0, height=0.24 * len(groups) + 1.6) as (figure, axes):
        picture = axes.imshow(np.log10(np.maximum(sizes, 0.1)), aspect="auto", cmap="viridis")
        axes.grid(visible=False)
        axes.set_xticks(range(len(shapes)), shapes, rotation=20, ha="right", fontsize=8)
        names = [f"{fault}, {load:.0f} N" for fault, load in groups]
        axes.set_yticks(range(len(names)), names, fontsize=7)
        for line, column in best:
            axes.plot(column, line, "s", mfc="none", mec="white", ms=11, mew=1.5)
        figure.colorbar(picture, label="log10 of the effect size")
    return figure


def _draws(row: SeparationRow, verdict: str) -> str:
    if row.draws is not None:
        return f"{row.draws:d}"
    return "over 1e9" if verdict == "none named" else ""


def _effects_figure(result: SeparationResult) -> Figure:
    faults = list(dict.fromkeys(row.fault for row in result.rows))
    loads = sorted({row.load for row in result.rows})
    shapes = list(dict.fromkeys(row.profile for row in result.rows))
    lines = (len(faults) + 1) // 2
    height = 1.9 * lines + 0.5
    with new_figure(lines, 2, width=8.0, height=height, sharex=True, squeeze=False) as (
        figure,
        grid,
    ):
        for axes, fault in zip(grid.flat, faults, strict=False):
            for place, shape in enumerate(shapes):
                rows = [r for r in result.rows if r.fault == fault and r.profile == shape]
                x = np.array([loads.index(r.load) for r in rows])
                _bars(axes, x + (place - 0.5 * (len(shapes) - 1)) * 0.7 / len(shapes), rows)
            axes.axhline(0.0, color=COLOURS["grey"], lw=0.8)
            axes.set_title(fault, fontsize=9)
            axes.set_xticks(range(len(loads)), [f"{load:.0f} N" for load in loads])
        for axes in grid[:, 0]:
            axes.set_ylabel("Effect size")
        handles, labels = grid.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    return figure


def _bars(axes: Axes, x: np.ndarray, rows: list[SeparationRow]) -> None:
    """Draw the effects of one profile with their intervals; rounded corners have open marks."""
    shape = rows[0].profile
    name, rounded, _ = shape.partition(_ROUNDED)
    size = np.array([row.effect.size for row in rows])
    ends = np.array([[row.effect.low, row.effect.high] for row in rows]).T
    axes.errorbar(
        x, size, np.abs(ends - size), fmt="o", ms=3.5, lw=1, mew=1,
        color=SHAPE_COLOURS.get(name, COLOURS["grey"]), label=shape,
        mfc="none" if rounded else None,
    )  # fmt: skip
