"""Every shipped actuator and a short run of it in which things move: what the contract suite is
run over.
"""

from __future__ import annotations

import tomllib
from importlib import resources
from typing import Any

import elevon
from elevon import _core


def shipped() -> dict[str, str]:
    """Wiring of every shipped parameter set by its name, from the package's own folder."""
    folder = resources.files("elevon.parameters") / "sets"
    files = [entry for entry in folder.iterdir() if entry.name.endswith(".toml")]
    return {
        entry.name.removesuffix(".toml"): tomllib.loads(entry.read_text(encoding="utf-8"))["wiring"]
        for entry in sorted(files, key=lambda entry: entry.name)
    }


def names() -> list[str]:
    """Shipped sets whose wiring the core has; `test_every_shipped_set_loads` reports the others."""
    known = {wiring["name"] for wiring in _core.wirings()}
    return [name for name, wiring in shipped().items() if wiring in known]


def fidelities(name: str) -> list[str]:
    """Fidelities of the wiring behind a set."""
    wiring = elevon.Actuator.load(name).wiring
    return next(list(w["fidelities"]) for w in _core.wirings() if w["name"] == wiring)


def signals(name: str, fidelity: str) -> list[str]:
    """Signal names of a set in a fidelity."""
    return [record["name"] for record in _core.signals(elevon.Actuator.load(name).wiring, fidelity)]


def places(name: str) -> list[tuple[str, str, dict[str, Any]]]:
    """Kind, place and catalogue record of every fault that an actuator can have."""
    records = _core.faults(elevon.Actuator.load(name).wiring)
    return [(record["kind"], place, record) for record in records for place in record["places"]]


def scenario(fault: dict[str, Any] | None = None, duration: float = 0.12) -> Any:
    """A position swing, 0.03 in SI at 4 Hz, that takes up any play, with a fault if given."""
    data: dict[str, Any] = {
        "duration": duration,
        "command": {
            "mode": "position",
            "terms": [{"kind": "sine", "amplitude": 0.03, "frequency": "4 Hz"}],
        },
    }
    return elevon.Scenario.from_dict({**data, "fault": [fault]} if fault else data)
