"""`elevon list`, `show`, `new` and `check`: the actuators there are, and files of one's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Protocol

from elevon.cli import common
from elevon.cli.groups import group
from elevon.cli.output import answer, print_table, say
from elevon.cli.shell import Answer, command
from elevon.errors import InputError
from elevon.files import write_text
from elevon.option import Option
from elevon.plain import fields_of, plain

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.faults import FaultRecord
    from elevon.parameters import Parameter
    from elevon.parameters.design.new import NewActuator
    from elevon.simulate.check import FileCheck

listing = group("List what there is, with units and sources.")

Row = dict[str, Any]
#: A number of a data sheet with its unit.
Number = Annotated[str | None, Option(metavar="QUANTITY")]
Text = Annotated[str | None, Option(metavar="TEXT")]


class Acting(Protocol):
    """A parameter's or a fault's record."""

    @property
    def fidelities(self) -> tuple[str, ...]:
        """Those that carry it."""
        ...

    @property
    def not_modelled(self) -> Mapping[str, str]:
        """Why the others do not."""
        ...


def _check_fidelity(fidelity: str | None, wirings: Sequence[str]) -> None:
    """Raise `UnknownNameError` for a fidelity that a wiring has not; None requests none."""
    from elevon.simulate import check_fidelity

    for wiring in wirings if fidelity is not None else ():
        check_fidelity(wiring, str(fidelity))


def _chosen(record: Acting, fidelity: str | None, not_modelled: bool) -> bool:
    """Whether `--fidelity` and `--not-modelled` leave a record in the list."""
    if not_modelled:
        return bool(record.not_modelled) if fidelity is None else fidelity in record.not_modelled
    return fidelity is None or fidelity in record.fidelities


@command(listing)
def actuators() -> Answer:
    """List the actuators that can be named: the shipped ones and those in ELEVON_ACTUATORS."""
    from elevon.actuator import actuators as known
    from elevon.parameters.load import set_paths

    files = set_paths()
    rows = [
        {"name": name, "title": title, "file": str(files[name])} for name, title in known().items()
    ]
    return _rows("actuators", rows, ("name", "title"))


@command(listing)
def procedures(*, actuator: str | None = None) -> Answer:
    """List the virtual bench's procedures, with the stand each is written for.

    Parameters
    ----------
    actuator : str
        Only those of the stand it stands on.
    """
    from elevon.actuator import Actuator
    from elevon.bench.procedure import load_procedure, procedure_names
    from elevon.bench.stand import stand_of

    stand = None if actuator is None else stand_of(Actuator.load(actuator).wiring).name
    read = [load_procedure(name) for name in procedure_names(stand)]
    rows = [fields_of(p, "name", "stand", "text") | {"logs": [t.name for t in p.traces]}
            for p in read]  # fmt: skip
    return _rows("procedures", rows, ("name", "stand", "text"))


@command(listing)
def signals(actuator: str, *, fidelity: str = "high") -> Answer:
    """List the signals of an actuator that can be recorded."""
    from elevon import _core
    from elevon.actuator import Actuator
    from elevon.simulate import check_fidelity

    wiring = Actuator.load(actuator).wiring
    check_fidelity(wiring, fidelity)
    rows = [dict(item) for item in _core.signals(wiring, fidelity)]
    return _rows("signals", rows, ("name", "unit", "text"))


@command(listing)
def parameters(actuator: str, *, fidelity: str | None = None, not_modelled: bool = False) -> Answer:
    """List the parameters an actuator's model has: unit, range, meaning, where each acts.

    Parameters
    ----------
    fidelity : str
        Only what acts at this fidelity: high or low.
    """
    from elevon.actuator import Actuator
    from elevon.parameters import records

    wiring = Actuator.load(actuator).wiring
    _check_fidelity(fidelity, [wiring])
    names = ("path", "symbol", "unit", "register", "fidelities", "not_modelled", "when", "text")
    rows = [
        fields_of(record, *names, range="range_text", acts="acts_text")
        | {"default": record.default_value()}
        for record in records(wiring).values()
        if _chosen(record, fidelity, not_modelled)
    ]
    return _rows("parameters", rows, ("path", "unit", "range", "text", "acts"))


@command(listing)
def faults(
    actuator: str | None = None, *, fidelity: str | None = None, not_modelled: bool = False
) -> Answer:
    """List the fault catalogue: kind, places, unit, range, where each acts, effect, source, rate.

    The rate is in failures an hour of the part in all of its modes.

    With an actuator: only what acts in it, in its own ranges, with the drives under which it acts
    at each fidelity.

    Parameters
    ----------
    actuator : str
        Only what this actuator has.
    fidelity : str
        Only what acts at this fidelity: high or low.
    """
    rows = [
        {"wiring": wiring}
        | fields_of(
            record, "kind", "places", "unit", "attributes", "fidelities", "not_modelled", "effect",
            "source", "rate", "rate_source", range="range_text",
        )
        | acts
        for wiring, record, acts in _faults(actuator, fidelity)
        if _chosen(record, fidelity, not_modelled)
    ]  # fmt: skip
    first, where = (("wiring",), "fidelities") if actuator is None else ((), "acts")
    columns = ("kind", "places", "unit", "range", where, "effect", "source", "rate", "rate_source",
               "not_modelled")  # fmt: skip
    spare = ("rate_source", "source", "rate", *(() if not_modelled else ("not_modelled", where)))
    return _rows("faults", rows, (*first, *columns), spare, fitted=True)


def _faults(reference: str | None, fidelity: str | None) -> list[tuple[str, FaultRecord, Row]]:
    """Return wiring, record and what is known of its drives."""
    from elevon.actuator import Actuator
    from elevon.faults import catalogue
    from elevon.parameters.records import wiring_names
    from elevon.simulate.acting import by_drive, own_faults

    if reference is None:
        names = wiring_names()
        _check_fidelity(fidelity, names)
        return [(wiring, record, {}) for wiring in names for record in catalogue(wiring)]
    actuator = Actuator.load(reference)
    _check_fidelity(fidelity, [actuator.wiring])
    return [(actuator.wiring, it, by_drive(actuator, it)) for it in own_faults(actuator)]


@command(listing)
def laws(actuator: str | None = None) -> Answer:
    """List the laws by which faults grow with use: fault, unit, what drives them, source.

    Parameters
    ----------
    actuator : str
        Only what this actuator has.
    """
    from elevon.actuator import Actuator
    from elevon.prognose.law import LAWS, laws_of

    known = LAWS if actuator is None else laws_of(Actuator.load(actuator).wiring)
    rows = [
        fields_of(law, "unit", "drivers", "text", "source", law="name", fault="key")
        | {"coefficients": {n: f"{c.value:g} {c.unit}" for n, c in law.coefficients.items()}}
        for law in known.values()
    ]
    return _rows("laws", rows, ("law", "fault", "unit", "drivers", "text"))


@command(listing)
def waveforms() -> Answer:
    """List the waveforms of commands and loads with their parameters (* = must be given)."""
    from elevon.waveforms import wave_records

    rows = [fields_of(record, "kind", "text", "parameters") for record in wave_records().values()]
    cells = [
        (row["kind"], ", ".join(f"{p['name']}{'*' if p['default'] is None else ''}"
                                for p in row["parameters"]), row["text"])
        for row in rows
    ]  # fmt: skip
    return Answer({"waveforms": rows}, lambda: print_table(("kind", "parameters", "text"), cells))


@command(listing)
def features(actuator: str | None = None, *, fidelity: str = "high") -> Answer:
    """List the features of a motion: unit, roles they need, definition.

    With an actuator: only those it has, with their units and the signals that serve.

    Parameters
    ----------
    actuator : str
        Only what this actuator has.
    """
    from elevon.features import feature_records

    names = ("name", "unit", "family", "roles", "minimum_rate", "text")
    if actuator is not None:
        rows = _own_features(actuator, fidelity)
    else:
        rows = [fields_of(record, *names) for record in feature_records().values()]
    last = "roles" if actuator is None else "signals"
    return _rows("features", rows, ("name", "unit", "family", last, "text"))


def _own_features(reference: str, fidelity: str) -> list[Row]:
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


def _rows(
    what: str,
    rows: list[Row],
    columns: Sequence[str],
    optional: Sequence[str] = ("acts",),
    *,
    fitted: bool = False,
) -> Answer:
    cells = [[_cell(row[column]) for column in columns] for row in rows]
    show = partial(print_table, columns, cells, optional=optional, fitted=fitted)
    return Answer({what: rows}, show)


def _cell(value: object) -> str:
    if isinstance(value, dict):
        return "; ".join(f"not {name}: {reason}" for name, reason in value.items())
    return " ".join(value) if isinstance(value, list) else str(value)


@command(None)
def show(
    actuator: str,
    *,
    settings: list[str] | None = None,
    svg: Path | None = None,
    schema: Path | None = None,
    changed: bool = False,
    notes: bool = False,
    fidelity: str | None = None,
    not_modelled: bool = False,
    force: bool = False,
) -> Answer:
    """Show an actuator: block diagram, parameters with units, sources, where they act; references.

    --fidelity and --not-modelled choose among the parameters.

    Parameters
    ----------
    svg : path
        Write the block diagram as SVG.
    schema : path
        Write the JSON Schema of its actuator files.
    changed : bool
        Only what is neither derived by a rule nor neutral: given or assumed.
    notes : bool
        Show the notes as well.
    fidelity : str
        Only what acts at this fidelity: high or low.
    """
    from json import dumps

    from elevon.diagram import diagram_svg
    from elevon.parameters import json_schema, load_set, records

    common.check_outputs([svg, schema], force=force)
    loaded = common.read_actuator(actuator, settings)
    _check_fidelity(fidelity, [loaded.wiring])
    known = records(loaded.wiring)
    listed = [
        p for p in loaded.parameters.values() if _chosen(known[p.path], fidelity, not_modelled)
    ]
    if changed:
        stated = load_set(actuator).stated
        listed = [p for p in listed if p.path in stated or p.confidence == "override"]
    if svg is not None:
        write_text(svg, diagram_svg(loaded.wiring), force=force)
        say(f"wrote {svg}")
    if schema is not None:
        text = dumps(plain(json_schema(loaded.wiring)), indent=2)
        write_text(schema, text + "\n", force=force)
        say(f"wrote {schema}")
    data = _actuator_data(loaded, listed) | {"svg": svg}
    print_these = _print_changed if changed else _print_actuator
    return Answer(data, lambda: print_these(loaded, listed, notes))


def _print_actuator(loaded: Actuator, listed: list[Parameter], notes: bool) -> None:
    from elevon.diagram import diagram_text, diagrams
    from elevon.parameters import records

    answer(f"{loaded.name}: {loaded.title}\n")
    if loaded.wiring in diagrams():
        answer(diagram_text(loaded.wiring) + "\n")
    known = records(loaded.wiring)
    rows = [
        [p.path, p.text, p.confidence, p.source, known[p.path].acts_text or "always", p.note]
        for p in listed
    ]
    columns = ["parameter", "value", "confidence", "source", "acts", "note"]
    width = len(columns) if notes else -1
    print_table(columns[:width], [row[:width] for row in rows], optional=("acts", "note"))
    if loaded.references:
        answer("", *(f"{key}: {text}" for key, text in loaded.references.items()))


def _print_changed(loaded: Actuator, listed: list[Parameter], notes: bool) -> None:
    answer(f"{loaded.name}: {loaded.title}")
    design = [item for item in loaded.design.values() if item.confidence != "derived"]
    rows = [[item.path, item.text, item.confidence, item.source] for item in design]
    rows += [[p.path, p.text, p.confidence, p.source] + ([p.note] if notes else []) for p in listed]
    if rows:
        print_table(["number", "value", "confidence", "source"] + (["note"] if notes else []), rows)
    else:
        answer("every value is derived by a rule or neutral")


def _actuator_data(loaded: Actuator, listed: list[Parameter]) -> Row:
    from elevon.parameters import records

    known = records(loaded.wiring)
    design = ("value", "text", "confidence", "source")
    stated = ("path", "value", "unit", "confidence", "source", "note", "old")
    acting = ("text", "fidelities", "not_modelled", "when")
    return fields_of(loaded, "name", "title", "wiring", "hash", "references", file="path") | {
        "design": {name: fields_of(item, *design) for name, item in loaded.design.items()},
        "parameters": [
            fields_of(p, *stated, shown="text") | fields_of(known[p.path], *acting, si_unit="unit")
            for p in listed
        ],
    }


@command(None)
def new(
    name: Annotated[str, Option(metavar="NAME")],
    *,
    linear: bool = False,
    rotary: bool = False,
    base: Annotated[str | None, Option("--from", "ACTUATOR", complete="actuators")] = None,
    supply: Number = None,
    power: Number = None,
    thrust: Number = None,
    torque: Number = None,
    speed: Number = None,
    motor_speed: Number = None,
    lead: Number = None,
    gear: Number = None,
    encoder: Number = None,
    efficiency: Number = None,
    stroke: Number = None,
    backlash: Number = None,
    mass: Number = None,
    inertia: Number = None,
    bandwidth: Number = None,
    motor: Annotated[list[str] | None, Option(metavar="KEY=QUANTITY")] = None,
    title: Text = None,
    source: Text = None,
    bench: Path | None = None,
    force: bool = False,
) -> Answer:
    """Write NAME.toml: an actuator from few numbers of a data sheet, or a variant of another.

    Parameters
    ----------
    name : str
        Of the actuator; its file is NAME.toml.
    linear : bool
        Its ram moves along a line.
    rotary : bool
        Its output turns.
    base : str
        A variant of this one, every parameter a comment; with numbers, of its design.
    supply : quantity
        Supply, such as 28V.
    power : quantity
        Rated power at the motor's shaft.
    thrust : quantity
        Rated force of the ram.
    torque : quantity
        Rated torque of the output.
    speed : quantity
        Rated speed of ram or output; ASSUMED from the motor's without.
    motor_speed : quantity
        Rated speed of the motor; ASSUMED 3000 rpm without.
    lead : quantity
        Travel per turn of the screw.
    gear : quantity
        Turns of the motor per turn behind the gear.
    encoder : quantity
        Counts per turn of the motor.
    efficiency : quantity
        Of gear and screw at the rating.
    stroke : quantity
        Whole travel, half of it to either side of zero.
    backlash : quantity
        Whole backlash at the output.
    mass : quantity
        What the ram moves.
    inertia : quantity
        What the output moves.
    bandwidth : quantity
        Of the position loop.
    motor : list of str
        A constant of the motor's data sheet; repeatable: kind (brushless, servo, dc),
        torque_constant, resistance, inductance (or inductance_d, inductance_q), inertia,
        pole_pairs, current, peak_current, iron_loss.
    title : str
        One line.
    source : str
        Where the numbers come from.
    bench : path
        Write a procedure of the virtual bench for it as well.
    """
    options = {
        "supply": supply, "power": power, "thrust": thrust, "torque": torque, "speed": speed,
        "motor_speed": motor_speed, "lead": lead, "gear": gear, "encoder": encoder,
        "efficiency": efficiency, "stroke": stroke, "backlash": backlash, "mass": mass,
        "inertia": inertia, "bandwidth": bandwidth,
    }  # fmt: skip
    numbers = _given_numbers(options, motor)
    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    if base is not None and not (numbers or linear or rotary):
        return _write_variant(path, base, force=force)
    from elevon.parameters.design.new import NewActuator

    made = NewActuator(path, numbers, linear, rotary, base, title, source)
    return _write_new(made, bench, force=force)


def _given_numbers(
    options: Mapping[str, str | None], motor: Sequence[str] | None
) -> dict[str, str]:
    """Return what was given on the command line, by the names of a design."""
    numbers = {name: text for name, text in options.items() if text is not None}
    for item in motor or ():
        key, equals, text = item.partition("=")
        name = f"motor.{key.strip()}"
        if not equals or not text.strip():
            raise InputError(
                f"--motor {item!r} is not of the form KEY=QUANTITY, such as 'resistance=0.6 ohm'"
            )
        if name in numbers:
            raise InputError(f"--motor {key.strip()} is given twice")
        numbers[name] = text.strip()
    return numbers


def _write_variant(path: Path, base: str, *, force: bool) -> Answer:
    from elevon.actuator import Actuator
    from elevon.parameters.write import variant_text

    text = variant_text(path.stem, Actuator.load(base), base)
    written = write_text(path, text, force=force)
    data = {"status": "ok", "file": str(written), "base": base}
    line = f"wrote {written}: change what differs, then: elevon check {written}"
    return Answer(data, lambda: answer(line))


def _write_new(made: NewActuator, bench: Path | None, *, force: bool) -> Answer:
    """Write the file, and the procedure where one is wanted; nothing of a wrong number."""
    from elevon.actuator import Actuator
    from elevon.bench.procedure import scaled_procedure
    from elevon.parameters import load_set

    common.check_outputs([made.path, bench], force=force)
    text = made.text()
    loaded = load_set(made.path, text)
    procedure = None if bench is None else scaled_procedure(loaded)
    write_text(made.path, text, force=force)
    if bench is not None and procedure is not None:
        write_text(bench, procedure, force=force)
    design = Actuator.load(str(made.path.resolve())).design
    data = {
        "status": "ok", "file": str(made.path), "bench": None if bench is None else str(bench),
        "design": {
            name: fields_of(item, "value", "text", "source") | {"given": name in made.numbers}
            for name, item in design.items()
        },
    }  # fmt: skip
    return Answer(data, lambda: _print_new(made.path, design, bench))


def _print_new(file: Path, design: Mapping[str, Parameter], bench: Path | None) -> None:
    """Print what it became, and what was assumed for it."""
    from elevon.units import format_quantity

    def text(item: Parameter, unit: str = "") -> str:
        return format_quantity(float(item.value), unit or item.unit, 4)

    load, unit = ("thrust", "mm/s") if "lead" in design else ("torque", "deg/s")
    answer(
        f"wrote {file}: {text(design[load])} at {text(design['speed'], unit)}, motor "
        f"{text(design['motor_speed'], 'rpm')} and {text(design['current'])}"
    )
    for name, item in design.items():
        if item.confidence == "assumed":
            answer(f"ASSUMED {name} {text(item)}: {item.source.removeprefix('ASSUMED: ')}")
    if bench is not None:
        answer(f"wrote {bench}: elevon bench run {bench} --actuator {file} --out logs")
    answer(f"next: elevon check {file}; elevon show {file} --changed")


@command(None)
def check(file: Annotated[Path, Option(metavar="FILE")], *, actuator: str | None = None) -> Answer:
    """Report every finding of an actuator file or a scenario file; nothing is simulated.

    Parameters
    ----------
    file : path
        Parameter set or scenario (TOML).
    actuator : str
        A scenario's actuator: its signals, faults and parameters are checked, too.
    """
    from elevon.simulate.check import check_file

    result = check_file(file, actuator)
    data = {
        "status": "fail" if result.failed else "pass", "file": str(file), "kind": result.kind,
        "findings": [item.to_dict() for item in result.findings],
    }  # fmt: skip
    return Answer(data, lambda: _print_check(file, result), 1 if result.failed else 0)


def _print_check(file: Path, result: FileCheck) -> None:
    notes = f", {result.count('note')} notes" if result.count("note") else ""
    errors, warnings = result.count("error"), result.count("warning")
    answer(f"{file}: {errors} errors, {warnings} warnings{notes}")
    if result.findings:
        print_table(("severity", "finding"), _joined(result))


def _joined(result: FileCheck) -> list[tuple[str, str]]:
    """Return errors first, each by itself, then the rest, those of one group in one row."""
    from elevon.simulate.check import SEVERITIES

    alone = [(item.severity, item.message) for item in result.findings if not item.group]
    groups: dict[tuple[str, str], list[str]] = {}
    for item in result.findings:
        if item.group:
            groups.setdefault((item.severity, item.group), []).append(item.name)
    joined = [
        (severity, f"{what}: {', '.join(names)}") for (severity, what), names in groups.items()
    ]
    return sorted([*alone, *joined], key=lambda row: SEVERITIES.index(row[0]))
