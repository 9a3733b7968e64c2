"""Small HTML views of objects for notebooks: a heading, facts, a table, sparklines.

No style sheet, no script, nothing loaded: a notebook may show them from an untrusted file.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from html import escape

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats

_GOOD, _BAD, _GREY, _LINE = "#1a7f37", "#b42318", "#777777", "#2066a8"

_WIDTH, _HEIGHT = 140, 26


class Html(str):
    """Text that is HTML already; every other text is escaped."""

    __slots__ = ()


def badge(status: str) -> Html:
    """Return a status as a coloured word: ``ok`` and ``healthy`` green, ``measured`` grey."""
    good = status in ("ok", "pass", "healthy")
    colour = _GOOD if good else _GREY if status == "measured" else _BAD
    return Html(f'<span style="color:{colour};font-weight:bold">{escape(status)}</span>')


def sparkline(values: npt.ArrayLike) -> Html:
    """Return a curve of shape (n,) as a small SVG; its extremes survive, NaN leaves a gap."""
    line = np.asarray(values, dtype=np.float64)
    good = line[np.isfinite(line)]
    if good.size < 2:
        return Html("")
    low, high = float(good.min()), float(good.max())
    scale = (_HEIGHT - 4) / (high - low) if high > low else 0.0
    paths = []
    for x, part in _parts(line):
        y = _HEIGHT - 2 - (part - low) * scale if scale else np.full(part.size, _HEIGHT / 2)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        paths.append(f'<polyline fill="none" stroke="{_LINE}" points="{points}"/>')
    return Html(
        f'<svg width="{_WIDTH}" height="{_HEIGHT}" role="img" aria-label="curve">'
        f"{''.join(paths)}</svg>"
    )


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> Html:
    """Return a table; the cells are texts, `Html` or None."""
    cells = "".join(f'<th style="text-align:left">{escape(name)}</th>' for name in head)
    lines = [
        "".join(f'<td style="text-align:left">{_text(cell)}</td>' for cell in row) for row in rows
    ]
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return Html(f"<table><thead><tr>{cells}</tr></thead><tbody>{body}</tbody></table>")


def card(title: str, facts: Iterable[tuple[str, object]], *parts: Html, folded: str = "") -> Html:
    """Return a view: its title, facts in one line, then parts, folded under a heading if given."""
    line = " · ".join(
        f"{escape(name)} {_text(value)}".strip() for name, value in facts if value != ""
    )
    body = "".join(parts)
    if folded:
        body = f"<details><summary>{escape(folded)}</summary>{body}</details>"
    return Html(f"<div><strong>{escape(title)}</strong><div>{line}</div>{body}</div>")


def _text(cell: object) -> str:
    if isinstance(cell, Html):
        return cell
    return "" if cell is None else escape(str(cell))


def _parts(line: npt.NDArray[np.float64]) -> list[tuple[Floats, Floats]]:
    """Thin a line to the least and the greatest of each column of pixels; cut it at NaN."""
    count = min(line.size, _WIDTH // 2)
    edges = np.linspace(0, line.size, count + 1).astype(int)
    parts: list[tuple[list[float], list[float]]] = [([], [])]
    for first, last in itertools.pairwise(edges):
        column = line[first:last]
        if not np.isfinite(column).all():
            parts.append(([], []))
            continue
        x = _WIDTH * (first + last) / (2 * line.size)
        ordered = sorted((int(column.argmin()), int(column.argmax())))
        for index in dict.fromkeys(ordered):
            parts[-1][0].append(x)
            parts[-1][1].append(float(column[index]))
    return [(np.array(x), np.array(y)) for x, y in parts if x]
