"""An animated picture of a recorded session: what the page shows, for where no page runs."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape

import numpy as np

from elevon.errors import InputError
from elevon.live.static import recorded_session
from elevon.number_text import severity_texts

if TYPE_CHECKING:
    from elevon.arrays import Floats
    from elevon.live.bench import LiveBench

_RATE = 12.0  # pictures a second
_SPAN = 0.03  # rad of the gap from flank to flank of the drawing


def animated_picture(bench: LiveBench) -> str:
    """Run the recorded session of a turning actuator and return it as an animated SVG.

    Raises
    ------
    InputError
        An actuator of another wiring.
    """
    unit = bench.unit
    if unit.actuator.wiring != "rotary":
        raise InputError(f"--picture: draws the wiring 'rotary', not {unit.actuator.wiring!r}")
    session = recorded_session(bench)
    time, values = _arrays(session)
    at = np.arange(time[0], time[-1], 1.0 / _RATE)
    drawn = {name: np.interp(at, time, line) for name, line in values.items()}
    length = float(at[-1] - at[0])
    ratio = unit.actuator.parameters.value("gear.ratio")
    gap = drawn["resolver_position"] / ratio - drawn["encoder_position"]
    parts = [
        *_mechanism(drawn, gap, ratio, length),
        *_trace(at, np.degrees(gap), length),
        *_strip(session["states"], float(at[0]), length),
    ]
    style = (files("elevon.live") / "picture.css").read_text("utf-8")
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 760 330" role="img" '
        'aria-label="The live bench: motor, gear, lever, backlash, and the diagnosis">'
        f"<style>{style}</style>"
        '<rect class="card" x="1" y="1" width="758" height="328" rx="8"/>'
        f"{''.join(parts)}</svg>\n"
    )


def _arrays(session: Mapping[str, Any]) -> tuple[Floats, dict[str, Floats]]:
    def read(text: str, kind: str) -> Floats:
        return np.frombuffer(base64.b64decode(text), dtype=kind).astype(np.float64)

    values = {name: read(text, "<f4") for name, text in session["values"].items()}
    return read(session["times"], "<f8"), values


def _mechanism(drawn: Mapping[str, Floats], gap: Floats, ratio: float, length: float) -> list[str]:
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


def _trace(at: Floats, gap: Floats, length: float) -> list[str]:
    """The difference of the two positions over the session, with a hand at the instant."""
    low, high = float(gap.min()), float(gap.max())
    x = 20.0 + (at - at[0]) / length * 720.0
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


def _strip(states: Sequence[Mapping[str, Any]], begin: float, length: float) -> list[str]:
    """The health strip: each verdict while it stands."""
    out = []
    for index, state in enumerate(states):
        first = max(0.0, (state["time"] - begin) / length)
        last = (states[index + 1]["time"] - begin) / length if index + 1 < len(states) else 1.0
        kind, words = _verdict(state["health"])
        line = (
            f'<rect class="{kind}" x="20" y="282" width="8" height="34" rx="3"/>'
            f'<text class="ink big" x="40" y="304">{escape(words)}</text>'
        )
        times = [0.0, min(first, 1.0), min(last, 1.0)]
        if first < 1.0:
            out.append(
                f'<g opacity="0">{line}<animate attributeName="opacity" calcMode="discrete" '
                f'values="{0 if first > 0.0 else 1};1;0" '
                f'keyTimes="{";".join(f"{t:.4f}" for t in times)}" dur="{length:.2f}s" '
                'repeatCount="indefinite"/></g>'
            )
    return out


def _verdict(health: Mapping[str, Any]) -> tuple[str, str]:
    if health["status"] == "healthy":
        return "green", f"Healthy: p(fault) {health['p_fault']:.2f}"
    if health["status"] == "waiting":
        return "grey", health["text"].capitalize()
    if not health["faults"]:
        return "red", health["status"].replace("_", " ")
    fault = health["faults"][0]
    middle, low, high = severity_texts(fault["severity"], tuple(fault["interval"]), fault["unit"])
    return "red", (
        f"Faulty: {fault['kind']} at the {fault['place']}, {middle} ({low} to {high}), "
        f"p {fault['probability']:.2f}"
    )
