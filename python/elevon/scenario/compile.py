"""A scenario and an actuator's wiring become what crosses the seam: SI numbers in fixed order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError, unknown
from elevon.faults import check_together
from elevon.parameters.records import wirings
from elevon.scenario.scenario import Action, Scenario, Term, Terms
from elevon.seam import CoreFault, CoreTerm, Points, SignalRecord
from elevon.units import check_kind, parse_quantity, to_si
from elevon.waveforms import TABLE, check_repeated, check_values, unit_of, wave_records


@dataclass(frozen=True)
class CompiledScenario:
    """The parts of a run that come from the scenario, as `_core.simulate` takes them.

    Attributes
    ----------
    inputs : mapping
        Port to list of terms.
    command_mode, command_unit : str
        position, speed, torque or gear, and the SI unit of the command.
    faults : list of dict
        Resolved faults, SI.
    initial : mapping
        Signal name to SI value.
    duration : float
        s.
    """

    inputs: Mapping[str, list[CoreTerm]]
    command_mode: str
    command_unit: str
    faults: list[CoreFault]
    initial: Mapping[str, float]
    duration: float


@lru_cache(maxsize=32)
def signal_records(wiring: str, fidelity: str) -> Mapping[str, SignalRecord]:
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
    mode = _mode(scenario, wiring)
    units = port_units(mode, wiring)
    inputs = {
        port: [
            compile_term(term, units[port], f"{place}.terms[{index}]")
            for index, term in enumerate(terms)
        ]
        for port, place, terms in _ports(scenario, units)
    }
    if scenario.command.steps:
        inputs["command"] = [_sequence(scenario.command.steps, wiring)]
    check_together(scenario.fault)
    faults = [
        fault.resolved(wiring, fidelity, f"fault[{index}]")
        for index, fault in enumerate(scenario.fault)
    ]
    return CompiledScenario(
        inputs=inputs,
        command_mode=mode,
        command_unit=units["command"],
        faults=faults,
        initial=_initial(scenario, wiring, fidelity),
        duration=scenario.seconds,
    )


def _mode(scenario: Scenario, wiring: str) -> str:
    """Return what the command demands; when nothing is given, the first thing the wiring takes."""
    modes = wirings()[wiring]["modes"]
    command = scenario.command
    mode = command.mode if "mode" in command.model_fields_set else modes[0]
    if mode not in modes:
        raise InputError(f"command: the {wiring} wiring has no mode {mode!r}; {_listed(modes)}")
    return mode


def _listed(modes: list[str]) -> str:
    return f"mode{'s' if len(modes) > 1 else ''}: {', '.join(modes)}"


def _ports(
    scenario: Scenario, known: Mapping[str, str]
) -> Iterator[tuple[str, str, tuple[Term, ...]]]:
    """Yield every port with what drives it; a port the wiring lacks must not be driven."""
    ports: dict[str, tuple[str, Terms]] = {
        "command": ("command", scenario.command),
        "supply": ("supply", scenario.supply),
        "ambient": ("ambient", scenario.ambient),
    }
    for name in type(scenario.loads).model_fields:
        ports[name] = (f"load.{name}", getattr(scenario.loads, name))
    for port, (place, source) in ports.items():
        if port in known:
            yield port, place, source.terms
        elif source.terms:
            raise InputError(f"{place}: the actuator has no such input; {', '.join(known)}")


@lru_cache(maxsize=32)
def port_units(mode: str, wiring: str) -> Mapping[str, str]:
    """Return the unit of every port; that of the command goes with its mode."""
    from elevon import _core

    units = {port["name"]: port["unit"] for port in _core.ports(wiring)}
    return {**units, "command": wirings()[wiring]["mode_units"][mode]}


def _sequence(steps: Sequence[Action], wiring: str) -> CoreTerm:
    """Return a sequence of actions as a held table of their numbers."""
    actions = wirings()[wiring]["actions"]
    times, values = [0.0], [0.0]
    for index, step in enumerate(steps):
        place = f"command.steps[{index}]"
        time = parse_quantity(step.time, "s", f"{place}: time")
        if step.action not in actions:
            raise unknown("action", step.action, actions, place)
        if time < times[-1] or (time == times[-1] and index > 0):
            raise InputError(f"{place}: time = {time:g} s is not after {times[-1]:g} s")
        if time == 0.0:
            times, values = [], []
        times.append(time)
        number = float(actions.index(step.action))
        # The same action again would not be seen in a held value: it is a round higher.
        repeats = index > 0 and steps[index - 1].action == step.action
        values.append(number + len(actions) if repeats and values[-1] == number else number)
    record = wave_records()[TABLE]
    given = {**{p.name: p.default or 0.0 for p in record.parameters}, "hold": 1.0}
    return {
        "kind": TABLE,
        "enabled": True,
        "parameters": list(given.values()),
        "times": times,
        "values": values,
    }


def compile_term(term: Term, port_unit: str, place: str) -> CoreTerm:
    """Return one term in the core's form; `own` is the unit of the port it drives."""
    """Return one waveform as the core takes it, for a quantity in the SI unit `own`."""
    record = wave_records()[term.kind]
    values: dict[str, float] = {}
    arguments = term.arguments
    for parameter in record.parameters:
        given = arguments.get(parameter.name)
        if given is None:
            assert parameter.default is not None  # the model checked that it is given
            values[parameter.name] = float(parameter.default)
        else:
            unit = unit_of(parameter, port_unit) or "1"
            values[parameter.name] = _value(given, parameter.name, unit, place)
    check_values(record, values, place)
    times, points = _table(term, port_unit, place)
    if term.kind == TABLE and values["repeat"]:
        check_repeated(np.asarray(times), values["start"], place)
    return {
        "kind": term.kind,
        "enabled": term.enabled,
        "parameters": list(values.values()),
        "times": times,
        "values": points,
    }


