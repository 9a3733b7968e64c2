"""Block diagrams of the wirings, as text for the terminal and as SVG for documents."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from html import escape

from elevon.data import packaged_toml
from elevon.errors import unknown
from elevon.plain import Plain


@dataclass(frozen=True)
class Block(Plain):
    """One box of the signal path.

    Attributes
    ----------
    title : str
        What it is.
    lines : tuple of str
        What it does, a few words a line.
    signal : str
        What leaves it towards the next box.
    """

    title: str
    lines: tuple[str, ...]
    signal: str = ""


@dataclass(frozen=True)
class Diagram(Plain):
    """A chain of boxes, what enters it from outside, and what is fed back.

    Attributes
    ----------
    blocks : tuple of Block
        In the direction of the signal.
    source : str
        The signal that enters the first box.
    loads : mapping of int to str
        Index of a box to what acts on it from outside.
    feedback : tuple of (int, int, str)
        From box, to box, signal; the shortest first, so that no line crosses another.
    """

    blocks: tuple[Block, ...]
    source: str
    loads: tuple[tuple[int, str], ...]
    feedback: tuple[tuple[int, int, str], ...]


@cache
def _diagrams() -> dict[str, Diagram]:
    read = packaged_toml("elevon", "diagrams.toml")
    return {name: Diagram.from_dict(data) for name, data in read.items()}


def diagrams() -> list[str]:
    """Return the wirings that have a diagram."""
    return list(_diagrams())


def diagram_text(wiring: str) -> str:
    """Return the block diagram of a wiring as text, boxes from top to bottom."""
    diagram = _find(wiring)
    width = max(len(line) for block in diagram.blocks for line in (block.title, *block.lines)) + 4
    loads = dict(diagram.loads)
    out = [f"{diagram.source:^{width + 2}}".rstrip()]
    for index, block in enumerate(diagram.blocks):
        out.append(f"{'v':^{width + 2}}".rstrip())
        out.append("+" + "-" * width + "+")
        outside = f" <-- {loads[index]}" if index in loads else ""
        out.append(f"|{block.title:^{width}}|{outside}")
        out.extend(f"|{line:^{width}}|" for line in block.lines)
        out.append("+" + "-" * width + "+")
        out.append(f"{'|':^{width + 2}}".rstrip())
        out.append(f"{block.signal:^{width + 2}}".rstrip())
    out.append("")
    for source, target, signal in diagram.feedback:
        blocks = diagram.blocks
        out.append(f"feedback: {blocks[source].title} -> {blocks[target].title}: {signal}")
    return "\n".join(out)


_WIDTH, _HEIGHT, _GAP, _TOP, _LEFT = 176, 96, 96, 76, 96


def diagram_svg(wiring: str) -> str:
    """Return the block diagram of a wiring as a self-contained SVG document."""
    diagram = _find(wiring)
    count = len(diagram.blocks)
    width = _LEFT + count * (_WIDTH + _GAP) + 16
    height = _TOP + _HEIGHT + 44 * len(diagram.feedback) + 32
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" font-family="Helvetica, Arial, sans-serif">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" '
        'markerHeight="8" orient="auto"><path d="M0 0L8 4L0 8z" fill="#234"/></marker></defs>',
        f'<rect width="{width}" height="{height}" fill="#fff"/>',
    ]
    parts.append(_arrow(8, _middle(), _LEFT, _middle()))
    parts.append(_label((8 + _LEFT) / 2, _middle() - 8, diagram.source))
    for index, block in enumerate(diagram.blocks):
        parts.extend(_box(index, block))
    for index, text in diagram.loads:
        x = _x(index) + _WIDTH / 2
        parts.append(_arrow(x, _TOP - 36, x, _TOP))
        parts.append(_label(x, _TOP - 44, text))
    for row, feedback in enumerate(diagram.feedback):
        parts.extend(_feedback(row, *feedback))
    return "\n".join([*parts, "</svg>"]) + "\n"


def _find(wiring: str) -> Diagram:
    if wiring not in _diagrams():
        raise unknown("diagram", wiring, _diagrams())
    return _diagrams()[wiring]


def _x(index: int) -> float:
    return _LEFT + index * (_WIDTH + _GAP)


def _middle() -> float:
    return _TOP + _HEIGHT / 2


def _box(index: int, block: Block) -> list[str]:
    x = _x(index)
    parts = [
        f'<rect x="{x}" y="{_TOP}" width="{_WIDTH}" height="{_HEIGHT}" rx="6" fill="#eef3f8" '
        'stroke="#234" stroke-width="1.4"/>',
        f'<text x="{x + _WIDTH / 2}" y="{_TOP + 24}" text-anchor="middle" font-size="14" '
        f'font-weight="bold" fill="#123">{escape(block.title)}</text>',
    ]
    for row, line in enumerate(block.lines):
        parts.append(
            f'<text x="{x + _WIDTH / 2}" y="{_TOP + 46 + 18 * row}" text-anchor="middle" '
            f'font-size="12" fill="#345">{escape(line)}</text>'
        )
    end = x + _WIDTH
    parts.append(_arrow(end, _middle(), end + _GAP, _middle()))
    parts.append(_label(end + _GAP / 2, _middle() - 8, block.signal))
    return parts


def _feedback(row: int, source: int, target: int, signal: str) -> list[str]:
    # Each return line leaves and enters its boxes at its own abscissa: none hides another.
    y = _TOP + _HEIGHT + 34 + 44 * row
    start = _x(source) + _WIDTH * (0.5 + 0.12 * row)
    end = _x(target) + _WIDTH * (0.65 - 0.15 * row)
    path = f"M{start} {_TOP + _HEIGHT}V{y}H{end}V{_TOP + _HEIGHT}"
    return [
        f'<path d="{path}" fill="none" stroke="#234" stroke-width="1.4" marker-end="url(#tip)"/>',
        _label((start + end) / 2, y - 7, signal),
    ]


def _arrow(x1: float, y1: float, x2: float, y2: float) -> str:
    return (
        f'<path d="M{x1} {y1}L{x2} {y2}" stroke="#234" stroke-width="1.4" marker-end="url(#tip)"/>'
    )


def _label(x: float, y: float, text: str) -> str:
    return (
        f'<text x="{x}" y="{y}" text-anchor="middle" font-size="11.5" fill="#234">'
        f"{escape(text)}</text>"
    )
