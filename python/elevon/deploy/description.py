"""``modelDescription.xml`` of FMI 2.0 and 3.0, written from one list of variables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from elevon.deploy.document import RunDocument
from elevon.parameters import records
from elevon.parameters.records import Record, wirings
from elevon.scenario.compile import signal_records
from elevon.units import parse_unit

#: Largest seed: a whole number of 32 bits.
MOST_SEED = 2_147_483_647


@dataclass(frozen=True)
class FmuVariable:
    """One variable; its value reference is its place in the list.

    Attributes
    ----------
    name, text : str
        As an importer shows them.
    role : str
        ``time``, ``parameter``, ``input`` or ``output``.
    row : tuple
        What the binary knows of it: its kind and where it stands.
    unit : str
        SI; ``1`` for a plain number.
    form : str
        ``real``, ``whole`` or ``choice``.
    minimum, maximum : float
        Infinite where there is no limit.
    start : float or None
        None: calculated.
    choices : tuple of str
        Named values, numbered from one.
    discrete : bool
        It changes at instants only.
    """

    name: str
    text: str
    role: str
    row: tuple[str | int, ...]
    unit: str = "1"
    form: str = "real"
    minimum: float = -math.inf
    maximum: float = math.inf
    start: float | None = None
    choices: tuple[str, ...] = ()
    discrete: bool = False


def fmu_variables(document: RunDocument) -> list[FmuVariable]:
    """Return the variables: time, inputs, faults' severities, outputs, parameters, the seed."""
    return [
        FmuVariable("time", "simulated time", "time", ("time",), "s"),
        *_inputs(document),
        *_faults(document),
        *_outputs(document),
        *_parameters(document),
        *_settings(document),
        FmuVariable(
            "fault_prepared", "faults that the equations hold from the start: slower, and to the "
            "bit as a run whose scenario has them; any other fault is taken up when it first acts",
            "parameter", ("prepared",), form="choice", start=1.0,
            choices=("none", "all", *(port.name for port in document.faults)),
        ),
        FmuVariable(
            "seed", "of the random numbers", "parameter", ("seed",), form="whole",
            minimum=0.0, maximum=MOST_SEED, start=0.0,
        ),
    ]  # fmt: skip


def rows(variables: list[FmuVariable]) -> list[list[object]]:
    """Return what the binary is told of them: name, kind, places, form."""
    return [[item.name, *item.row, item.form] for item in variables]


def _inputs(document: RunDocument) -> Iterator[FmuVariable]:
    from elevon import _core

    wiring, parameters = document.actuator.wiring, document.actuator.parameters
    actions = len(wirings()[wiring]["actions"])
    for index, port in enumerate(_core.ports(wiring)):
        name = port["name"]
        path = port["parameter"]
        record = records(wiring)[path] if path else None
        low, high = (record.minimum, record.maximum) if record else (-math.inf, math.inf)
        switched = name == "weight_on_wheels" or (name == "command" and actions > 0)
        if switched:
            low, high = 0.0, 1.0 if name != "command" else 2.0 * actions - 1.0
        text = port["text"] if name != "command" else f"{port['text']}; here: {document.mode}"
        yield FmuVariable(
            name, text, "input", ("input", index), document.units[name] or "1",
            minimum=low, maximum=high, start=parameters.value(path) if path else 0.0,
            discrete=switched,
        )  # fmt: skip


def _faults(document: RunDocument) -> Iterator[FmuVariable]:
    for index, port in enumerate(document.faults):
        record = port.record
        yield FmuVariable(
            f"fault.{port.name}", f"severity, 0: healthy; {record.effect}", "input",
            ("fault", index), record.unit or "1", minimum=record.minimum, maximum=record.maximum,
            start=0.0,
        )  # fmt: skip


def _settings(document: RunDocument) -> Iterator[FmuVariable]:
    """Further numbers of faults that have a value by default; others are parameters already."""
    for index, port in enumerate(document.faults):
        for place, item in enumerate(port.settings):
            yield FmuVariable(
                f"setting.{port.name}.{item['name']}", item["text"], "parameter",
                ("attribute", index, place), item["unit"] or "1", minimum=item["minimum"],
                maximum=item["maximum"], start=float(item["default"]),
            )  # fmt: skip


