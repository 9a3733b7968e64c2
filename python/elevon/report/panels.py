"""What a drawn figure shows, as data of interactive charts: one panel for each of its axes.

The drawing stays in the page: it is printed, and is what a reader without scripts sees.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.report.thinning import packed, thinned

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.container import Container
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

Panel = dict[str, Any]

_MOST_POINTS = 4000  # of a line: two for each pixel of a wide page
_DASHES = {"--": [7, 4], ":": [2, 3], "-.": [7, 3, 2, 3]}
_PIXELS = 96.0  # of CSS, an inch
_TEXT = 62  # pixels that the labels of an axis take
_LEAST = 150
_NO_LINE = ("None", "", " ")
_STEPS = {"steps-post": 1, "steps-pre": -1}


def panels_of(figure: Figure, ink: str) -> list[Panel] | None:
    """Return the panels of a figure that has been drawn; None where it has what no chart shows.

    Parameters
    ----------
    figure : Figure
        After its layout: heights are those of its axes.
    ink : str
        Colour that stands for the page's own.

    Returns
    -------
    list of dict, or None
        None for pictures of a matrix, diagrams without axes, polar axes.
    """
    if not figure.axes or any(_beyond(axes) for axes in figure.axes):
        return None
    names = _names(figure)
    return [_panel(axes, names, ink) for axes in figure.axes]


def columns_of(figure: Figure) -> int:
    """Return how many axes stand side by side."""
    return len({round(axes.get_position().x0, 2) for axes in figure.axes})


def _beyond(axes: Axes) -> bool:
    from matplotlib.collections import LineCollection, PathCollection, PolyCollection

    known = (LineCollection, PolyCollection, PathCollection)
    return (
        axes.name != "rectilinear"
        or not axes.axison
        or bool(axes.images)
        or any(not isinstance(item, known) for item in axes.collections)
    )


def _names(figure: Figure) -> dict[str, str]:
    """Return what a colour stands for where a legend of any of the axes tells."""
    names: dict[str, str] = {}
    for axes in figure.axes:
        for line in axes.lines:
            if label := _label(line):
                names.setdefault(_colour(line.get_color(), ""), label)
    return names


def _label(artist: Artist | Container) -> str:
    label = str(artist.get_label())
    return "" if label.startswith("_") else _plain(label)


def _plain(text: str) -> str:
    """Return a text as the drawing shows it: dollars that were escaped against formulas."""
    return text.replace(r"\$", "$")


def _colour(colour: Any, ink: str) -> str:
    from matplotlib.colors import to_hex, to_rgba

    text = to_hex(colour, keep_alpha=to_rgba(colour)[3] < 1.0)
    return "" if text == ink else text


def _panel(axes: Axes, names: Mapping[str, str], ink: str) -> Panel:
    series, shapes = _lines(axes, names, ink)
    inches = axes.get_position().height * axes.get_figure(root=True).get_figheight()  # type: ignore[union-attr]
    height = max(_LEAST, round(_PIXELS * inches) + _TEXT)
    return {
        "title": _plain(axes.get_title("left") or axes.get_title()),
        "label": (_plain(axes.get_xlabel()) or _below(axes), _plain(axes.get_ylabel())),
        "log": [axes.get_xscale() == "log", axes.get_yscale() == "log"],
        "limits": [[float(v) for v in pair] for pair in (axes.get_xlim(), axes.get_ylim())],
        "ticks": [_words(axes.xaxis), _words(axes.yaxis)],
        "height": height,
        "series": with_times_once(series),
        "shapes": [
            *_areas(axes, ink), *_boxes(axes, ink), *filter(_finite, shapes), *_texts(axes, ink),
            *_entries(axes, ink),
        ],
    }  # fmt: skip


def with_times_once(series: list[Panel]) -> list[Panel]:
    """Return lines of which each has an abscissa only where it is not that of the line before."""
    last = ""
    out = []
    for line in series:
        out.append(line | {"time": None} if line["time"] == last else line)
        last = line["time"]
    return out


def _entries(axes: Axes, ink: str) -> list[Panel]:
    """Return entries of the legend that name nothing drawn."""
    legend = axes.get_legend()
    if legend is None:
        return []
    every: list[Any] = [*axes.get_children(), *axes.containers]
    drawn = {item.get_label() for item in every}
    pairs = zip(legend.legend_handles, legend.get_texts(), strict=True)
    return [
        {"kind": "key", "name": _plain(text.get_text()), "colour": _handle_colour(handle, ink)}
        for handle, text in pairs
        if text.get_text() not in drawn
    ]


def _handle_colour(handle: Any, ink: str) -> str:
    get = getattr(handle, "get_color", None) or handle.get_facecolor
    colour = np.atleast_2d(get())[0] if not isinstance(get(), str) else get()
    return _colour(colour, ink)


def _finite(shape: Panel) -> bool:
    places = [shape.get("at", 0.0), *(shape.get("x") or ()), *(shape.get("y") or ())]
    return all(np.isfinite(v) for v in places if isinstance(v, float))


def _below(axes: Axes) -> str:
    """Return the label of the axes that bears the abscissa of a shared column."""
    shared = axes.get_shared_x_axes().get_siblings(axes)
    return next((_plain(other.get_xlabel()) for other in shared if other.get_xlabel()), "")


def _words(axis: Any) -> list[tuple[float, str]] | None:
    """Return the ticks of an axis whose labels are words; None where they are its numbers."""
    from matplotlib.category import StrCategoryFormatter
    from matplotlib.ticker import FixedFormatter, FuncFormatter

    if not isinstance(
        axis.get_major_formatter(), FixedFormatter | FuncFormatter | StrCategoryFormatter
    ):
        return None
    labels = [_plain(item.get_text()) for item in axis.get_ticklabels()]
    pairs = zip(axis.get_majorticklocs(), labels, strict=False)
    return [(float(at), text) for at, text in pairs]


def _lines(axes: Axes, names: Mapping[str, str], ink: str) -> tuple[list[Panel], list[Panel]]:
    """Return the lines over an increasing abscissa, which have values to read, and the others."""
    series: list[Panel] = []
    shapes: list[Panel] = []
    ordinary = _words(axes.yaxis) is None
    for line in axes.lines:
        x, y = (np.asarray(v, dtype=np.float64) for v in line.get_data(orig=False))
        if x.size == 0 and not _label(line):
            continue
        if line.get_transform() != axes.transData:
            shapes.append(_whole(line, axes, ink))
        elif ordinary and (order := _order(x, line)) is not None:
            look = _look(line, ink)
            name = _label(line) or names.get(look["colour"], "") or _plain(axes.get_ylabel())
            title = {"name": name or "value", "own": bool(_label(line))}
            series.append(look | title | _values(line, x[order], y[order]))
        else:
            shapes.append(_path(line, x, y, ink))
    return series, shapes


def _order(x: Floats, line: Line2D) -> npt.NDArray[np.intp] | None:
    """Return the order in which the abscissa increases; None where the line goes back."""
    if x.size <= 1:
        return None if x.size else np.arange(0)
    if line.get_linestyle() in _NO_LINE:
        return np.argsort(x, kind="stable")
    return np.arange(x.size) if bool(np.all(np.diff(x[np.isfinite(x)]) >= 0.0)) else None


def _look(line: Line2D, ink: str) -> Panel:
    marker = str(line.get_marker())
    drawn = line.get_linestyle() not in _NO_LINE
    return {
        "colour": _colour(line.get_color(), ink),
        "width": line.get_linewidth() * _PIXELS / 72.0 if drawn else 0.0,
        "dash": _DASHES.get(str(line.get_linestyle())),
        "alpha": 1.0 if (alpha := line.get_alpha()) is None else float(alpha),
        "marker": "" if marker in _NO_LINE else marker,
        "size": line.get_markersize() * _PIXELS / 72.0,
        "hollow": str(line.get_markerfacecolor()) in ("none", "white"),
    }


def _values(line: Line2D, x: Floats, y: Floats) -> Panel:
    # Two values at one abscissa (an edge) stay two: a chart has one column for each.
    x = x + np.arange(x.size) * 1e-12 * float(np.ptp(x) if x.size else 0.0)
    time, lines = thinned(x, {"y": y}, _MOST_POINTS)
    step = _STEPS.get(str(line.get_drawstyle()), 0)
    return {"step": step, "time": packed(time, "<f8"), "values": packed(lines["y"])}


def _path(line: Line2D, x: Floats, y: Floats, ink: str) -> Panel:
    good = np.isfinite(x) & np.isfinite(y)
    return _look(line, ink) | {
        "kind": "path",
        "name": _label(line),
        "x": packed(x[good], "<f8"),
        "y": packed(y[good], "<f8"),
    }


def _whole(line: Line2D, axes: Axes, ink: str) -> Panel:
    """Return a line over the whole height or width."""
    upright = line.get_transform() == axes.get_xaxis_transform(which="grid")
    x, y = (np.asarray(v, dtype=np.float64) for v in line.get_data(orig=False))
    return _look(line, ink) | {
        "kind": "upright" if upright else "level",
        "name": _label(line),
        "at": float((x if upright else y)[0]),
    }


def _areas(axes: Axes, ink: str) -> list[Panel]:
    """Return areas between lines, and bars of errors as short lines."""
    from matplotlib.collections import LineCollection, PathCollection

    shapes: list[Panel] = []
    for item in axes.collections:
        if isinstance(item, PathCollection):
            shapes.append(_points(item, ink))
            continue
        lined = isinstance(item, LineCollection)
        colours = item.get_edgecolor() if lined else item.get_facecolor()
        for path in item.get_paths():
            corners = np.asarray(path.vertices, dtype=np.float64)
            corners = corners[np.isfinite(corners).all(axis=1)]
            shapes.append({
                "kind": "path" if lined else "area",
                "name": _label(item) if path is item.get_paths()[0] else "",
                "colour": _colour(colours[0], ink) if len(colours) else "",
                "alpha": 1.0,
                "width": float(np.atleast_1d(item.get_linewidth())[0]) * _PIXELS / 72.0,
                "dash": None, "marker": "", "size": 0.0, "hollow": False,
                "x": packed(corners[:, 0], "<f8"), "y": packed(corners[:, 1], "<f8"),
            })  # fmt: skip
    return shapes


def _points(item: Any, ink: str) -> Panel:
    at = np.asarray(item.get_offsets(), dtype=np.float64)
    return {
        "kind": "path", "name": _label(item), "colour": _colour(item.get_facecolor()[0], ink),
        "alpha": 1.0, "width": 0.0, "dash": None, "marker": "o",
        "size": float(np.sqrt(np.asarray(item.get_sizes())[0])) * _PIXELS / 72.0, "hollow": False,
        "x": packed(at[:, 0], "<f8"), "y": packed(at[:, 1], "<f8"),
    }  # fmt: skip


def _boxes(axes: Axes, ink: str) -> list[Panel]:
    """Return bars and shaded stretches; an end that is the whole height or width is None."""
    from matplotlib.patches import Rectangle

    shapes: list[Panel] = []
    bars = {id(bar): _label(group) for group in axes.containers for bar in group}
    for patch in axes.patches:
        if not isinstance(patch, Rectangle):
            continue
        x, y, width, height = patch.get_x(), patch.get_y(), patch.get_width(), patch.get_height()
        frame = patch.get_data_transform()
        upright = frame == axes.get_xaxis_transform(which="grid")
        level = frame == axes.get_yaxis_transform(which="grid")
        shapes.append({
            "kind": "box", "colour": _colour(patch.get_facecolor(), ink), "alpha": 1.0,
            "name": _label(patch) or bars.pop(id(patch), ""),
            "x": None if level else [float(x), float(x + width)],
            "y": None if upright else [float(y), float(y + height)],
        })  # fmt: skip
    seen: set[str] = set()
    for shape in shapes:  # a group of bars has one entry
        if shape["name"] in seen:
            shape["name"] = ""
        seen.add(shape["name"])
    return [shape for shape in shapes if _finite(shape)]


def _texts(axes: Axes, ink: str) -> list[Panel]:
    """Return words at places of the data; those with an arrow are no part of a chart."""
    from matplotlib.text import Annotation

    words: list[Panel] = []
    for item in axes.texts:
        place: Any = item.get_position() if item.get_transform() == axes.transData else None
        if isinstance(item, Annotation) and item.xycoords == "data":
            place = item.xy
        if place is None or not item.get_text():
            continue
        words.append({
            "kind": "text", "name": "", "text": _plain(item.get_text()),
            "colour": _colour(item.get_color(), ink), "align": item.get_horizontalalignment(),
            "x": float(place[0]), "y": float(place[1]),
        })  # fmt: skip
    return words
