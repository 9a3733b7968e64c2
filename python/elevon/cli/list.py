"""``elevon list``: what there is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from elevon.cli.acting import by_drive, check, chosen
from elevon.cli.groups import group
from elevon.cli.output import print_table
from elevon.cli.shell import Answer, command
from elevon.plain import fields_of

if TYPE_CHECKING:
    from elevon.faults import FaultRecord

app = group("List what there is, with units and sources.")


@command(app)
def actuators() -> Answer:
    """List the actuators that can be named: the shipped ones and those in ELEVON_ACTUATORS."""
    from elevon.documents import read_toml
    from elevon.parameters.load import set_paths

    rows = []
    for name, path in sorted(set_paths().items()):
        head = read_toml(path).data
        rows.append({"name": name, "title": head.get("title", ""), "file": str(path)})
    return _answer("actuators", rows, ("name", "title"))


@command(app)
def procedures(
    *,
    actuator: str | None = None,
) -> Answer:
    """List the virtual bench's procedures, with the stand each is written for."""
    from elevon.actuator import Actuator
    from elevon.bench.procedure import load_procedure, procedure_names
    from elevon.bench.stand import stand_of

    stand = None if actuator is None else stand_of(Actuator.load(actuator).wiring).name
    read = [load_procedure(name) for name in procedure_names(stand)]
    rows = [
        {"name": p.name, "stand": p.stand, "text": p.text, "logs": [t.name for t in p.traces]}
        for p in read
    ]
    return _answer("procedures", rows, ("name", "stand", "text"))


@command(app)
def signals(
    actuator: str,
    *,
    fidelity: str = "high",
) -> Answer:
    """List the signals of an actuator that can be recorded."""
    from elevon import _core
    from elevon.actuator import Actuator
    from elevon.simulate import check_fidelity

    wiring = Actuator.load(actuator).wiring
    check_fidelity(wiring, fidelity)
    rows = [dict(item) for item in _core.signals(wiring, fidelity)]
    return _answer("signals", rows, ("name", "unit", "text"))


@command(app)
def parameters(
    actuator: str,
    *,
    fidelity: str | None = None,
    not_modelled: bool = False,
) -> Answer:
    """List the parameters an actuator's model has: unit, range, meaning, where each acts."""
    from elevon.actuator import Actuator
    from elevon.parameters import records

    wiring = Actuator.load(actuator).wiring
    check(fidelity, [wiring])
    rows = [
        fields_of(
            record,
            "path",
            "symbol",
            "unit",
            "register",
            "fidelities",
            "not_modelled",
            "when",
            "text",
            range="range_text",
            acts="acts_text",
        )
        | {"default": record.default_value()}
        for record in records(wiring).values()
        if chosen(record, fidelity, not_modelled)
    ]
    return _answer("parameters", rows, ("path", "unit", "range", "text", "acts"))


@command(app)
def faults(
    actuator: str | None = None,
    *,
    fidelity: str | None = None,
    not_modelled: bool = False,
) -> Answer:
    """List the fault catalogue: kind, places, unit, range, where each acts, effect, source, rate.

    The rate is in failures an hour at one place.

    With an actuator: only what acts in it, in its own ranges, with the drives under which it acts
    at each fidelity.
    """
    rows = [row for row in _faults(actuator, fidelity) if chosen(row[1], fidelity, not_modelled)]
    listed = [
        {"wiring": wiring}
        | fields_of(
            record, "kind", "places", "unit", "attributes", "fidelities", "not_modelled", "effect",
            "source", "rate", "rate_source", range="range_text",
        )
        | acts
        for wiring, record, acts in rows
    ]  # fmt: skip
    first, where = (("wiring",), "fidelities") if actuator is None else ((), "acts")
    columns = ("kind", "places", "unit", "range", where, "effect", "source", "rate", "rate_source",
               "not_modelled")  # fmt: skip
    spare = ("rate_source", "source", "rate", *(() if not_modelled else ("not_modelled", where)))
    return _answer("faults", listed, (*first, *columns), spare)


