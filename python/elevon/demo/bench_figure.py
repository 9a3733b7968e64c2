"""A sketch of the bench."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from elevon.data import packaged_toml
from elevon.report.figures import COLOURS, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDE, _HIGH = 2.1, 0.85


def bench_figure() -> Figure:
    """Draw the bench: actuator in blue, equipment in green, files in orange."""
    sketch = packaged_toml("elevon.demo", "bench_figure.toml")
    with new_figure(width=8.6, height=4.0) as (figure, axes):
        for title, text, left, bottom, colour in sketch["boxes"]:
            _box(axes, (left, bottom), title, text, COLOURS[colour])
        for start, end in sketch["arrows"]:
            _arrow(axes, start, end)
        _line(axes, ((9.15, 3.45), (9.15, 3.85), (1.05, 3.85)))
        _arrow(axes, (1.05, 3.85), (1.05, 3.45))
        axes.text(5.1, 3.9, "output position", ha="center", va="bottom")
        _line(axes, ((1.05, 0.0), (1.05, -0.35), (6.45, -0.35), (6.45, 0.0)), style=":")
        text = "the trigger: an edge in the trace, the zero of the load cell's file"
        axes.text(3.75, -0.42, text, ha="center", va="top", size=8)
        axes.set(xlim=(-0.1, 10.3), ylim=(-0.75, 4.2))
        axes.axis("off")
    return figure


def _box(axes: Any, corner: tuple[float, float], title: str, text: str, colour: str) -> None:
    from matplotlib.patches import FancyBboxPatch

    style = "round,pad=0,rounding_size=0.08"
    box = FancyBboxPatch(corner, _WIDE, _HIGH, boxstyle=style, fc="none", ec=colour, lw=1.6)
    axes.add_patch(box)
    middle = corner[0] + 0.5 * _WIDE
    axes.text(middle, corner[1] + 0.55, title, ha="center", va="center", weight="bold")
    axes.text(middle, corner[1] + 0.24, text, ha="center", va="center", size=8)


def _arrow(axes: Any, start: tuple[float, float], end: tuple[float, float]) -> None:
    look = {"arrowstyle": "-|>", "color": COLOURS["grey"], "lw": 1.2, "shrinkA": 1, "shrinkB": 1}
    axes.annotate("", xy=end, xytext=start, arrowprops=look)


def _line(axes: Any, points: tuple[tuple[float, float], ...], style: str = "-") -> None:
    axes.plot(*zip(*points, strict=True), color=COLOURS["grey"], lw=1.2, ls=style)
