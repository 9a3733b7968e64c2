"""What is done on the bench: typed steps, read from TOML.

The package's own procedures (`procedures/*.toml`) and your own are the same kind of file. Steps
change the bench one after the other; each ``trace`` step records one log with the bench as it
stands.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any, Self

from pydantic import (
    StrictStr,
    model_validator,
)

from elevon.bench.stand import stand_of
from elevon.bench.steps import BacklashStep, PlainName, RigStep, Step, TraceStep
from elevon.documents import read_toml, validated
from elevon.errors import InputError, unknown
from elevon.parameters import SetFile
from elevon.strict import Strict
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from elevon.actuator import Actuator


class Procedure(Strict):
    """A bench procedure.

    Attributes
    ----------
    name, text : str
        What it is called and what it is for.
    stand : str, optional
        The stand it is written for (`elevon.bench.stand.stand_names`); default: any.
    step : tuple of Step
        In order; at least one of them a trace, each trace with a name of its own.
    """

    name: PlainName
    text: StrictStr = ""
    stand: StrictStr | None = None
    step: tuple[Step, ...]

    @model_validator(mode="after")
    def _traced(self) -> Self:
        names = [item.name for item in self.step if isinstance(item, TraceStep)]
        if not names:
            raise ValueError("no step of kind 'trace': nothing would be recorded")
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two traces are named {name!r}")
        return self

    @property
    def traces(self) -> tuple[TraceStep, ...]:
        """The steps that record."""
        return tuple(item for item in self.step if isinstance(item, TraceStep))


def procedure_names(stand: str | None = None) -> list[str]:
    """Return the names of the package's own procedures, of one stand or all."""
    folder = files("elevon.bench") / "procedures"
    names = sorted(
        item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml")
    )
    if stand is None:
        return names
    return [name for name in names if load_procedure(name).stand in (None, stand)]


def load_procedure(reference: str | os.PathLike[str]) -> Procedure:
    """Load a procedure by its name, or from a TOML file.

    Raises
    ------
    UnknownNameError
        No procedure of that name, and no such file.
    InputError
        The file is wrong; the message holds file, line, key, limit and the nearest names.
    """
    text = os.fspath(reference)
    names = procedure_names()
    if text in names:
        path = Path(str(files("elevon.bench") / "procedures" / f"{text}.toml"))
    elif text.endswith(".toml") or os.sep in text:
        path = Path(text)
    else:
        raise unknown("procedure", text, names)
    document = read_toml(path)
    return validated(Procedure, _located(document.data, path.parent), document)


def _located(data: Any, folder: Path) -> Any:
    """Make the files named in tables relative to the procedure's folder."""
    if isinstance(data, list):
        return [_located(item, folder) for item in data]
    if not isinstance(data, Mapping):
        return data
    return {
        key: str((folder / item).resolve())
        if key == "file" and isinstance(item, str)
        else _located(item, folder)
        for key, item in data.items()
    }


POSITION = "rotary"  # equipment whose logs are read by the model of the rotary bench
_LONGEST = 60.0  # s: longer traces are of temperatures


@dataclass(frozen=True)
class StandardTest:
    """One trace of a procedure, with the steps that set the bench for it.

    Attributes
    ----------
    name : str
        Of the trace.
    procedure : Procedure
        Its steps.
    """

    name: str
    procedure: Procedure


def standard_tests(actuator: Actuator) -> tuple[StandardTest, ...]:
    """Return the tests, in the order of the bench's list.

    What commands nothing, or is there for temperatures or vibration (a rate of its own), is none.
    Of a rotary bench's procedures that ask for the same motion, the first is one.
    """
    stand = stand_of(actuator.wiring)
    out: list[StandardTest] = []
    motions = []
    for name in procedure_names(stand.name):
        procedure = load_procedure(name)
        traces = [step for step in procedure.step if isinstance(step, TraceStep)]
        moved = any(isinstance(step, RigStep) and step.terms for step in procedure.step)
        if stand.equipment == POSITION:
            traces = [trace for trace in traces[:1] if trace.command not in motions]
        for trace in traces:
            if not moved and _read(trace):
                out.append(StandardTest(trace.name, _up_to(procedure, trace)))
                motions.append(trace.command)
    return tuple(out)


def _read(trace: TraceStep) -> bool:
    command = trace.command
    moving = any(term.kind != "constant" for term in command.terms) or command.steps
    return (
        bool(moving)
        and command.mode in ("position", "gear")
        and trace.rate is None
        and parse_quantity(trace.duration, "s", "duration") <= _LONGEST
    )


def _up_to(procedure: Procedure, trace: TraceStep) -> Procedure:
    """Return the procedure with this trace alone, and what was set before it."""
    at = next(k for k, step in enumerate(procedure.step) if step is trace)
    before = [s for s in procedure.step[:at] if not isinstance(s, TraceStep | BacklashStep)]
    return procedure.model_copy(update={"step": (*before, trace)})


#: Longest cycle [s] of a ram and of a turning output.
_LONGEST_PROCEDURE = {True: 2.0, False: 4.0}


def scaled_procedure(loaded: SetFile) -> str:
    """Return the text of a procedure whose motions and loads suit an actuator's design.

    Sines reach half the rated speed, over a fifth of the stroke to either side at most, in cycles
    of at most two seconds (a ram) or four.

    Raises
    ------
    InputError
        The actuator states no design.
    """
    if not loaded.design:
        raise InputError(f"{loaded.name}: states no [design] to scale a procedure by")
    value = {
        name: float(item.value) for name, item in loaded.design.items() if name != "motor.kind"
    }
    linear = "lead" in value
    display = 1e3 if linear else 180.0 / math.pi
    speed = 0.5 * value["speed"]
    amplitude = min(0.2 * value["stroke"], _LONGEST_PROCEDURE[linear] * speed / (2.0 * math.pi))
    frequency = speed / (2.0 * math.pi * amplitude)
    small = 0.2 * amplitude
    numbers = {
        "duration": (4.0 if linear else 3.0) / frequency,
        "amplitude": amplitude * display,
        "frequency": frequency,
        "small": small * display,
        "fast": min(0.4 * value["speed"] / (2.0 * math.pi * small), 0.5 * value["bandwidth"]),
    }
    if linear:
        numbers |= {"half": 0.5 * value["thrust"], "quarter": 0.25 * value["thrust"]}
    else:
        torque = value["power"] / value["motor_speed"]
        numbers |= {"low": 0.1 * torque, "slope": 0.4 * torque / numbers["duration"]}
    template = files("elevon.bench") / "templates" / ("linear.txt" if linear else "rotary.txt")
    texts = {name: f"{number:.4g}" for name, number in numbers.items()}
    return Template(template.read_text("utf-8")).substitute(texts, name=loaded.name)
