"""Every shipped actuator and a short run of it in which things move: what the contract suite is
run over.
"""

from __future__ import annotations

import copy
import tomllib
from functools import cache
from importlib import resources
from typing import Any

import elevon
from elevon import _core


def shipped() -> dict[str, str | None]:
    """Wiring of every shipped actuator file by its name of the package; None: its base's."""
    folder = resources.files("elevon") / "actuators"
    files = [entry for entry in folder.iterdir() if entry.name.endswith(".toml")]
    return {
        entry.name.removesuffix(".toml"): tomllib.loads(entry.read_text(encoding="utf-8")).get(
            "wiring"
        )
        for entry in sorted(files, key=lambda entry: entry.name)
    }


@cache
def actuator(name: str) -> Any:
    """A shipped actuator, read once."""
    return elevon.Actuator.load(name)


def names() -> list[str]:
    """Shipped actuator files whose wiring the core has; `test_every_shipped_set_loads` reports the
    others.

    A set on a base has other numbers in the same wiring: what the suite asks of it, it asks of
    the base.
    """
    known = {wiring["name"] for wiring in _core.wirings()}
    return [name for name, wiring in shipped().items() if wiring in known]


def fidelities(name: str) -> list[str]:
    """Fidelities of the wiring behind an actuator file."""
    wiring = actuator(name).wiring
    return next(list(w["fidelities"]) for w in _core.wirings() if w["name"] == wiring)


def signals(name: str, fidelity: str) -> list[str]:
    """Signal names of an actuator file in a fidelity."""
    return [record["name"] for record in _core.signals(actuator(name).wiring, fidelity)]


def places(name: str) -> list[tuple[str, str, dict[str, Any]]]:
    """Kind, place and catalogue record of every fault that an actuator can have."""
    records = _core.faults(actuator(name).wiring)
    return [(record["kind"], place, record) for record in records for place in record["places"]]


def takes_actions(name: str) -> bool:
    """Is the actuator commanded by actions (a gear), not by waveforms?"""
    wiring = actuator(name).wiring
    return any("gear" in w["modes"] for w in _core.wirings() if w["name"] == wiring)


def scenario(name: str, fault: dict[str, Any] | None = None) -> Any:
    """The short run of `motion`, with a fault if given."""
    return elevon.Scenario.from_dict({**motion(name), **({"fault": [fault]} if fault else {})})


def motion(name: str) -> dict[str, Any]:
    """A short run in which everything moves, as data.

    A position swing, 0.03 in SI at 4 Hz, that takes up any backlash; a gear retracts from its
    down-lock and extends into it again.
    """
    data: dict[str, Any] = {
        "duration": 0.12,
        "command": {
            "mode": "position",
            "terms": [{"kind": "sine", "amplitude": 0.03, "frequency": "4 Hz"}],
        },
    }
    if takes_actions(name):
        # A short stroke back, out and down: every switch, the lock and the release change;
        # weight on wheels for a moment of the way out.
        data = {
            "duration": "2.5 s",
            "command": {
                "mode": "gear",
                "steps": [
                    step(0.01, "retract"),
                    step(1.1, "extend"),
                    step(1.6, "stop"),
                    step(1.7, "free_fall"),
                ],
            },
            "initial": {"nut_position": "13 mm"},
            "load": {"weight_on_wheels": {"terms": [ON_WHEELS]}},
            "parameters": {
                "lever.stroke": "10 mm",
                "proximity.position_25": "3 mm",
                "proximity.position_75": "7 mm",
            },
        }
    return copy.deepcopy(data)


#: On between 1.2 and 1.4 s.
ON_WHEELS = {
    "kind": "table",
    "times": [0.0, 1.2, 1.2001, 1.4, 1.4001, 10.0],
    "values": [0.0, 0.0, 1.0, 1.0, 0.0, 0.0],
}


def default(name: str, supply: float) -> dict[str, Any]:
    """What a set does by default, its supply so many times as high; actions end in a stop."""
    chosen = actuator(name)
    data = copy.deepcopy(dict(chosen.default_scenario or onwards(name)))
    if takes_actions(name):
        data["command"]["steps"].append(step(1.6, "stop"))
        data["duration"] = "3 s"
    volts = supply * chosen.parameters.value("inverter.supply_voltage")
    return {**data, "supply": {"terms": [{"kind": "constant", "value": volts}]}}


def step(time: float, action: str) -> dict[str, Any]:
    """One action of a sequence."""
    return {"time": time, "action": action}


def standstill(name: str) -> Any:
    """Nothing asked, nothing on the shaft."""
    command = {} if takes_actions(name) else {"mode": "speed", "terms": []}
    return elevon.Scenario.from_dict({"duration": "0.1 s", "command": command})


def forward(name: str) -> Any:
    """The run of `onwards`."""
    return elevon.Scenario.from_dict(onwards(name))


def onwards(name: str) -> dict[str, Any]:
    """A command in the positive direction, as data."""
    command: dict[str, Any] = {"mode": "speed", "terms": [{"kind": "constant", "value": 30.0}]}
    if takes_actions(name):
        command = {"mode": "gear", "steps": [step(0.01, "extend")]}
    return {"duration": "0.5 s", "command": command}
