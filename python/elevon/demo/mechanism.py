"""A moving picture of the mechanism, driven by signals of a run (SVG animation, no script)."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats

if TYPE_CHECKING:
    from markupsafe import Markup

    from elevon.actuator import Actuator
    from elevon.demo.run import LifeDemo

_FRAMES = 100
_FINER = 20  # samples for each frame
_SECONDS = 5.0  # one sweep of the mission
_SWING = 3.0  # drawn degrees a degree of the flap
_GAP = 26.0  # drawn degrees a degree of backlash
_PANEL = 440  # px


@dataclass(frozen=True)
class Motion:
    """One sweep, shape (n,) each, angles at the output [deg].

    Attributes
    ----------
    output, driver, command : ndarray
        Flap, the motor's side of the backlash, the command.
    motor : ndarray
        Motor angle [turns].
    backlash : float
        Total backlash.
    error : float
        Largest tracking error, at each sample of a drive's log and not only at those drawn.
    """

    output: Floats
    driver: Floats
    command: Floats
    motor: Floats
    backlash: float
    error: float


def motion(demo: LifeDemo, usage: float) -> Motion:
    """Run one sweep of the mission with the hidden unit as it is at a use."""
    from elevon.demo.unit import demo_mission, faults_at
    from elevon.errors import ElevonWarning
    from elevon.simulate import simulate

    unit: Actuator = demo.hidden
    scenario = demo_mission().scenarios().replaced(duration=2.0 * _SECONDS)
    scenario = scenario.with_faults(faults_at(demo.life, usage))
    record = f"output_position,motor_position,command@{_FINER * _FRAMES / _SECONDS:g} Hz"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ElevonWarning)
        run = simulate(unit, scenario, fidelity="low", record=record)
    sweep = slice(_FINER * _FRAMES, 2 * _FINER * _FRAMES + 1)
    every = [
        np.asarray(run[name].values[sweep])
        for name in ("output_position", "motor_position", "command")
    ]
    largest = float(np.abs(every[2] - every[0]).max())
    output, motor, command = (values[::_FINER] for values in every)
    ratio = unit.parameters.value("gear.ratio")
    backlash = unit.parameters.value("backlash.total") + float(demo.life.at(usage)[0])
    return Motion(
        np.degrees(output),
        np.degrees(motor / ratio),
        np.degrees(command),
        motor / (2.0 * math.pi),
        math.degrees(backlash),
        math.degrees(largest),
    )


def mechanism(panels: list[tuple[str, Motion]]) -> Markup:
    """Draw several mechanisms side by side, moving together, with their tracking errors below.

    Parameters
    ----------
    panels : list of (str, Motion)
        Heading and motion; texts are escaped.
    """
    from markupsafe import Markup

    width = _PANEL * len(panels)
    largest = [float(np.abs(m.command - m.output).max()) for _, m in panels]
    top = 1.15 * max(*largest, 1e-9)
    body = "".join(
        f'<g transform="translate({k * _PANEL} 0)">{_panel(title, m, top)}</g>'
        for k, (title, m) in enumerate(panels)
    )
    # Safe: numbers and escaped headings only.
    return Markup(  # noqa: S704
        f'<svg role="img" aria-label="moving picture of the mechanism" viewBox="0 0 {width} 400" '
        f'xmlns="http://www.w3.org/2000/svg">{body}</svg>'
    )


def _panel(title: str, moved: Motion, top: float) -> str:
    from html import escape

    heading = (
        f'<text x="20" y="24" font-size="16" font-weight="600" fill="currentColor">'
        f"{escape(title)}</text>"
    )
    return heading + _motor(moved) + _joint(moved) + _errors(moved, top)


def _turning(values: Floats, x: float, y: float) -> str:
    """Return the animation of a group's angle about (x, y)."""
    keys = ";".join(f"{v:.2f} {x:g} {y:g}" for v in values)
    return (
        '<animateTransform attributeName="transform" type="rotate" '
        f'dur="{_SECONDS:g}s" repeatCount="indefinite" values="{keys}"/>'
    )