def _value(given: bool | float | str, name: str, unit: str, place: str) -> float:
    if isinstance(given, bool):
        if name not in ("repeat", "hold"):
            raise InputError(f"{place}: {name} = {str(given).lower()} is not a number")
        return float(given)
    return parse_quantity(given, unit, f"{place}: {name}")


def _table(term: Term, port_unit: str, place: str) -> tuple[Points, Points]:
    if term.kind != TABLE:
        return (), ()
    times, values = term.points()
    given = "V" if term.standard is not None else term.unit
    check_kind(given or port_unit, port_unit, f"{place}: unit")
    check_kind(term.time_unit, "s", f"{place}: time_unit")
    return to_si(times, term.time_unit), to_si(values, given or port_unit)


def _initial(scenario: Scenario, wiring: str, fidelity: str) -> dict[str, float]:
    from elevon import _core

    if not scenario.initial:
        return {}
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


def evaluate_terms(
    terms: Sequence[Term], unit: str, time: npt.ArrayLike, place: str = "command"
) -> Floats:
    """Return a sum of waveforms as the core computes it.

    Parameters
    ----------
    terms : sequence of Term
        Disabled ones add nothing.
    unit : str
        SI unit of the quantity they drive.
    time : array_like, shape (n,)
        s.
    place : str
        For errors.

    Returns
    -------
    ndarray, shape (n,)
        In `unit`.

    Raises
    ------
    InputError
        A unit of the wrong kind, values that cannot be.
    """
    from elevon import _core

    at = np.ascontiguousarray(time, dtype=np.float64)
    total = np.zeros_like(at)
    for index, term in enumerate(terms):
        core = compile_term(term, unit, f"{place}.terms[{index}]")
        if not core["enabled"]:
            continue
        if term.kind == TABLE:
            total += _interpolated(
                np.asarray(core["times"]),
                np.asarray(core["values"]),
                at,
                hold=bool(term.arguments.get("hold")),
            )
        else:
            total += _core.waveform(term.kind, core["parameters"], at)
    return total


def _interpolated(times: Floats, values: Floats, at: Floats, *, hold: bool) -> Floats:
    """Straight lines between the points, or each value held; the ends are held."""
    if not hold:
        return np.interp(at, times, values)
    return np.asarray(values[np.maximum(np.searchsorted(times, at, "right") - 1, 0)])