def _faults(
    reference: str | None, fidelity: str | None
) -> list[tuple[str, FaultRecord, dict[str, Any]]]:
    """Return wiring, record and what is known of its drives."""
    from elevon.actuator import Actuator
    from elevon.faults import catalogue
    from elevon.parameters.records import wiring_names
    from elevon.simulate.acting import own_faults

    if reference is None:
        names = wiring_names()
        check(fidelity, names)
        return [(wiring, record, {}) for wiring in names for record in catalogue(wiring)]
    actuator = Actuator.load(reference)
    check(fidelity, [actuator.wiring])
    return [(actuator.wiring, it, by_drive(actuator, it)) for it in own_faults(actuator)]


@command(app)
def laws(
    actuator: str | None = None,
) -> Answer:
    """List the laws by which faults grow with use: fault, unit, what drives them, source."""
    from elevon.actuator import Actuator
    from elevon.prognose.law import LAWS, laws_of

    known = LAWS if actuator is None else laws_of(Actuator.load(actuator).wiring)
    rows = [
        fields_of(law, "unit", "drivers", "text", "source", law="name", fault="key")
        | {"coefficients": {n: f"{c.value:g} {c.unit}" for n, c in law.coefficients.items()}}
        for law in known.values()
    ]
    return _answer("laws", rows, ("law", "fault", "unit", "drivers", "text"))


@command(app)
def waveforms() -> Answer:
    """List the waveforms of commands and loads with their parameters (* = must be given)."""
    from elevon.waveforms import wave_records

    rows = [fields_of(record, "kind", "text", "parameters") for record in wave_records().values()]

    def show() -> None:
        cells = [
            (row["kind"], ", ".join(_needed(p) for p in row["parameters"]), row["text"])
            for row in rows
        ]
        print_table(("kind", "parameters", "text"), cells)

    return Answer({"waveforms": rows}, show)


@command(app)
def features(
    actuator: str | None = None,
    *,
    fidelity: str = "high",
) -> Answer:
    """List the features of a motion: unit, roles they need, definition.

    With an actuator: only those it has, with their units and the signals that serve.
    """
    from elevon.features import feature_records

    if actuator is not None:
        rows = _own_features(actuator, fidelity)
    else:
        rows = [
            fields_of(record, "name", "unit", "family", "roles", "minimum_rate", "text")
            for record in feature_records().values()
        ]
    last = "roles" if actuator is None else "signals"
    return _answer("features", rows, ("name", "unit", "family", last, "text"))


def _own_features(reference: str, fidelity: str) -> list[dict[str, Any]]:
    from elevon.actuator import Actuator
    from elevon.features import assign_roles, comparable, feature_records
    from elevon.scenario.compile import signal_records, signal_units
    from elevon.simulate import check_fidelity

    wiring = Actuator.load(reference).wiring
    check_fidelity(wiring, fidelity)
    units = {name: unit or "1" for name, unit in signal_units(wiring, fidelity).items()}
    records = signal_records(wiring, fidelity)
    stated = {item["role"]: name for name, item in records.items() if item["role"]}
    roles = comparable(assign_roles(units, stated=stated), units)
    by_role = {role: units[name] for role, name in roles.items()}
    return [
        fields_of(record, "name", "family", "minimum_rate", "text")
        | {"unit": record.unit_of(by_role), "signals": [roles[role] for role in record.roles]}
        for record in feature_records().values()
        if roles.keys() >= set(record.roles)
    ]


def _needed(parameter: dict[str, Any]) -> str:
    return f"{parameter['name']}*" if parameter["default"] is None else str(parameter["name"])


def _answer(
    what: str,
    rows: list[dict[str, Any]],
    columns: tuple[str, ...],
    optional: tuple[str, ...] = ("acts",),
) -> Answer:
    cells = [[_cell(row[column]) for column in columns] for row in rows]
    return Answer({what: rows}, lambda: print_table(columns, cells, optional=optional))


def _cell(value: Any) -> str:
    if isinstance(value, dict):
        return "; ".join(f"not {name}: {reason}" for name, reason in value.items())
    return " ".join(value) if isinstance(value, list) else str(value)
