"""Every shipped actuator and a short run of it in which things move: what the contract suite is
run over.
"""

from __future__ import annotations

from importlib import resources
from typing import Any

import elevon
from elevon import _core


def names() -> list[str]:
    """Names of the shipped parameter sets, from the package's own folder."""
    folder = resources.files("elevon.parameters") / "sets"
    return sorted(
        entry.name.removesuffix(".toml")
        for entry in folder.iterdir()
        if entry.name.endswith(".toml")
    )


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


def scenario(fault: dict[str, Any] | None = None, duration: float = 0.02) -> Any:
    """A torque command that shakes any actuator both ways, with a fault if given."""
    data: dict[str, Any] = {
        "duration": f"{duration!r} s",
        "command": {
            "mode": "speed",
            "terms": [{"kind": "sine", "amplitude": 30.0, "frequency": "60 Hz"}],
        },
    }
    return elevon.Scenario.from_dict({**data, "fault": [fault]} if fault else data)
