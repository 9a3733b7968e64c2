"""What is done on the bench: typed steps, read from TOML.

The package's own procedures (`procedures/*.toml`) and your own are the same kind of file. Steps
change the bench one after the other; each ``trace`` step records one log with the bench as it
stands.
"""

from __future__ import annotations

import itertools
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    Field,
    StrictFloat,
    StrictInt,
    StrictStr,
    ValidationInfo,
    model_validator,
)

from elevon.bench.stand import stand_of
from elevon.data import read_table
from elevon.documents import read_toml, validated
from elevon.errors import InputError, RangeError, unknown
from elevon.parameters import SetFile
from elevon.scenario.scenario import Command, Term
from elevon.strict import Quantity, Strict
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


ZERO_READING = 14.0  # mm: the wheel in full mesh
ZERO_DISTANCE = 108.43  # mm
SLOPE = math.radians(45.0)  # of the slide
PRESSURE_ANGLE = math.radians(20.0)
MODULE = 2.0  # mm
TEETH = 88
INTRINSIC_BACKLASH = math.radians(
    0.365568
)  # rad at the output: what is left with the wheel in full mesh

#: Micrometer reading [mm] and total backlash [rad] at the output, as measured on the bench.
MEASURED = tuple(
    (float(row["micrometer_mm"]), float(row["total_measured_rad"]))
    for row in read_table("torino_backlash")
)


def centre_distance(reading: float) -> float:
    """Centre distance [mm] of wheel and ring at a micrometer reading [mm].

    Raises
    ------
    RangeError
        A reading outside the table's 9 to 14 mm.
    """
    _check_reading(reading)
    return ZERO_DISTANCE + (ZERO_READING - reading) * math.sin(SLOPE)


def geometric_backlash(reading: float) -> float:
    """Total output backlash [rad] that the centre distance adds: B = 2 dC tan(alpha) / r_pitch."""
    spread = centre_distance(reading) - ZERO_DISTANCE
    return 2.0 * spread * math.tan(PRESSURE_ANGLE) / (MODULE * TEETH / 2.0)


def measured_backlash(reading: float) -> float:
    """Total backlash [rad, at the output] measured at a reading [mm], linear between rows."""
    _check_reading(reading)
    readings, backlashes = zip(*reversed(MEASURED), strict=True)
    return float(np.interp(reading, readings, backlashes))


def total_backlash(reading: float, curve: str = "geometric") -> float:
    """Total backlash [rad, at the output], intrinsic backlash included.

    Parameters
    ----------
    reading : float
        Micrometer reading [mm].
    curve : str
        ``geometric`` (intrinsic backlash plus `geometric_backlash`) or ``measured``. They part
        beyond some 2.5 mm of travel: the printed teeth are not exact involutes.
    """
    if curve == "geometric":
        return INTRINSIC_BACKLASH + geometric_backlash(reading)
    if curve == "measured":
        return measured_backlash(reading)
    raise RangeError(f"curve = {curve!r}; valid: 'geometric', 'measured'")


def micrometer_for(backlash: float, curve: str = "geometric") -> float:
    """Micrometer reading [mm] that sets a total backlash [rad, at the output].

    Raises
    ------
    RangeError
        A backlash the slide cannot set.
    """
    low, high = total_backlash(ZERO_READING, curve), total_backlash(MEASURED[-1][0], curve)
    if not low <= backlash <= high:
        raise RangeError(f"backlash {backlash:.6g} rad: the slide sets {low:.6g} to {high:.6g} rad")
    if curve == "geometric":
        rise = (backlash - INTRINSIC_BACKLASH) * MODULE * TEETH / 4.0 / math.tan(PRESSURE_ANGLE)
        return ZERO_READING - rise / math.sin(SLOPE)
    readings, backlashes = zip(*MEASURED, strict=True)
    return float(np.interp(backlash, backlashes, readings))


