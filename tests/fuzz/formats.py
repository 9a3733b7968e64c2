"""The formats of our own: a valid document of each, how a case is written, and who reads it."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzz.mutate import Raw, changed, spoiled, to_json, to_toml

__all__ = ["FORMATS", "Format"]

_EXAMPLES = Path(__file__).parents[2] / "examples"
_RECORD = "encoder_position,resolver_position,speed_ref,motor_speed,current_ref,current_q_meas"


@dataclass(frozen=True)
class Format:
    """A format: `write` puts a changed file into a folder, `read` does what its commands do."""

    write: Callable[[Path, np.random.Generator], Path]
    read: Callable[[Path], object]


def _example(name: str) -> dict[str, Any]:
    return tomllib.loads((_EXAMPLES / name).read_text("utf-8"))


def _written(path: Path, text: str, rng: np.random.Generator) -> Path:
    path.write_bytes(spoiled(text, rng))
    return path


def _toml_writer(
    name: str, *documents: dict[str, Any]
) -> Callable[[Path, np.random.Generator], Path]:
    def write(folder: Path, rng: np.random.Generator) -> Path:
        document = documents[int(rng.integers(len(documents)))]
        return _written(folder / name, to_toml(changed(document, rng)), rng)

    return write


# Plan, scenario, mission, actuator file

_DESIGN = {
    "name": "screening", "actuator": "torino-rotary", "fidelity": "low", "record": [],
    "features": ["torque_current_rms@400 Hz"],
    "scenario": {"duration": "0.2 s", "command": {"terms": [
        {"kind": "step", "initial": "0 deg", "final": "1 deg", "time": "0.1 s"}]}},
    "design": {"kind": "full_factorial", "factor": [
        {"parameter": "friction.dynamic", "values": ["0.2 N m", "0.4 N m"]},
        {"fault": "backlash@transmission", "values": [0, "0.1 deg"]},
    ]},
}  # fmt: skip
_RANDOM = {
    "name": "drawn", "actuator": "torino-rotary", "fidelity": "low", "seeds": [1, 2],
    "record": "motor_speed@400 Hz",
    "scenario": {"duration": "0.2 s"},
    "random": {"count": 8, "method": "sobol", "seed": 3, "draw": [
        {"parameter": "friction.dynamic", "from": "0.2 N m", "to": "0.4 N m"}]},
    "split": {"train": 0.5, "test": 0.5},
}  # fmt: skip


def _read_plan(path: Path) -> object:
    from elevon.campaign import load_plan, resolve_plan
    from elevon.campaign.check import check

    return check(resolve_plan(*load_plan(path)))


def _read_scenario(path: Path) -> object:
    from elevon.scenario import Scenario
    from elevon.simulate import Run
    from elevon.simulate.prepare import prepare

    scenario = Scenario.load(path)
    return prepare(Run(_unit(), scenario), "low", "motor_speed@100 Hz")


@cache
def _unit() -> Any:
    from elevon import Actuator

    return Actuator.load("torino-rotary")


def _read_mission(path: Path) -> object:
    from elevon.prognose import Mission

    mission = Mission.load(path)
    return mission.scenarios(known=_unit().parameters), mission.laws()


_CALIBRATED = {
    "name": "unit-7", "base": "torino-rotary", "title": "calibrated",
    "friction": {"dynamic": {
        "value": 0.31, "unit": "N m", "source": "calibrate: 2 logs", "confidence": "calibrated",
        "interval": [0.30, 0.32], "old": 0.3}},
    "backlash": {"total": {
        "value": 0.5, "unit": "deg", "source": "calibrate", "confidence": "calibrated"}},
    "references": [{"key": "a", "text": "b"}],
    "scenario": {"duration": "1 s"},
}  # fmt: skip


def _read_actuator(path: Path) -> object:
    from elevon import Actuator

    return Actuator.load(path)


# History and the diagnoses in it

_CAUSE = {
    "kind": "backlash", "place": "transmission", "probability": 0.9, "severity": 0.002,
    "unit": "rad", "interval": [0.001, 0.003],
    "ambiguous_with": [{"kind": "tooth_wear", "place": "gear"}],
}  # fmt: skip
_DIAGNOSIS = {
    "status": "faulty", "p_fault": 0.95, "false_alarm": 0.05, "faults": [_CAUSE],
    "best": {"faults": ["backlash@transmission"], "probability": 0.9},
    "hypotheses": [
        {"faults": [], "probability": 0.05},
        {"faults": [{k: _CAUSE[k] for k in ("kind", "place", "severity", "unit", "interval")}],
         "probability": 0.9},
    ],
    "unobservable": [{"kind": "sag", "place": "supply", "reason": "r"}],
    "detectable": {"backlash@transmission": 1e-4}, "findings": [], "logs": ["a.csv"],
}  # fmt: skip
_INSPECTION = {
    "usage": 1200.0, "unit": "flights", "date": "2026-01-02", "serial": "7", "reset": [],
    "measured": {"tracking error": {"value": 0.4, "deviation": 0.01}},
}  # fmt: skip


def _write_history(folder: Path, rng: np.random.Generator) -> Path:
    for k in range(2):
        document = {**_DIAGNOSIS, **_INSPECTION, "usage": 1200.0 * (k + 1)}
        document["date"] = f"2026-0{k + 1}-02"
        _written(folder / f"{k}.json", to_json(changed(document, rng) if k else document), rng)
    return folder


def _read_history(path: Path) -> object:
    from elevon.prognose import LAWS
    from elevon.prognose.history import read_history

    return read_history(path, unit="flights").inspections(
        [LAWS["gear_wear"]], {"tracking error": "rad"}
    )


def _write_result(folder: Path, rng: np.random.Generator) -> Path:
    return _written(folder / "result.json", to_json(changed(_DIAGNOSIS, rng)), rng)


def _read_result(path: Path) -> object:
    from elevon.nexttest.belief import Belief, read_result

    return Belief.after([read_result(path)])


# Command note

_NOTES = (
    {"waveform": "sine", "amplitude": "7 deg", "frequency": "0.2 Hz", "brake": "on",
     "load_cell_arm": "0.5 m", "chain_ratio": 2, "current": "rms"},
    {"command": {"mode": "position", "terms": [
        {"kind": "sine", "amplitude": "7 deg", "frequency": "0.2 Hz"},
        {"kind": "table", "times": [0, 1, 2], "values": [0, 1, 0], "unit": "deg"}]}},
)  # fmt: skip


def _write_note(folder: Path, rng: np.random.Generator) -> Path:
    document = changed(_NOTES[int(rng.integers(2))], rng)
    if rng.random() < 0.5:
        return _written(folder / "note.json", to_json(document), rng)
    return _written(folder / "note.toml", to_toml(document), rng)


def _read_note(path: Path) -> object:
    from elevon.logs.command.note import read_command_note

    return read_command_note(path)


# Logs: foreign columns, and a recording of our own with its description


@cache
def _recording() -> tuple[str, dict[str, Any]]:
    """Text and description of a short recording."""
    import tempfile

    from elevon.scenario import Scenario
    from elevon.simulate import simulate

    sine = {"kind": "sine", "amplitude": "7 deg", "frequency": "1 Hz"}
    scenario = Scenario.from_dict({"duration": 1.5, "command": {"terms": [sine]}})
    made = simulate(_unit(), scenario, fidelity="low", record=f"{_RECORD}@200 Hz")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.csv"
        made.save(path)
        about = next(p for p in Path(folder).iterdir() if p != path)
        return path.read_text("utf-8"), {"name": about.name, **json.loads(about.read_text("utf-8"))}


def _write_log(folder: Path, rng: np.random.Generator) -> Path:
    text, about = _recording()
    kind = int(rng.integers(3))
    if kind == 0:  # ours, its description changed
        about = dict(about)
        name = about.pop("name")
        (folder / "run.csv").write_text(text, encoding="utf-8")
        _written(folder / name, to_json(changed(about, rng)), rng)
        return folder / "run.csv"
    rows = [line.split(",") for line in text.splitlines()]
    if kind == 1:  # as of another program: names of roles, other units
        rows[0] = [
            "time [s]",
            "output_position [rad]",
            "motor_position [rad]",
            "speed_ref [rad/s]",
            "motor_speed [rad/s]",
            "current_ref",
            "torque_current [A]",
        ]
    rows = [row for row in changed(rows, rng) if isinstance(row, list)]
    cut = [";", "\t", ","][int(rng.integers(3))]
    lines = [cut.join(_cell(cell) for cell in row) for row in rows]
    return _written(folder / "log.csv", "\n".join(lines) + "\n", rng)


def _cell(cell: Any) -> str:
    return cell.text[:8000] if isinstance(cell, Raw) else str(cell)


def _read_log(path: Path) -> object:
    from elevon.logs.drive import drive_log
    from elevon.logs.read import read_log

    return drive_log(read_log(path))


# A data set's manifest


@cache
def _manifest() -> tuple[Path, dict[str, Any]]:
    import tempfile

    from elevon.campaign import load_plan, resolve_plan, run_campaign

    root = Path(tempfile.mkdtemp(prefix="fuzz-manifest-"))
    plan = root / "plan.toml"
    plan.write_text(to_toml({**_DESIGN, "record": "motor_speed@400 Hz"}), encoding="utf-8")
    read, document = load_plan(plan)
    run_campaign(resolve_plan(read, document), document.text, root / "set")
    return root / "set", json.loads((root / "set" / "manifest.json").read_text("utf-8"))


def _write_manifest(folder: Path, rng: np.random.Generator) -> Path:
    """Half of the manifests carry a checksum that fits: what is behind it must hold, too."""
    from elevon.campaign.store import seal

    source, content = _manifest()
    for item in source.iterdir():
        if item.name != "manifest.json":
            (folder / item.name).symlink_to(item)
    content = {k: v for k, v in content.items() if k != "check"}
    document = changed(content, rng)
    if rng.random() < 0.7:
        try:
            document["check"] = seal(json.loads(to_json(document)))
        except (ValueError, RecursionError):
            document["check"] = ""
    _written(folder / "manifest.json", to_json(document), rng)
    return folder


def _read_manifest(path: Path) -> object:
    from elevon.campaign import load_campaign

    data = load_campaign(path)
    tables = [data.runs, data.features, data.ends, *(data.clock(name) for name in data.clocks)]
    return [table.to_arrow() for table in tables if table is not None]


FORMATS: dict[str, Format] = {
    "plan": Format(_toml_writer("plan.toml", _example("campaign.toml"), _DESIGN, _RANDOM),
                   _read_plan),
    "scenario": Format(_toml_writer("scenario.toml", _example("sine_with_short.toml")),
                       _read_scenario),
    "mission": Format(_toml_writer("mission.toml", _example("mission.toml")), _read_mission),
    "calibration": Format(
        _toml_writer("unit.toml", _CALIBRATED, _example("own_actuator.toml")), _read_actuator),
    "history": Format(_write_history, _read_history),
    "result": Format(_write_result, _read_result),
    "note": Format(_write_note, _read_note),
    "log": Format(_write_log, _read_log),
    "manifest": Format(_write_manifest, _read_manifest),
}  # fmt: skip
