"""A moving picture of a turning actuator, driven by its signals (animated SVG, no script)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from importlib.resources import files

import numpy as np

from elevon.arrays import Floats

_SPAN = 0.03  # rad of the gap from flank to flank of the drawing


def moving_svg(panels: Sequence[Sequence[str]], label: str, *, height: float) -> str:
    """Return panels one below the other as one picture that needs nothing beside it.

    Parameters
    ----------
    panels : sequence of sequences of str
        SVG elements of each, 760 wide; their texts are escaped.
    label : str
        Read out in place of the picture.
    height : float
        Of each panel.
    """
    style = (files("elevon.report") / "templates" / "mechanism.css").read_text("utf-8")
    cards = "".join(
        f'<g transform="translate(0 {at * height:g})"><rect class="card" x="1" y="1" width="758" '
        f'height="{height - 2:g}" rx="8"/>{"".join(parts)}</g>'
        for at, parts in enumerate(panels)
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 760 {len(panels) * height:g}" '
        f'role="img" aria-label="{label}"><style>{style}</style>{cards}</svg>\n'
    )


def mechanism(drawn: Mapping[str, Floats], gap: Floats, ratio: float, length: float) -> list[str]:
    """Return motor, gear, lever and backlash as they move.

    Parameters
    ----------
    drawn : mapping of str to ndarray, shape (n,)
        ``motor_position``, ``output_position``, ``command`` at equal intervals [rad].
    gap : ndarray, shape (n,)
        Motor's side of the backlash less the output [rad].
    ratio : float
        Of the gear.
    length : float
        Duration [s].
    """
    motor, output = np.degrees(drawn["motor_position"]), -np.degrees(drawn["output_position"])
    command = -np.degrees(drawn["command"])
    middle = 0.5 * (gap.max() + gap.min())
    place = (gap - middle) / _SPAN * 60.0
    rotor = '<circle class="metal" cx="90" cy="115" r="36"/>' + "".join(
        f'<rect class="{kind}" x="116" y="110" width="10" height="10" '
        f'transform="rotate({angle} 90 115)"/>'
        for angle, kind in ((0, "blue"), (90, "red"), (180, "blue"), (270, "red"))
    )
    edge = 0.5 * (gap.max() - gap.min()) / _SPAN * 60.0 + 20.0
    return [
        '<circle class="line" cx="90" cy="115" r="54"/>',
        _turning(rotor, motor, 90, 115, length),
        '<path class="line" d="M144 115 H190"/>',
        _turning(_wheel(200, 115, 28, 10), motor, 200, 115, length),
        _turning(_wheel(284, 115, 54, 22), output * 4.0, 284, 115, length),
        _turning('<path class="ghost" d="M284 115 H394"/>', command, 284, 115, length),
        _turning('<path class="arm" d="M284 115 H384"/>', output, 284, 115, length),
        f'<path class="metal" d="M{510 - edge - 26:.1f} 70 h26 l8 45 l-8 45 h-26 z"/>',
        f'<path class="metal" d="M{510 + edge + 26:.1f} 70 h-26 l-8 45 l8 45 h26 z"/>',
        _moving('<path class="blue" d="M496 155 l-2 -40 l6 -40 h20 l6 40 l-2 40 z"/>', place,
                length),
        '<text class="soft" x="90" y="45" text-anchor="middle">motor</text>',
        f'<text class="soft" x="240" y="45" text-anchor="middle">gear 1 : {ratio:g}</text>',
        '<text class="soft" x="510" y="45" text-anchor="middle">backlash at the output</text>',
    ]  # fmt: skip


def _wheel(x: float, y: float, radius: float, teeth: int) -> str:
    points = []
    for i in range(4 * teeth):
        angle, r = 2.0 * math.pi * i / (4 * teeth), radius * (1.0 if i % 4 < 2 else 0.86)
        points.append(f"{x + r * math.cos(angle):.1f},{y + r * math.sin(angle):.1f}")
    hub = f'<path class="line" d="M{x - radius * 0.6:.1f} {y} h{radius * 1.2:.1f}"/>'
    return f'<polygon class="metal" points="{" ".join(points)}"/>{hub}'


def _turning(inner: str, degrees: Floats, x: float, y: float, length: float) -> str:
    angles = ";".join(f"{angle:.1f} {x:g} {y:g}" for angle in degrees)
    return _animated(inner, "rotate", angles, length)


def _moving(inner: str, pixels: Floats, length: float) -> str:
    return _animated(inner, "translate", ";".join(f"{way:.1f} 0" for way in pixels), length)


def _animated(inner: str, kind: str, values: str, length: float) -> str:
    return (
        f'<g>{inner}<animateTransform attributeName="transform" type="{kind}" values="{values}" '
        f'dur="{length:.2f}s" repeatCount="indefinite"/></g>'
    )


def trace(gap: Floats, length: float) -> list[str]:
    """Return the difference of the two positions [deg] over time, with a hand at the instant."""
    low, high = float(gap.min()), float(gap.max())
    x = np.linspace(20.0, 740.0, len(gap))
    y = 262.0 - (gap - low) / max(high - low, 1e-12) * 62.0
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    return [
        '<path class="axis" d="M20 266 H740"/>',
        '<text class="soft" x="20" y="193">motor less output, as the sensors show it: '
        f"{high - low:.2f}° in all</text>",
        f'<polyline class="trace" points="{points}"/>',
        '<path class="ghost" d="M20 196 V266"><animateTransform attributeName="transform" '
        f'type="translate" values="0 0;720 0" dur="{length:.2f}s" repeatCount="indefinite"/>'
        "</path>",
    ]
