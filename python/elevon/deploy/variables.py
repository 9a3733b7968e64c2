"""The variables of an FMU, from the core's records: one list, whatever the version."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from elevon.deploy.document import RunDocument
from elevon.parameters import records
from elevon.parameters.records import Record, wirings
from elevon.scenario.compile import signal_records

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
