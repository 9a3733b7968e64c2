"""``modelDescription.xml`` of FMI 2.0 and 3.0, written from one list of variables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from elevon.deploy.variables import FmuVariable
from elevon.units import parse_unit

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
