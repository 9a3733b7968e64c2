"""An animated picture of a recorded session: what the page shows, for where no page runs."""

from __future__ import annotations

import base64
import json
import math
import re
import tempfile
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape

import numpy as np

from elevon.data import packaged_toml
from elevon.errors import InputError
from elevon.files import check_output, write_bytes, write_text
from elevon.live.app import asset
from elevon.live.health import Examiner, Health, Request
from elevon.live.trace import write_stretch
from elevon.number_text import severity_texts
from elevon.plain import plain
from elevon.results import finite

if TYPE_CHECKING:
    from elevon.arrays import Floats
    from elevon.live.bench import LiveBench
    from elevon.live.replay import LogReplay


SECONDS = 24.0
"""Of a recorded session."""
_BROKEN = 10.0  # s at which the fault begins
_EVERY = 4  # samples to one that is stored
_STATES = 2.0  # s between two states
#: The modules in the order in which they use each other, joined into one script.
_MODULES = ("dom", "source", "store", "plots", "picture", "command", "sliders", "main")


def write_static(bench: LiveBench | LogReplay, folder: Path, *, force: bool = False) -> list[Path]:
    """Write the page and a session of 24 s; return the files.

    Raises
    ------
    InputError
        A log: it is replayed by `elevon live`.
    OutputExistsError
        A file that is there, without `force`.
    """
    from elevon.live.bench import LiveBench

    if not isinstance(bench, LiveBench):
        raise InputError("--static: records a session of an actuator, not of a log")
    names = (
        "index.html",
        "page.js",
        "session.js",
        "style.css",
        "uplot.js",
        "uplot.css",
        "icon.svg",
    )
    for name in names:
        check_output(folder / name, force=force)
    session = json.dumps(finite(plain(recorded_session(bench))), allow_nan=False)
    texts = {"index.html": _page(), "page.js": _script(),
             "session.js": f"window.elevonSession = {session};\n"}  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    written = [write_text(folder / name, text, force=force) for name, text in texts.items()]
    for name in names[3:]:
        content = asset(name)
        assert content is not None
        written.append(write_bytes(folder / name, content[0], force=force))
    return written


def recorded_session(bench: LiveBench, seconds: float = SECONDS) -> dict[str, Any]:
    """Run a bench without a clock, break it on the way; return what the page needs of it."""
    unit = bench.unit
    show = packaged_toml("elevon.live", "shows.toml")[unit.actuator.wiring]
    times: list[float] = []
    rows: list[Floats] = []
    states: list[dict[str, Any]] = []
    broken, noted = False, -np.inf
    examiner = Examiner(unit.actuator, (), None)
    bench.panel.run(unit, show["command"])
    bench.loop.ring.append(unit.time, unit.values())
    while unit.time < seconds:
        if not broken and unit.time >= _BROKEN:
            bench.act({"fault": show["fault"]})
            broken = True
        bench.loop.sample()
        if len(rows) == 0 or bench.loop.ring.written % _EVERY == 0:
            times.append(unit.time)
            rows.append(bench.loop.ring.latest())
        if unit.time - noted >= _STATES:
            noted = unit.time
            states.append(_state(bench, examiner))
    table = np.asarray(rows, dtype=np.float64)
    return {
        "model": bench.describe(),
        "times": _packed(np.asarray(times), "<f8"),
        "values": {name: _packed(table[:, i], "<f4") for i, name in enumerate(unit.names)},
        "states": states,
    }


def _state(bench: LiveBench, examiner: Examiner) -> dict[str, Any]:
    part = bench.stretch()
    if isinstance(part, str):
        bench.watch.health = Health(text=part)
    else:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "live.csv"
            write_stretch(path, part, bench.unit.actuator, bench.unit.fidelity)
            bench.watch.take(examiner.examine(Request(str(path), part.motion)), part)
            examiner.learn()
    state = bench.state()
    return {**state, "control": None, "factor": 1.0}


def _packed(values: Floats, kind: str) -> str:
    return base64.b64encode(values.astype(kind).tobytes()).decode("ascii")


def _text(name: str) -> str:
    content = asset(name)
    assert content is not None, name
    return content[0].decode("utf-8")


def _script() -> str:
    """Return the modules as one script: a page that is opened from a disk loads no modules."""
    joined = "\n".join(_text(f"{name}.js") for name in _MODULES)
    joined = re.sub(r"^import .*?;\n", "", joined, flags=re.M)
    joined = re.sub(r"^export (?=const|function|class|async)", "", joined, flags=re.M)
    return f"(() => {{\n{joined}\n}})();\n"


def _page() -> str:
    page = _text("index.html").replace('"page/', '"').replace(' type="module"', " defer")
    page = page.replace('src="main.js"', 'src="page.js"')
    return page.replace(
        '<script src="page.js"',
        '<meta name="session" content="session.js">\n<script src="session.js" defer></script>\n'
        '<script src="page.js"',
    )


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
    if health["status"] == "undecided":
        return "grey", "Undecided: this unit was never seen healthy"
    if not health["faults"]:
        return "red", health["status"].replace("_", " ")
    fault = health["faults"][0]
    middle, low, high = severity_texts(fault["severity"], tuple(fault["interval"]), fault["unit"])
    return "red", (
        f"Faulty: {fault['kind']} at the {fault['place']}, {middle} ({low} to {high}), "
        f"p {fault['probability']:.2f}"
    )