def _check_reading(reading: float) -> None:
    if not MEASURED[-1][0] <= reading <= ZERO_READING:
        raise RangeError(
            f"micrometer reading {reading!r} mm is outside {MEASURED[-1][0]} to {ZERO_READING} mm"
        )


_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,59}\Z")


def _least(unit: str, low: float = 0.0) -> AfterValidator:
    """Return the check of a quantity that has a unit and a least value."""

    def check(value: Quantity, info: ValidationInfo) -> Quantity:
        try:
            number = parse_quantity(value, unit, str(info.field_name))
        except InputError as error:
            raise ValueError(str(error)) from error
        if number < low:
            raise ValueError(f"{info.field_name} = {value}: must be {low:g} {unit} at least")
        return value

    return AfterValidator(check)


Length = Annotated[Quantity, _least("m")]
Instant = Annotated[Quantity, _least("s")]
Stiffness = Annotated[Quantity, _least("N/m")]


def plain_name(value: str) -> str:
    """Refuse what is no plain file name, or would be taken for a log's companion."""
    if not _NAME.match(value) or value.endswith(("_loadcell", "_command")):
        raise ValueError(f"{value!r} is not a plain file name (letters, digits, '-', '_')")
    return value


PlainName = Annotated[StrictStr, AfterValidator(plain_name)]


class BacklashStep(Strict):
    """Set the backlash: by the micrometer, net (the intrinsic one added), or in total.

    Attributes
    ----------
    micrometer : quantity, optional
        Reading, mm.
    curve : str
        ``geometric`` or ``measured``: how a reading becomes a backlash.
    net, total : quantity, optional
        Backlash at the output; `net` is what the spacing adds to the gear's own.
    """

    kind: Literal["backlash"]
    micrometer: Quantity | None = None
    curve: Literal["geometric", "measured"] = "measured"
    net: Quantity | None = None
    total: Quantity | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        given = [n for n in ("micrometer", "net", "total") if getattr(self, n) is not None]
        if len(given) != 1:
            raise ValueError("a backlash needs exactly one of 'micrometer', 'net', 'total'")
        try:
            self.value()
        except InputError as error:
            raise ValueError(str(error)) from error
        return self

    def value(self) -> float:
        """Return the total backlash at the output [rad]."""
        if self.micrometer is not None:
            reading = 1e3 * parse_quantity(self.micrometer, "m", "micrometer")
            return total_backlash(reading, self.curve)
        text, extra = (self.net, INTRINSIC_BACKLASH) if self.net is not None else (self.total, 0.0)
        assert text is not None
        backlash = parse_quantity(text, "rad", "backlash")
        if backlash < 0.0:
            raise InputError(f"backlash = {text} must not be negative")
        return backlash + extra


class BrakeStep(Strict):
    """Set the command of the brake's loop; no terms: the brake is off.

    Attributes
    ----------
    terms : tuple of Term
        Sum of waveforms, N m on the motor shaft, counted from the trigger.
    """

    kind: Literal["brake"]
    terms: tuple[Term, ...] = ()


class SpringStep(Strict):
    """Fit the springs of the load module, or take them off.

    Attributes
    ----------
    fitted : bool
        Whether the cables are hooked on.
    stiffness : quantity
        Of each of the two springs, N/m.
    radius : quantity
        Of the winding guide, m.
    extension : quantity
        Of each spring while the output stands at zero, m.
    mover : quantity
        Displacement of the mover, m: adds a radial force on the guide.
    """

    kind: Literal["spring"]
    fitted: bool = True
    stiffness: Stiffness = 61.4
    radius: Length = 0.080
    extension: Length = 0.10
    mover: Length = 0.0


class Drop(Strict):
    """One mass hung on each cable from a time to another, counted from the trigger."""

    mass: Annotated[Quantity, _least("kg")]
    at: Instant
    until: Quantity

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        start, stop = (parse_quantity(x, "s") for x in (self.at, self.until))
        if stop <= start:
            raise ValueError(f"until = {self.until} must be after at = {self.at}")
        return self


