"""What the core says about itself must be complete and usable, for every wiring it has."""

from __future__ import annotations

import math
import re
from typing import Any, get_args

import pytest

from elevon import _core

WIRINGS = [(w["name"], fidelity) for w in _core.wirings() for fidelity in w["fidelities"]]
IDENTIFIER = re.compile(r"[a-z][a-z0-9_]{0,30}")
PATH = re.compile(r"[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)+")


def unique(names: list[str]) -> None:
    """No name twice, and none distinguished by case alone."""
    assert len({name.lower() for name in names}) == len(names)


@pytest.mark.parametrize("wiring", sorted({w for w, _ in WIRINGS}))
def test_every_parameter_is_described(wiring: str) -> None:
    """Path, range and text; a default inside its own range."""
    records = _core.parameters(wiring)
    unique([r["path"] for r in records])
    for record in records:
        assert PATH.fullmatch(record["path"]), record["path"]
        assert record["text"], record["path"]
        assert record["register"] in {"plant", "controller", "sensor", "solver", "load"}, record[
            "path"
        ]
        assert record["minimum"] <= record["maximum"], record["path"]
        default = record["default"]
        if default is not None:
            assert record["minimum"] <= default <= record["maximum"], record["path"]
            assert not (record["minimum_open"] and default == record["minimum"]), record["path"]
        if record["choices"] is not None:
            unique(record["choices"])
            assert record["maximum"] == len(record["choices"]) - 1, record["path"]


@pytest.mark.parametrize(("wiring", "fidelity"), WIRINGS)
def test_every_signal_is_described(wiring: str, fidelity: str) -> None:
    """Names valid in Python, MATLAB and FMI: identifiers of at most 31 characters."""
    records = _core.signals(wiring, fidelity)
    unique([r["name"] for r in records])
    for record in records:
        assert IDENTIFIER.fullmatch(record["name"]), record["name"]
        assert record["text"], record["name"]


@pytest.mark.parametrize("wiring", sorted({w for w, _ in WIRINGS}))
def test_every_fault_is_described(wiring: str) -> None:
    """Kind, places, unit, range that holds zero, effect, source, and a rate with its own."""
    records = _core.faults(wiring)
    assert records
    unique([f"{r['kind']}@{place}" for r in records for place in r["places"]])
    for record in records:
        assert record["places"], record["kind"]
        assert record["effect"], record["kind"]
        assert record["source"], record["kind"]
        assert 0.0 < record["rate"] < 1e-4, record["kind"]
        assert record["rate_source"].startswith(("T3 Table 1.1", "ASSUMED")), record["kind"]
        assert record["minimum"] <= 0.0 <= record["maximum"], record["kind"]
        assert record["minimum"] < record["maximum"], record["kind"]
        assert record["switched"] == record["effect"].startswith("1: "), record["kind"]
        unique([a["name"] for a in record["attributes"]])
        assert record["fidelities"], record["kind"]


@pytest.mark.parametrize("catalogue", [_core.waveforms, _core.profiles])
def test_waveforms_and_profiles_are_described(catalogue: Any) -> None:
    """Kinds and parameters with text; finite defaults except the ends of time."""
    records = catalogue()
    unique([r["kind"] for r in records])
    for record in records:
        assert record["text"], record["kind"]
        unique([p["name"] for p in record["parameters"]])
        for parameter in record["parameters"]:
            assert parameter["text"], (record["kind"], parameter["name"])
            default = parameter["default"]
            assert default is None or not math.isnan(default)


def test_every_port_and_mode_of_the_core_has_its_place_in_a_scenario() -> None:
    """And a scenario has no place for anything else."""
    from elevon.scenario.scenario import Command, Load

    ports = {port["name"] for name in {w for w, _ in WIRINGS} for port in _core.ports(name)}
    assert ports == {"command", "supply", "ambient", *Load.model_fields}
    modes = {mode for wiring in _core.wirings() for mode in wiring["modes"]}
    assert modes == set(get_args(Command.model_fields["mode"].annotation))
    assert all(set(w["mode_units"]) == set(w["modes"]) for w in _core.wirings())
