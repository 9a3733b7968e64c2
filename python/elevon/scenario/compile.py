"""A scenario and an actuator's wiring become what crosses the seam: SI numbers in fixed order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from elevon.errors import InputError, unknown
from elevon.faults import check_together
from elevon.scenario.scenario import Scenario, Term
from elevon.scenario.waveforms import TABLE, check_values, unit_of, wave_records
from elevon.units import check_kind, parse_quantity, to_si

__all__ = ["CompiledScenario", "compile_scenario", "signal_records", "signal_units"]


@dataclass(frozen=True)
class CompiledScenario:
    """The parts of a run that come from the scenario, as `_core.simulate` takes them.

    Attributes
    ----------
    inputs : mapping
        Port to list of terms.
    command_mode, command_unit : str
        position, speed or torque, and the SI unit of the command.
    faults : list of dict
        Resolved faults, SI.
    initial : mapping
        Signal name to SI value.
    duration : float
        s.
    """

    inputs: Mapping[str, list[dict[str, Any]]]
    command_mode: str
    command_unit: str
    faults: list[dict[str, Any]]
    initial: Mapping[str, float]
    duration: float


@lru_cache(maxsize=32)
def signal_records(wiring: str, fidelity: str) -> Mapping[str, Mapping[str, str]]:
    """Return the core's records of every recordable signal, by name, in the core's order."""
    from elevon import _core

    return {item["name"]: item for item in _core.signals(wiring, fidelity)}


def signal_units(wiring: str, fidelity: str) -> Mapping[str, str]:
    """Return the unit of every recordable signal, by name, in the core's order."""
    return {name: item["unit"] for name, item in signal_records(wiring, fidelity).items()}


def compile_scenario(scenario: Scenario, wiring: str, fidelity: str) -> CompiledScenario:
    """Resolve a scenario for one wiring and fidelity.

    Parameters
    ----------
    scenario : Scenario
        As read.
    wiring, fidelity : str
        Whose signals, faults and units apply.

    Returns
    -------
    CompiledScenario
        SI values in the core's order.

    Raises
    ------
    InputError
        A unit of the wrong kind, an unknown signal, a fault the actuator cannot have, ...; the
        message names the place in the scenario.
    """
    units = _port_units(scenario, wiring)
    inputs = {
        port: [
            _term(term, units[port], f"{place}.terms[{index}]") for index, term in enumerate(terms)
        ]
        for port, place, terms in _ports(scenario)
    }
    check_together(scenario.fault)
    faults = [
        fault.resolved(wiring, fidelity, f"fault[{index}]")
        for index, fault in enumerate(scenario.fault)
    ]
    return CompiledScenario(
        inputs=inputs,
        command_mode=scenario.command.mode,
        command_unit=units["command"],
        faults=faults,
        initial=_initial(scenario, wiring, fidelity),
        duration=scenario.seconds,
    )


def _ports(scenario: Scenario) -> Iterator[tuple[str, str, tuple[Term, ...]]]:
    yield "command", "command", scenario.command.terms
    yield "brake", "load.brake", scenario.loads.brake.terms
    yield "shaft", "load.shaft", scenario.loads.shaft.terms
    yield "user", "load.user", scenario.loads.user.terms
    yield "supply", "supply", scenario.supply.terms


def _port_units(scenario: Scenario, wiring: str) -> dict[str, str]:
    """Return the unit of every port; that of the command goes with its mode."""
    from elevon import _core

    units = {port["name"]: port["unit"] for port in _core.ports(wiring)}
    command = {"position": units["command"], "speed": "rad/s", "torque": "N m"}
    return {**units, "command": command[scenario.command.mode]}


def _term(term: Term, own: str, place: str) -> dict[str, Any]:
    record = wave_records()[term.kind]
    values: dict[str, float] = {}
    for parameter in record.parameters:
        given = term.arguments.get(parameter.name)
        if given is None:
            assert parameter.default is not None  # the model checked that it is given
            values[parameter.name] = float(parameter.default)
        else:
            unit = unit_of(parameter, own) or "1"
            values[parameter.name] = _value(given, parameter.name, unit, place)
    check_values(record, values, place)
    return {
        "kind": term.kind,
        "enabled": term.enabled,
        "parameters": list(values.values()),
        **_table(term, own, place),
    }


def _value(given: bool | float | str, name: str, unit: str, place: str) -> float:
    if isinstance(given, bool):
        if name != "repeat":
            raise InputError(f"{place}: {name} = {str(given).lower()} is not a number")
        return float(given)
    return parse_quantity(given, unit, f"{place}: {name}")


def _table(term: Term, own: str, place: str) -> dict[str, Any]:
    if term.kind != TABLE:
        return {"times": (), "values": ()}
    times, values = term.points()
    check_kind(term.unit or own, own, f"{place}: unit")
    check_kind(term.time_unit, "s", f"{place}: time_unit")
    return {"times": to_si(times, term.time_unit), "values": to_si(values, term.unit or own)}


def _initial(scenario: Scenario, wiring: str, fidelity: str) -> dict[str, float]:
    from elevon import _core

    units = signal_units(wiring, fidelity)
    settable = _core.initial(wiring, fidelity)
    read = {}
    for name, given in scenario.initial.items():
        if name in units and name not in settable:
            raise InputError(
                f"initial: {name!r} follows from the others and cannot be set; "
                f"can be set: {', '.join(settable)}"
            )
        if name not in settable:
            raise unknown("signal", name, settable, "initial")
        read[name] = parse_quantity(given, units[name] or "1", f"initial.{name}")
    return read
