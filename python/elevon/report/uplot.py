"""Interactive time charts inside a page, with uPlot (vendored, MIT) and nothing from the network.

A page carries the library once (`assets`), then any number of charts (`chart`). Data travel as
base64 inside the page: times as float64, values as float32, thinned to the extremes of equal time
slices when they are many, so that no peak is lost.
"""

import json
from collections.abc import Mapping, Sequence
from functools import cache
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.report.fixed import drawing
from elevon.report.panels import with_times_once
from elevon.report.policy import policy
from elevon.report.thinning import packed, thinned

COLOURS = ("#2f7fd1", "#e0782f", "#2f9e6e", "#d1483c", "#8a6fd0", "#8a929d", "#b8860b", "#0f8b8d")
"""Of middle lightness, legible on white and near-black, distinct to the colour-blind."""


@cache
def assets() -> str:
    """Return the style and script elements that a page with charts needs, once.

    Returns
    -------
    str
        HTML for the head of the page. The page must allow inline scripts and styles.
    """
    vendor = files("elevon.report") / "vendor"
    library = (vendor / "uPlot.iife.min.js").read_text(encoding="utf-8")
    style = (vendor / "uPlot.min.css").read_text(encoding="utf-8")
    licence = (vendor / "LICENSE-uplot.txt").read_text(encoding="utf-8")
    templates = files("elevon.report") / "templates"
    look = (templates / "charts.css").read_text(encoding="utf-8")
    script = (templates / "charts.js").read_text(encoding="utf-8")
    return (
        f"<style>{style}\n{look}</style>\n"
        f"<script>/*\n{licence}*/\n{library}</script>\n<script>\n{script}</script>"
    )


def chart(
    title: str,
    time: npt.ArrayLike,
    lines: Mapping[str, npt.ArrayLike],
    *,
    x_label: str = "time [s]",
    y_label: str = "",
    height: int = 260,
    note: str = "",
    breaks: tuple[int, ...] = (),
    shaded: Sequence[tuple[float, float, str, bool]] = (),
    logarithmic: bool = False,
    dashed: Sequence[str] = (),
) -> str:
    """Return one chart as an HTML element; the page needs `assets` in its head.

    Parameters
    ----------
    title : str
        Heading; any text, it is escaped, as are all other texts.
    time : array_like, shape (n,)
        Abscissa, increasing.
    lines : mapping of str to array_like, shape (n,)
        Name to values; values that are not finite leave a hole in the line.
    x_label, y_label : str
        Axis labels with units.
    height : int
        Height of the plot in CSS pixels.
    note : str
        Small text below; that the data were thinned is added to it.
    breaks : tuple of int
        Indices k after which every line is interrupted (gaps of a clock).
    shaded : sequence of (start, end, text, alarming)
        Stretches of the abscissa that are shaded and named.
    logarithmic : bool
        Of both axes.
    dashed : sequence of str
        Lines that are drawn dashed.

    Returns
    -------
    str
        An HTML element.
    """
    instants = np.asarray(time, dtype=np.float64)
    values = {name: np.asarray(line, dtype=np.float64) for name, line in lines.items()}
    if breaks:
        instants, values = _interrupted(instants, values, breaks)
    selected, drawn = thinned(instants, values)
    if selected.size < instants.size:
        drawn_as = f"drawn as the extremes of {selected.size // 2} time slices."
        note = f"{note} {instants.size} samples {drawn_as}".lstrip()
    series = with_times_once([
        _line(name, line, selected, COLOURS[k % len(COLOURS)], dashed=name in dashed)
        for k, (name, line) in enumerate(drawn.items())
    ])  # fmt: skip
    labels = (x_label, y_label)
    panel = {
        "title": "", "label": labels, "log": [bool(logarithmic)] * 2, "limits": None,
        "ticks": [None, None], "height": int(height), "series": series,
        "shapes": [_stretch(k, item) for k, item in enumerate(shaded)],
    }  # fmt: skip
    fixed = drawing(
        instants, values, COLOURS, labels=labels, height=height,
        logarithmic=logarithmic, dashed=dashed, shaded=shaded,
    )  # fmt: skip
    heading = f"<h3>{escape(title)}</h3>{fixed}"
    below = f'<p class="note">{escape(note)}</p>' if note else ""
    return _element("section", heading, [panel], 1, below)


def figure(svg: str, panels: Sequence[Mapping[str, object]], columns: int, caption: str) -> str:
    """Return a figure whose drawing is replaced by charts of the same data where scripts run.

    Parameters
    ----------
    svg : str
        The drawing, an SVG element.
    panels : sequence of dict
        As `elevon.report.panels.panels_of` returns them.
    columns : int
        Panels side by side where the page is wide enough.
    caption : str
        Under it; escaped.
    """
    return _element("figure", svg, panels, columns, f"<figcaption>{escape(caption)}</figcaption>")


def _element(
    tag: str, before: str, panels: Sequence[Mapping[str, object]], columns: int, after: str
) -> str:
    data = json.dumps({"columns": columns, "panels": panels}, allow_nan=False)
    data = data.replace("<", "\\u003c")
    return (
        f'<{tag} class="elevon-chart">{before}<div class="panels"></div>'
        f'<script type="application/json">{data}</script>{after}</{tag}>'
    )


def _line(name: str, line: Floats, time: Floats, colour: str, *, dashed: bool) -> dict[str, Any]:
    return {
        "name": name, "colour": colour, "dash": [6, 4] if dashed else None, "width": 1.4,
        "alpha": 1.0, "marker": "", "step": 0,
        "time": packed(time, "<f8"), "values": packed(line),
    }  # fmt: skip


def _stretch(k: int, item: tuple[float, float, str, bool]) -> dict[str, Any]:
    start, end, text, alarming = item
    colour = "#d1483c" if alarming else "#808894"
    alpha = 0.12 if alarming or k % 2 == 0 else 0.05
    return {
        "kind": "box", "name": "", "colour": colour, "alpha": alpha,
        "x": [float(start), float(end)], "y": None, "text": text, "row": k,
        "ink": "#c0392b" if alarming else "",
    }  # fmt: skip


def page(title: str, body: str) -> str:
    """Return a whole self-contained page around charts.

    Parameters
    ----------
    title : str
        Title, escaped.
    body : str
        HTML, such as charts one after the other; taken as it is.
    """
    look = (
        ":root { color-scheme: light dark; } body { margin: 1.5rem auto; max-width: 75rem; "
        "padding: 0 1rem; background: Canvas; color: CanvasText; } "
        "h1 { font: 600 1.3rem system-ui, sans-serif; } svg { width: 100%; height: auto; }"
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy(assets())}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{look}</style>\n{assets()}</head>\n"
        f"<body><h1>{escape(title)}</h1>\n{body}\n</body></html>\n"
    )


def _interrupted(
    time: Floats, values: Mapping[str, Floats], breaks: tuple[int, ...]
) -> tuple[Floats, dict[str, Floats]]:
    """Put a sample without value into the middle of each gap."""
    after = np.asarray(breaks, dtype=np.intp)
    holes = (time[after] + time[after + 1]) / 2
    lines = {name: np.insert(line, after + 1, np.nan) for name, line in values.items()}
    return np.insert(time, after + 1, holes), lines