class WeightsStep(Strict):
    """Hang weights on the winding guide's cables; no drops: none.

    Attributes
    ----------
    drops : tuple of Drop
        In the order of time, not overlapping.
    cables : int
        One or two cables carry the mass each.
    radius : quantity
        Of the winding guide, m.
    """

    kind: Literal["weights"]
    drops: tuple[Drop, ...] = ()
    cables: Literal[1, 2] = 2
    radius: Quantity = 0.080

    @model_validator(mode="after")
    def _apart(self) -> Self:
        ends = 0.0
        for drop in self.drops:
            if parse_quantity(drop.at, "s") < ends:
                raise ValueError(f"the drop at {drop.at} begins before the one before it ends")
            ends = parse_quantity(drop.until, "s")
        return self


class ForceStep(Strict):
    """Set the load actuator's command; parts add up, positive opposes positive motion.

    Attributes
    ----------
    terms : tuple of Term
        Sum of waveforms, N, counted from the command's start.
    opposing : quantity
        Against motion of either direction, N; negative: along it.
    stiffness : quantity
        Of a spring at rest at zero, N/m.
    positions, forces : tuple of float
        Force [N] against the output's position [m]; linear between, held outside.
    """

    kind: Literal["force"]
    terms: tuple[Term, ...] = ()
    opposing: Annotated[Quantity, _least("N", -math.inf)] = 0.0
    stiffness: Stiffness = 0.0
    positions: tuple[StrictInt | StrictFloat, ...] = ()
    forces: tuple[StrictInt | StrictFloat, ...] = ()

    @model_validator(mode="after")
    def _readable(self) -> Self:
        if len(self.positions) != len(self.forces):
            raise ValueError("'positions' and 'forces' must be of one length")
        if any(b <= a for a, b in itertools.pairwise(self.positions)):
            raise ValueError("'positions' must rise")
        return self


class RigStep(Strict):
    """Move the output by the rig, m/s (a friction test); no terms: the actuator moves itself."""

    kind: Literal["rig"]
    terms: tuple[Term, ...] = ()


class SettingsStep(Strict):
    """Change parameters of the actuator for the logs that follow, such as the drive's gains."""

    kind: Literal["settings"]
    parameters: dict[str, Quantity]


class SensorStep(Strict):
    """Let a sensor of the stand fail in the logs that follow: none of the actuator's own.

    Attributes
    ----------
    channel : str
        Role that the stand records, such as ``load_cell`` or ``surface_temperature``.
    gain : float
        Factor on what it measures.
    offset : quantity
        Added to it, in the channel's unit.
    fault : str
        ``stuck``: what it measured last; ``dead``: nothing but the recorder's noise.
    at : quantity
        When it becomes so, s from the log's beginning.
    """

    kind: Literal["sensor"]
    channel: StrictStr
    gain: StrictInt | StrictFloat = 1.0
    offset: Quantity = 0.0
    fault: Literal["none", "stuck", "dead"] = "none"
    at: Instant = 0.0


class TraceStep(Strict):
    """Record one log.

    Attributes
    ----------
    name : str
        File name without ending.
    duration : quantity
        Length of the log, s.
    command : Command
        As in a scenario, counted from the command's start.
    rate : quantity, optional
        Samples a second; default the stand's. The rotary's drive has a rate of its own.
    initial : dict
        Where the output stands at first, as in a scenario.
    """

    kind: Literal["trace"]
    name: PlainName
    duration: Annotated[Quantity, _least("s", 1.0)]
    command: Command = Command()
    rate: Annotated[Quantity, _least("Hz", 1.0)] | None = None
    initial: dict[str, Quantity] = Field(default_factory=dict)


_Load = BacklashStep | BrakeStep | SpringStep | WeightsStep | ForceStep | RigStep
Step = Annotated[
    _Load | SettingsStep | SensorStep | TraceStep,
    Field(discriminator="kind"),
]
