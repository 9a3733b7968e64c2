"""Figures of one look, drawn once and readable on light and on dark pages."""

from __future__ import annotations

import io
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from elevon.data import packaged_toml

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure

_LOOK = packaged_toml("elevon.report", "figures.toml")
COLOURS: dict[str, str] = dict(_LOOK["colours"])
# Stand-ins that matplotlib writes as they are and that inline_svg turns into the page's colours.
_INK = "#010203"
_RULE = "#030201"


@contextmanager
def _style(**more: Any) -> Iterator[None]:
    import matplotlib as mpl
    from cycler import cycler

    settings: Any = (
        _LOOK["style"] | {"axes.prop_cycle": cycler(color=list(COLOURS.values()))} | more
    )
    with mpl.rc_context(settings):
        yield


@contextmanager
def new_figure(
    rows: int = 1, columns: int = 1, *, width: float = 8.0, height: float = 3.6, **options: Any
) -> Iterator[tuple[Figure, Any]]:
    """Give a figure and its axes in the project's style; draw inside the block.

    Parameters
    ----------
    rows, columns : int
        Grid of axes.
    width, height : float
        Size in inches.
    **options
        Passed to `Figure.subplots` (`sharex`, `width_ratios`, ...).

    Yields
    ------
    (Figure, axes)
        As `Figure.subplots` returns them; no global pyplot state is touched.
    """
    from matplotlib.figure import Figure

    with _style():
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure, figure.subplots(rows, columns, **options)


def inline_svg(figure: Figure, name: str, description: str) -> Markup:
    """Draw a figure as an SVG element whose ink follows the page.

    Parameters
    ----------
    figure : Figure
        The figure.
    name : str
        Unique in its page; keeps the drawing's inner names apart from other drawings'.
    description : str
        Read out in place of the picture.

    Returns
    -------
    Markup
        The same bytes each time.
    """
    from markupsafe import Markup

    text = _svg_text(figure, name)
    body = text[text.index("<svg") :].replace(_INK, "currentColor").replace(_RULE, "var(--rule)")
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.S)
    body = re.sub(r'( id="|xlink:href="#|url\(#)', rf"\1f{name}-", body)
    body = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", body, count=1)
    body = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", body, count=1)
    label = f'<svg role="img" aria-label="{escape(description, quote=True)}"'
    # Safe: matplotlib escapes every text it writes, and the description is escaped above.
    return Markup(body.replace("<svg", label, 1))  # noqa: S704


def figure_markup(figure: Figure, name: str, caption: str) -> tuple[Markup, bool]:
    """Return a figure with its caption for a page, and whether it has charts.

    Parameters
    ----------
    figure : Figure
        The figure.
    name : str
        Unique in its page.
    caption : str
        What it shows; also read out in place of the drawing.
    """
    from markupsafe import Markup

    from elevon.report.panels import columns_of, panels_of
    from elevon.report.uplot import figure as live

    svg = inline_svg(figure, name, caption)
    panels = panels_of(figure, _INK)
    if panels is None:
        return Markup("<figure>{}<figcaption>{}</figcaption></figure>").format(svg, caption), False
    # Safe: the drawing is, the caption is escaped there, the data are base64 and escaped JSON.
    return Markup(live(svg, panels, columns_of(figure), caption)), True  # noqa: S704


def save_figure(
    figure: Figure, path: str | os.PathLike[str], *, force: bool = False, dpi: int = 150
) -> Path:
    """Write a figure to a file (.svg, .png, .pdf) with dark ink on white.

    Raises
    ------
    OutputExistsError, OutputError
        As `elevon.files.write_bytes`.
    """
    from elevon.files import write_bytes

    target = Path(path)
    if target.suffix.lower() == ".svg":
        text = _svg_text(figure, target.stem, facecolor="white")
        data = text.replace(_INK, "#1f2630").replace(_RULE, "#d9dee5").encode()
    else:
        stream = io.BytesIO()
        with _style():
            _repaint_rules(figure)
            _legends_aside(figure)
            figure.savefig(
                stream, format=target.suffix.lower().lstrip("."), dpi=dpi, facecolor="white"
            )
        data = stream.getvalue()
    return write_bytes(target, data, force=force)


def on_white(drawing: str) -> str:
    """Return an SVG element as a picture of its own: dark ink on white, on any page."""
    # As a plain text: in a `Markup` what is put in would be escaped.
    dark = str(drawing).replace("<svg ", '<svg color="#1f2630" ', 1)
    return re.sub(
        r"(<svg[^>]*>)", r'\1<rect width="100%" height="100%" fill="#ffffff"/>', dark, count=1
    )


def _legends_aside(figure: Figure) -> None:
    """Put legends that would lie over the curves above them, or beside where a title stands."""
    for axes in figure.axes:
        legend = axes.get_legend()
        # Whoever gave a place outside has chosen; there is no public way to ask.
        if legend is None or legend._bbox_to_anchor is not None:  # type: ignore[attr-defined]
            continue
        titled = bool(axes.get_title("left") or axes.get_title())
        handles, labels = axes.get_legend_handles_labels()
        if labels != [text.get_text() for text in legend.get_texts()]:
            handles = [handle for handle in legend.legend_handles if handle is not None]
            labels = [text.get_text() for text in legend.get_texts()]
        axes.legend(
            handles, labels, loc="upper left" if titled else "lower right",
            bbox_to_anchor=(1.0, 1.0), ncols=1 if titled else min(3, len(labels)),
        )  # fmt: skip


def _svg_text(figure: Figure, name: str, **options: Any) -> str:
    stream = io.StringIO()
    _legends_aside(figure)
    with _style(**{"svg.hashsalt": name, "svg.id": None}):
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None}, **options)
    return stream.getvalue()


def _repaint_rules(figure: Figure) -> None:
    """Give grid lines a visible grey: outside SVG the stand-in would print as near-black."""
    for axes in figure.axes:
        for line in (*axes.get_xgridlines(), *axes.get_ygridlines()):
            line.set_color("#d9dee5")
