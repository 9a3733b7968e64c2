"""A chart as a drawing: what is printed, and what is seen where no script runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from elevon.arrays import Floats
from elevon.report.thinning import thinned

_WIDTH, _LEFT, _TOP, _FOOT = 900.0, 64.0, 8.0, 58.0
_SLICES = 1600
_STEPS = (1.0, 2.0, 5.0, 10.0)
_TICKS = 6
_RULE = 'stroke="#888" stroke-opacity=".25"'


def drawing(
    time: Floats,
    lines: Mapping[str, Floats],
    colours: Sequence[str],
    *,
    labels: tuple[str, str],
    height: float,
    logarithmic: bool = False,
    dashed: Sequence[str] = (),
    shaded: Sequence[tuple[float, float, str, bool]] = (),
) -> str:
    """Return lines over one abscissa as an SVG element; arguments as `elevon.report.uplot.chart`.

    Holes of a line (NaN) stay holes; extremes of many samples stay.
    """
    at, drawn = thinned(time, lines, _SLICES)
    with np.errstate(divide="ignore", invalid="ignore"):
        if logarithmic:
            at, drawn = np.log10(at), {name: np.log10(line) for name, line in drawn.items()}
    x = _span(at)
    y = _span(np.concatenate([*drawn.values(), np.zeros(0)]), margin=0.05)
    right, bottom = _WIDTH - 8.0, _TOP + height - 40.0
    across = _Scale(x, (_LEFT, right))
    upward = _Scale(y, (bottom, _TOP))
    parts = [_shade(item, across, bottom, logarithmic) for item in shaded]
    parts += _axis_x(across, bottom, labels[0], logarithmic)
    parts += _axis_y(upward, right, labels[1], logarithmic)
    for k, (name, line) in enumerate(drawn.items()):
        dash = ' stroke-dasharray="6 4"' if name in dashed else ""
        look = f'fill="none" stroke="{colours[k % len(colours)]}" stroke-width="1.4"{dash}'
        parts += [f'<polyline {look} points="{p}"/>' for p in _runs(across(at), upward(line))]
    parts += _key(list(drawn), colours, bottom + 50.0)
    size = f'viewBox="0 0 {_WIDTH:g} {bottom + _FOOT:g}"'
    return (
        f'<svg class="fixed" {size} font-size="12" font-family="system-ui, sans-serif" '
        f'fill="currentColor" role="img" aria-label="{escape(", ".join(drawn), quote=True)}">'
        f"{''.join(parts)}</svg>"
    )


class _Scale:
    """From values to a stretch of the drawing."""

    def __init__(self, span: tuple[float, float], place: tuple[float, float]) -> None:
        self.span, self.place = span, place

    def __call__(self, values: Floats | float) -> Floats:
        (low, high), (start, end) = self.span, self.place
        return start + (np.asarray(values) - low) * (end - start) / (high - low)

    def ticks(self) -> Floats:
        low, high = self.span
        raw = (high - low) / _TICKS
        power = 10.0 ** np.floor(np.log10(raw))
        step = next(power * s for s in _STEPS if power * s >= raw * (1.0 - 1e-9))
        ticks: Floats = np.arange(np.ceil(low / step), np.floor(high / step) + 1.0) * step
        return ticks


def _span(values: Floats, margin: float = 0.0) -> tuple[float, float]:
    good = values[np.isfinite(values)]
    if not good.size:
        return 0.0, 1.0
    low, high = float(good.min()), float(good.max())
    wide = (high - low) * margin
    if high - low <= 1e-12 * max(abs(low), abs(high)):
        wide = 0.5 * abs(high) or 0.5
    return low - wide, high + wide


def _text(value: float, logarithmic: bool) -> str:
    return f"{10.0**value:.3g}" if logarithmic else f"{value:.6g}"


def _axis_x(scale: _Scale, bottom: float, label: str, logarithmic: bool) -> list[str]:
    start, end = scale.place
    parts = [f'<path d="M{start:g} {bottom:g}H{end:g}" stroke="currentColor"/>']
    for tick in scale.ticks():
        at = float(scale(tick))
        parts.append(f'<path d="M{at:.1f} {bottom:g}V{_TOP:g}" {_RULE}/>')
        text = _text(tick, logarithmic)
        parts.append(f'<text x="{at:.1f}" y="{bottom + 15:g}" text-anchor="middle">{text}</text>')
    middle = (start + end) / 2
    name = f'<text x="{middle:g}" y="{bottom + 32:g}" text-anchor="middle">{escape(label)}</text>'
    return [*parts, name]


def _axis_y(scale: _Scale, right: float, label: str, logarithmic: bool) -> list[str]:
    parts = []
    for tick in scale.ticks():
        at = float(scale(tick))
        parts.append(f'<path d="M{_LEFT:g} {at:.1f}H{right:g}" {_RULE}/>')
        text = _text(tick, logarithmic)
        parts.append(f'<text x="{_LEFT - 6:g}" y="{at + 4:.1f}" text-anchor="end">{text}</text>')
    middle = sum(scale.place) / 2
    turned = f'transform="translate(12 {middle:g}) rotate(-90)" text-anchor="middle"'
    return [*parts, f"<text {turned}>{escape(label)}</text>"]


def _shade(
    item: tuple[float, float, str, bool], across: _Scale, bottom: float, logarithmic: bool
) -> str:
    start, end = item[:2]
    if logarithmic:
        start, end = (float(np.log10(max(v, 1e-300))) for v in (start, end))
    a, b = np.clip(across(np.array([start, end])), *across.place)
    colour = "#d1483c" if item[3] else "#808894"
    place = f'x="{a:.1f}" y="{_TOP:g}" width="{max(b - a, 0.0):.1f}" height="{bottom - _TOP:g}"'
    return (
        f'<rect {place} fill="{colour}" fill-opacity=".12"/>'
        f'<text x="{a + 4:.1f}" y="{_TOP + 13:g}" font-size="11">{escape(item[2])}</text>'
    )


def _runs(x: Floats, y: Floats) -> list[str]:
    """Return the points of each stretch without a hole."""
    good = np.isfinite(x) & np.isfinite(y)
    edges = np.flatnonzero(np.diff(good.astype(int))) + 1
    texts = []
    for part in np.split(np.arange(good.size), edges):
        if part.size and good[part[0]]:
            pairs = zip(x[part], y[part], strict=True)
            texts.append(" ".join(f"{a:.1f},{b:.1f}" for a, b in pairs))
    return texts


def _key(names: Sequence[str], colours: Sequence[str], y: float) -> list[str]:
    parts, x = [], _LEFT
    for k, name in enumerate(names):
        colour = colours[k % len(colours)]
        parts.append(f'<rect x="{x:g}" y="{y - 9:g}" width="10" height="10" fill="{colour}"/>')
        parts.append(f'<text x="{x + 15:g}" y="{y:g}">{escape(name)}</text>')
        x += 30.0 + 6.6 * len(name)
    return parts