def _motor(moved: Motion) -> str:
    """Motor with its shaft; drawn one turn for ten, so that the eye follows."""
    turns = 36.0 * (moved.motor - moved.motor[0])
    return (
        '<rect x="26" y="96" width="92" height="92" rx="10" fill="none" stroke="currentColor" '
        'stroke-width="2"/><circle cx="72" cy="142" r="32" fill="#2f7fd1" fill-opacity="0.2" '
        'stroke="#2f7fd1" stroke-width="2"/>'
        f'<g><path d="M72 142 L72 112" stroke="#2f7fd1" stroke-width="5" stroke-linecap="round"/>'
        f'<circle cx="72" cy="142" r="5" fill="#2f7fd1"/>{_turning(turns, 72, 142)}</g>'
        '<path d="M118 142 H182" stroke="currentColor" stroke-width="5"/>'
        '<text x="72" y="210" font-size="13" text-anchor="middle" fill="currentColor">motor</text>'
        '<text x="150" y="132" font-size="12" text-anchor="middle" fill="currentColor">1:124'
        "</text>"
    )


def _joint(moved: Motion) -> str:
    """Driving pin (orange) in the fork of the flap (blue); the gap is the backlash, enlarged."""
    x, y, r = 232.0, 142.0, 44.0
    swing = _SWING * (moved.output - moved.output.mean())
    gap = moved.driver - moved.output
    middle = 0.5 * float(gap.max() + gap.min())
    pin = swing + _GAP * (gap - middle)
    half = 0.5 * _GAP * moved.backlash + 8.0
    flap = (
        f'<path d="M{x} {y - 14} C{x + 60} {y - 22} {x + 120} {y - 10} {x + 178} {y} '
        f'C{x + 120} {y + 10} {x + 60} {y + 22} {x} {y + 14} Z" fill="#2f7fd1" '
        'fill-opacity="0.25" stroke="#2f7fd1" stroke-width="2"/>'
    )
    fork = "".join(_tooth(x, y, r, sign * half) for sign in (-1.0, 1.0))
    ring = f'<circle cx="{x}" cy="{y}" r="{r + 14}" fill="none" stroke="#2f7fd1" stroke-width="2"/>'
    driver = (
        f'<circle cx="{x}" cy="{y}" r="20" fill="#e0782f" fill-opacity="0.3" stroke="#e0782f" '
        f'stroke-width="2"/><path d="M{x} {y} L{x} {y - r - 4}" stroke="#e0782f" '
        'stroke-width="8" stroke-linecap="round"/>'
    )
    return (
        f"<g>{flap}{ring}{fork}{_turning(swing, x, y)}</g>"
        f"<g>{driver}{_turning(pin, x, y)}</g>"
        f'<text x="{x}" y="226" font-size="13" text-anchor="middle" fill="currentColor">'
        f"gear with {moved.backlash:.2f} deg of backlash</text>"
        f'<text x="{x + 140}" y="188" font-size="13" text-anchor="middle" fill="currentColor">flap'
        "</text>"
    )


def _tooth(x: float, y: float, r: float, angle: float) -> str:
    """Return a stop of the fork at an angle from the top [deg]."""
    inclination = math.radians(angle)
    ends = [
        (x + k * r * math.sin(inclination), y - k * r * math.cos(inclination)) for k in (0.62, 1.28)
    ]
    (x1, y1), (x2, y2) = ends
    return (
        f'<path d="M{x1:.1f} {y1:.1f} L{x2:.1f} {y2:.1f}" stroke="#2f7fd1" stroke-width="6" '
        'stroke-linecap="round"/>'
    )


def _errors(moved: Motion, top: float) -> str:
    """Tracking error over the sweep, with a cursor that runs along."""
    left, right, base, height = 40.0, 420.0, 315.0, 50.0
    error = moved.command - moved.output
    x = np.linspace(left, right, len(error))
    y = base - height * error / top
    line = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    dots = ";".join(f"{a:.1f}" for a in x), ";".join(f"{b:.1f}" for b in y)
    moving = "".join(
        f'<animate attributeName="{name}" dur="{_SECONDS:g}s" repeatCount="indefinite" '
        f'values="{values}"/>'
        for name, values in zip(("cx", "cy"), dots, strict=True)
    )
    return (
        f'<path d="M{left} {base} H{right}" stroke="currentColor" stroke-opacity="0.35"/>'
        f'<polyline points="{line}" fill="none" stroke="#d1483c" stroke-width="2"/>'
        f'<circle r="5" fill="#d1483c">{moving}</circle>'
        f'<text x="{left}" y="254" font-size="13" fill="currentColor">tracking error, largest '
        f"{moved.error:.3g} deg</text>"
        f'<text x="{right}" y="385" font-size="12" text-anchor="end" fill="currentColor">one '
        f"sweep, {_SECONDS:g} s</text>"
    )