def _outputs(document: RunDocument) -> Iterator[FmuVariable]:
    known = signal_records(document.actuator.wiring, document.fidelity)
    for index, name in enumerate(document.signals):
        record = known[name]
        yield FmuVariable(name, record["text"], "output", ("output", index), record["unit"] or "1")


def _parameters(document: RunDocument) -> Iterator[FmuVariable]:
    """Those that this fidelity carries; what the command demands is fixed by the export."""
    values = document.actuator.parameters
    for index, (path, record) in enumerate(records(document.actuator.wiring).items()):
        if document.fidelity in record.fidelities and path != "control.mode":
            number = record.number(values[path].value)
            yield _parameter(record, index, number)


def _parameter(record: Record, index: int, number: float) -> FmuVariable:
    text = f"{record.text} (above {record.minimum:g})" if record.minimum_open else record.text
    if record.choices is not None:
        return FmuVariable(
            record.path, text, "parameter", ("parameter", index), form="choice",
            start=number + 1.0, choices=record.choices,
        )  # fmt: skip
    return FmuVariable(
        record.path, text, "parameter", ("parameter", index), record.unit or "1",
        form="whole" if record.whole else "real", minimum=record.minimum, maximum=record.maximum,
        start=number,
    )  # fmt: skip


#: The binary's name, and that of its functions' owner.
IDENTIFIER = "elevon"
LOGS = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")
#: SI unit to the units in which people read it: (name, factor, offset).
DISPLAYS = {
    "rad": [("deg", 180.0 / math.pi, 0.0)],
    "rad/s": [("rpm", 30.0 / math.pi, 0.0)],
    "m": [("mm", 1e3, 0.0)],
    "K": [("degC", 1.0, -273.15)],
}
_BASES = ("m", "kg", "s", "A", "K", "rad")
_TYPES = {
    "2.0": {"real": "Real", "whole": "Integer", "choice": "Enumeration"},
    "3.0": {"real": "Float64", "whole": "Int32", "choice": "Enumeration"},
}


@dataclass(frozen=True)
class Model:
    """What a description says besides its variables.

    `step` is the solver's step, `period` the suggested communication step, both in s.
    """

    name: str
    text: str
    token: str
    generator: str
    step: float
    period: float


def description(model: Model, variables: Sequence[FmuVariable], version: str) -> bytes:
    """Return the XML of a version."""
    root = _root(model, version)
    _units(root, variables)
    _choices(root, variables, version)
    categories = SubElement(root, "LogCategories")
    for name in LOGS:
        SubElement(categories, "Category", name=name)
    SubElement(root, "DefaultExperiment", startTime="0.0", stopTime="1.0",
               stepSize=repr(model.period))  # fmt: skip
    listed = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        (_variable2 if version == "2.0" else _variable3)(listed, variable, reference)
    _structure(root, variables, version)
    return _document(root)


def terminals(variables: Sequence[FmuVariable]) -> bytes | None:
    """Return the terminals of FMI 3.0: what belongs to the output's flange, to the supply."""
    names = {variable.name for variable in variables}
    groups = {
        "flange": ("output_position", "output_speed", "output"),
        "terminals": ("supply", "supply_voltage", "current_source"),
    }
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    listed = SubElement(root, "Terminals")
    for name, members in groups.items():
        there = [member for member in members if member in names]
        if len(there) > 1:
            terminal = SubElement(listed, "Terminal", name=name, matchingRule="plug")
            for member in there:
                SubElement(terminal, "TerminalMemberVariable", variableName=member,
                           memberName=member, variableKind="signal")  # fmt: skip
    if not len(listed):
        return None
    return _document(root)


def _document(root: Element) -> bytes:
    indent(root)
    text: bytes = tostring(root, encoding="utf-8")
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + text + b"\n"


