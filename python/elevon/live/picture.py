"""An animated picture of a recorded session: what the page shows, for where no page runs."""

from __future__ import annotations

import base64
import json
import re
import tempfile
from collections.abc import Mapping, Sequence
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
from elevon.report.mechanism import mechanism, moving_svg, trace
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
        *mechanism(drawn, gap, ratio, length),
        *trace(np.degrees(gap), length),
        *_strip(session["states"], float(at[0]), length),
    ]
    label = "The live bench: motor, gear, lever, backlash, and the diagnosis"
    return moving_svg([parts], label, height=330)


def _arrays(session: Mapping[str, Any]) -> tuple[Floats, dict[str, Floats]]:
    def read(text: str, kind: str) -> Floats:
        return np.frombuffer(base64.b64decode(text), dtype=kind).astype(np.float64)

    values = {name: read(text, "<f4") for name, text in session["values"].items()}
    return read(session["times"], "<f8"), values


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
