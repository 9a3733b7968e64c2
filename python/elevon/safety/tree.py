"""The fault tree of a hazard as SVG: its most frequent cut sets, down to the failures."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from elevon.safety.result import CutSet, HazardResult

MOST = 12
"""Cut sets that are drawn; a line states how many are left out."""
_ROW, _WIDTH = 24, 760
_TOP, _GATE, _AND, _EVENT = 10, 232, 300, 356
"""Heights of a row, width of the drawing; where hazard, gates and failures begin [px]."""


def fault_tree(hazard: HazardResult) -> str:
    """Return the drawing: hazard, OR gate, an AND gate a set, failures; dormant ones are dashed.

    Parameters
    ----------
    hazard : HazardResult
        With its cut sets.
    """
    drawn = hazard.cut_sets[:MOST]
    left = len(hazard.cut_sets) - len(drawn)
    height = _ROW * (sum(cut.order for cut in drawn) + len(drawn) + 1 + (left > 0))
    middle = height / 2.0
    parts = [*_hazard(hazard, middle)]
    y = float(_ROW)
    for cut in drawn:
        parts += _set(cut, y, middle)
        y += _ROW * (cut.order + 1)
    if left:
        remaining = sum(cut.mean for cut in hazard.cut_sets[MOST:])
        parts.append(_text(_EVENT, y, f"{left} more sets, together {remaining:.1e} an hour"))
    label = escape(f"Fault tree of {hazard.name}")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height:g}" role="img" '
        f'aria-label="{label}" font-family="sans-serif" font-size="12" fill="none" '
        f'stroke="currentColor" style="max-width:{_WIDTH}px;width:100%">{"".join(parts)}</svg>'
    )


def _hazard(hazard: HazardResult, y: float) -> Iterator[str]:
    yield f'<rect x="{_TOP}" y="{y - 24:g}" width="190" height="48" rx="3"/>'
    yield _text(_TOP + 8, y - 4, hazard.name, weight="bold")
    yield _text(_TOP + 8, y + 13, f"{hazard.mean:.1e} an hour")
    yield _line(_TOP + 190, y, _GATE, y)
    # An OR gate on its side: curved back, pointed at the hazard.
    tip, back, flank = _GATE, _GATE + 34, _GATE + 10
    yield (
        f'<path d="M{back} {y - 18:g} Q{back - 10} {y:g} {back} {y + 18:g} '
        f'Q{flank} {y + 14:g} {tip} {y:g} Q{flank} {y - 14:g} {back} {y - 18:g}Z"/>'
    )


def _set(cut: CutSet, top: float, trunk: float) -> Iterator[str]:
    """One set: its gate where it has several failures, then a line a failure."""
    centre = top + _ROW * (cut.order - 1) / 2.0
    yield f'<path d="M{_GATE + 29} {trunk:g}H{_GATE + 46}V{centre:g}H{_AND}"/>'
    if cut.order > 1:
        # An AND gate on its side: flat back, round front.
        yield (
            f'<path d="M{_AND + 26} {centre - 11:g}H{_AND + 11}A11 11 0 0 0 {_AND + 11} '
            f'{centre + 11:g}H{_AND + 26}Z"/>'
        )
    ordered = len(cut.last) < cut.order
    for number, name in enumerate(cut.failures):
        y = top + _ROW * number
        start = _AND + 26 if cut.order > 1 else _AND
        out = min(max(y, centre - 8.0), centre + 8.0)
        yield f'<path d="M{start} {out:g}H{_AND + 36}V{y:g}H{_EVENT}"/>'
        dashed = ' stroke-dasharray="3 2"' if name in cut.dormant else ""
        yield f'<circle cx="{_EVENT + 7}" cy="{y:g}" r="7"{dashed}/>'
        word = " (last)" if ordered and name in cut.last else ""
        hidden = ", dormant" if name in cut.dormant else ""
        yield _text(_EVENT + 20, y + 4, f"{name}{hidden}{word}")
    yield _text(_EVENT + 20, top + _ROW * cut.order - 5, f"{cut.mean:.1e} an hour, {cut.phase}",
                size=10)  # fmt: skip


def _text(x: float, y: float, text: str, *, weight: str = "normal", size: int = 12) -> str:
    return (
        f'<text x="{x:g}" y="{y:g}" fill="currentColor" stroke="none" font-weight="{weight}" '
        f'font-size="{size}">{escape(text)}</text>'
    )


def _line(x: float, y: float, to_x: float, to_y: float) -> str:
    return f'<path d="M{x:g} {y:g}L{to_x:g} {to_y:g}"/>'
