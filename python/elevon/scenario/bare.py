"""Numbers without a unit in files: refused where a person reads the place in another unit.

In Python a number is SI; in a file ``amplitude = 7`` could be degrees or radians.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any

from elevon.documents import Document
from elevon.errors import UnitError
from elevon.units import ambiguous, display_unit, is_ambiguous
from elevon.waveforms import TABLE, unit_of, wave_records

_SPEED = {"rig_speed": "m/s"}
_OF_MODE = {"position": ("rad", "m"), "speed": ("rad/s",), "torque": ("N m",)}
Finding = tuple[tuple[str | int, ...], Any, tuple[str, ...], tuple[str, ...]]


def check_units(document: Document) -> None:
    """Refuse numbers without a unit that could mean two things, all of them at once.

    Parameters
    ----------
    document : Document
        A scenario file, or a note with the scenario's ``[command]``.

    Raises
    ------
    UnitError
        With the place and both readings of each.
    """
    findings: list[str] = []
    for location, number, units, display_units in _numbers(document.data):
        pairs = [
            (unit, other)
            for unit, other in zip(units, display_units, strict=True)
            if abs(number) < 1e300 and is_ambiguous(float(number), unit, other)
        ]
        if pairs:
            text = str(ambiguous(str(number), *pairs[0], document.place(location)))
            linear = "".join(f"; linear: '{number} {b}' or '{number} {a}'" for a, b in pairs[1:])
            findings.append(text + linear)
    if findings:
        raise UnitError("\n".join(findings))


def with_texts(given: Any) -> Any:
    """Return a file's parameters with numbers as texts: the actuator knows which need a unit."""
    if isinstance(given, dict):
        return {key: with_texts(item) for key, item in given.items()}
    return repr(given) if _is_number(given) else given


def _numbers(data: Mapping[str, Any]) -> Iterator[Finding]:
    """Yield place, number, its possible units in SI and the units a person reads."""
    command = data.get("command")
    if isinstance(command, Mapping):
        mode = command.get("mode", "position")
        yield from _of_terms(command, ("command",), _OF_MODE.get(str(mode), ()))
    loads = data.get("load")
    for name, load in loads.items() if isinstance(loads, Mapping) else ():
        if isinstance(load, Mapping) and name in _SPEED:
            yield from _of_terms(load, ("load", name), (_SPEED[name],))
        elif isinstance(load, Mapping):
            yield from _of_terms(load, ("load", name), ("N",))
    for port, unit in (("supply", "V"), ("ambient", "K")):
        if isinstance(data.get(port), Mapping):
            yield from _of_terms(data[port], (port,), (unit,))
    initial = data.get("initial")
    for name, value in initial.items() if isinstance(initial, Mapping) else ():
        units = tuple(unit for unit in _initial_units().get(str(name), ()) if unit)
        if _is_number(value):
            yield ("initial", name), value, units, tuple(display_unit(unit) for unit in units)


def _of_terms(
    sum_: Mapping[str, Any], place: tuple[str | int, ...], port_units: tuple[str, ...]
) -> Iterator[Finding]:
    terms = sum_.get("terms")
    for index, term in enumerate(terms if isinstance(terms, list) else ()):
        record = wave_records().get(str(term.get("kind"))) if isinstance(term, Mapping) else None
        if record is None:
            continue
        at = (*place, "terms", index)
        for parameter in record.parameters:
            value = term.get(parameter.name)
            if _is_number(value):
                units = tuple(unit_of(parameter, unit) or "1" for unit in port_units) or ("1",)
                display_units = tuple(
                    unit_of(parameter, display_unit(unit)) or "1" for unit in port_units
                ) or ("1",)
                if parameter.unit == "rad":
                    display_units = ("deg",) * len(units)
                yield (*at, parameter.name), value, units, display_units
        if record.kind == TABLE and not term.get("unit"):
            yield from _of_table(term, at, port_units)


def _of_table(
    term: Mapping[str, Any], at: tuple[str | int, ...], port_units: tuple[str, ...]
) -> Iterator[Finding]:
    """Yield the first value of a table that is not zero: its unit is missing."""
    values = term.get("values")
    for value in values if isinstance(values, list) else ():
        if _is_number(value) and value:
            yield (
                (*at, "values"),
                value,
                port_units,
                tuple(display_unit(unit) for unit in port_units),
            )
            return


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


@lru_cache(maxsize=1)
def _initial_units() -> Mapping[str, tuple[str, ...]]:
    """Return the units that each signal has in any wiring."""
    from elevon import _core

    units: dict[str, dict[str, None]] = {}
    for wiring in _core.wirings():
        for fidelity in wiring["fidelities"]:
            for signal in _core.signals(wiring["name"], fidelity):
                units.setdefault(signal["name"], {})[signal["unit"]] = None
    return {name: tuple(each) for name, each in units.items()}