def _root(model: Model, version: str) -> Element:
    two = version == "2.0"
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": version,
            "modelName": model.name,
            "guid" if two else "instantiationToken": model.token,
            "description": model.text,
            "generationTool": model.generator,
            "variableNamingConvention": "structured",
        },
    )
    abilities = {
        "modelIdentifier": IDENTIFIER,
        "canHandleVariableCommunicationStepSize": "true",
        "canGetAndSetFMUstate" if two else "canGetAndSetFMUState": "true",
        "canSerializeFMUstate" if two else "canSerializeFMUState": "true",
    }
    if not two:
        abilities["fixedInternalStepSize"] = repr(model.step)
    SubElement(root, "CoSimulation", abilities)
    return root


def _units(root: Element, variables: Sequence[FmuVariable]) -> None:
    listed = SubElement(root, "UnitDefinitions")
    for text in sorted({variable.unit for variable in variables}):
        unit = parse_unit(text)
        exponents = dict(zip(_BASES, unit.dimension, strict=True))
        base = {name: str(exponents[name]) for name in ("kg", *_BASES) if exponents[name]}
        if unit.factor != 1.0:
            base["factor"] = repr(unit.factor)
        entry = SubElement(listed, "Unit", name=text)
        SubElement(entry, "BaseUnit", base)
        for name, factor, offset in DISPLAYS.get(text, ()):
            display = {"name": name, "factor": repr(factor), "offset": repr(offset)}
            SubElement(entry, "DisplayUnit", display)


def _choices(root: Element, variables: Sequence[FmuVariable], version: str) -> None:
    chosen = [variable for variable in variables if variable.choices]
    if not chosen:
        return
    listed = SubElement(root, "TypeDefinitions")
    for variable in chosen:
        if version == "2.0":
            owner = SubElement(listed, "SimpleType", name=f"{variable.name}.choice")
            entry = SubElement(owner, "Enumeration")
        else:
            entry = SubElement(listed, "EnumerationType", name=f"{variable.name}.choice")
        for number, name in enumerate(variable.choices, start=1):
            SubElement(entry, "Item", name=name, value=str(number))


def _about(variable: FmuVariable) -> dict[str, str]:
    """Return name, text, causality and variability: the same words in both versions."""
    about = {"name": variable.name, "description": variable.text}
    if variable.role == "time":
        return {**about, "causality": "independent", "variability": "continuous"}
    if variable.role == "parameter":
        return {**about, "causality": "parameter", "variability": "fixed", "initial": "exact"}
    change = "continuous" if variable.form == "real" and not variable.discrete else "discrete"
    return {**about, "causality": variable.role, "variability": change}


def _numbers(variable: FmuVariable) -> dict[str, str]:
    """Return unit, limits and start as a type of numbers has them."""
    numbers: dict[str, str] = {}
    if variable.form == "choice":
        numbers["declaredType"] = f"{variable.name}.choice"
    elif variable.form == "real":
        numbers["unit"] = variable.unit
    for key, value in (("min", variable.minimum), ("max", variable.maximum)):
        if math.isfinite(value):
            numbers[key] = _text(value, variable)
    if variable.start is not None:
        numbers["start"] = _text(variable.start, variable)
    return numbers


def _text(value: float, variable: FmuVariable) -> str:
    return repr(float(value)) if variable.form == "real" else str(int(value))


def _variable2(listed: Element, variable: FmuVariable, reference: int) -> None:
    about = _about(variable)
    entry = SubElement(listed, "ScalarVariable", {**about, "valueReference": str(reference)})
    SubElement(entry, _TYPES["2.0"][variable.form], _numbers(variable))


def _variable3(listed: Element, variable: FmuVariable, reference: int) -> None:
    about = {**_about(variable), "valueReference": str(reference), **_numbers(variable)}
    SubElement(listed, _TYPES["3.0"][variable.form], about)


def _structure(root: Element, variables: Sequence[FmuVariable], version: str) -> None:
    structure = SubElement(root, "ModelStructure")
    places = [place for place, variable in enumerate(variables) if variable.role == "output"]
    if version == "2.0":
        for name in ("Outputs", "InitialUnknowns"):
            listed = SubElement(structure, name)
            for place in places:
                SubElement(listed, "Unknown", index=str(place + 1))
        return
    for name in ("Output", "InitialUnknown"):
        for place in places:
            SubElement(structure, name, valueReference=str(place))
