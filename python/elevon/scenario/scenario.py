"""The scenario file and its objects (pydantic: unknown keys are errors, values are frozen)."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StrictBool,
    StrictFloat,
    StrictInt,
    StrictStr,
    field_validator,
    model_validator,
)

from elevon.arrays import Floats
from elevon.documents import Document, read_toml, validated
from elevon.errors import InputError, UnitError, did_you_mean
from elevon.faults import Fault
from elevon.loads.power_quality import supply_transient
from elevon.report.cards import Html, card, table
from elevon.series import check_series, read_series
from elevon.strict import Quantity, Strict
from elevon.units import ambiguous, display_unit, is_ambiguous, parse_quantity
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


def scenario_card(scenario: Scenario) -> Html:
    """Return the HTML view of a scenario: command, loads, faults, duration."""
    command, loads = scenario.command, scenario.loads
    rows: list[list[object]] = [[f"command ({command.mode})", _sum(command)]]
    rows += [["", f"{step.time}: {step.action}"] for step in command.steps]
    rows += [[f"load: {name}", _sum(getattr(loads, name))] for name in type(loads).model_fields]
    rows += [["supply", _sum(scenario.supply)], ["ambient", _sum(scenario.ambient)]]
    rows += [["fault", str(fault)] for fault in scenario.fault]
    rows += [[f"initial: {name}", value] for name, value in scenario.initial.items()]
    rows += [[f"parameter: {path}", value] for path, value in scenario.parameters.items()]
    facts = [("duration", f"{scenario.seconds:g} s"), ("", scenario.text)]
    return card("Scenario", facts, table(["", ""], [row for row in rows if row[1] != ""]))


def _sum(terms: Terms) -> str:
    return " + ".join(_term(term) for term in terms.terms if term.enabled)


def _term(term: Term) -> str:
    given: dict[str, object] = dict(term.arguments)
    if term.standard is not None:
        given["standard"] = term.standard
    elif term.file is not None:
        given["file"] = term.file
    elif term.times is not None:
        given["points"] = len(term.times)
    return f"{term.kind}({', '.join(f'{name}={value}' for name, value in given.items())})"


class Term(BaseModel):
    """One waveform of a sum; its own parameters are further keys, named by the core's records.

    Attributes
    ----------
    kind : str
        A waveform: constant, step, ramp, sine, chirp, triangle, trapezoid, rectangle, table, ...
    enabled : bool
        A switch; a disabled term adds nothing.
    times, values : tuple of float
        Points of a table, in `time_unit` and `unit`; instead of them `file`, a CSV file of two
        columns, or `standard`.
    standard : str
        A supply's transient by its standard, such as ``mil-std-704f/28v/overvoltage``; V over s.
    """

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)
    __pydantic_extra__: dict[str, StrictBool | Quantity]

    kind: StrictStr
    enabled: StrictBool = True
    times: tuple[StrictInt | StrictFloat, ...] | None = None
    values: tuple[StrictInt | StrictFloat, ...] | None = None
    file: StrictStr | None = None
    standard: StrictStr | None = None
    unit: StrictStr = ""
    time_unit: StrictStr = "s"

    @model_validator(mode="after")
    def _known(self) -> Self:
        known = wave_records()
        if self.kind not in known:
            raise ValueError(f"unknown waveform {self.kind!r}{did_you_mean(self.kind, known)}")
        record = known[self.kind]
        table_keys = ["times", "values", "file", "standard", "unit", "time_unit"]
        points = table_keys if self.kind == TABLE else []
        valid = ["kind", "enabled", *record.names, *points]
        for name in (*self.arguments, *(self.model_fields_set - {"kind", "enabled"})):
            if name not in valid:
                raise ValueError(
                    f"unknown key {name!r} of a {self.kind}{did_you_mean(name, valid)}"
                )
        needed = [p.name for p in record.parameters if p.default is None]
        for name in needed:
            if name not in self.arguments:
                raise ValueError(f"a {self.kind} needs {name!r}")
        if self.kind == TABLE:
            self._check_points()
        return self

    @property
    def arguments(self) -> dict[str, bool | float | str]:
        """The waveform's own parameters as given."""
        return dict(self.model_extra or {})

    def points(self) -> tuple[Floats, Floats]:
        """Return times and values of a table as given, shape (n,) each, from the file if any."""
        if self.standard is not None:
            return supply_transient(self.standard).points()
        if self.file is not None:
            return check_series(*read_series(self.file, "table"), f"table {self.file}")
        return check_series(self.times or (), self.values or (), "table")

    def _check_points(self) -> None:
        inline = self.times is not None or self.values is not None
        given = [inline, self.file is not None, self.standard is not None]
        if sum(given) != 1:
            raise ValueError("a table needs either 'times' and 'values', a 'file' or a 'standard'")
        if self.standard is not None and self.model_fields_set & {"unit", "time_unit"}:
            raise ValueError("a table of a 'standard' has its own units, V and s")
        try:
            self.points()
        except InputError as error:
            raise ValueError(str(error)) from error


class Terms(Strict):
    """A sum of waveforms acting at one place."""

    terms: tuple[Term, ...] = ()


class Action(Strict):
    """One action of a command sequence, held until the next: ``extend``, ``retract``, ..."""

    time: Quantity
    action: StrictStr


class Command(Terms):
    """The command: the output's position, the motor's speed or torque, or a sequence of actions.

    Attributes
    ----------
    mode : str
        ``gear`` where the actuator has a control unit of its own that takes actions.
    steps : tuple of Action
        Mode ``gear`` only, in place of waveforms; times rising.
    """

    mode: Literal["position", "speed", "torque", "gear"] = "position"
    steps: tuple[Action, ...] = ()

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        if self.mode == "gear" and self.terms:
            raise ValueError("mode 'gear' takes 'steps' (time and action), not 'terms'")
        if self.mode != "gear" and self.steps:
            raise ValueError(f"'steps' belong to mode 'gear', not to mode {self.mode!r}")
        return self


class Load(Strict):
    """What acts on the actuator from outside; zero where nothing is given.

    Attributes
    ----------
    brake : Terms
        N m on the motor shaft, resistive: adds to the dry friction.
    shaft : Terms
        N m on the motor shaft, positive when it opposes positive motion.
    output : Terms
        N m (N for linear actuators) on the output side, positive when it opposes positive motion.
    weight_on_wheels : Terms
        1 while the aircraft stands on its wheels (landing gear).
    rig_speed : Terms
        m/s that a test rig imposes on the ram in place of the leg (landing gear).
    """

    brake: Terms = Terms()
    shaft: Terms = Terms()
    output: Terms = Terms()
    weight_on_wheels: Terms = Terms()
    rig_speed: Terms = Terms()


def _flat(given: Any) -> Any:
    """Turn the nested tables TOML makes of ``motor.inertia = 1`` back into dotted keys."""
    if not isinstance(given, Mapping):
        return given
    flat: dict[str, Any] = {}
    for key, value in given.items():
        if isinstance(value, Mapping):
            flat.update({f"{key}.{name}": item for name, item in _flat(value).items()})
        else:
            flat[str(key)] = value
    return flat


def _fault_table(given: Any) -> Any:
    """Accept `Fault` objects and texts of the fault grammar beside tables; return tables."""
    if not isinstance(given, (list, tuple)):
        return given
    read = []
    for index, item in enumerate(given):
        try:
            fault = _fault(item, index)
        except InputError as error:
            raise ValueError(str(error)) from error
        read.append(fault)
    return tuple(read)


def _fault(item: Any, index: int) -> Any:
    if isinstance(item, str):
        return Fault.parse(item)
    if isinstance(item, Mapping):
        return Fault.from_dict(item, f"fault[{index}]")
    return item


Values = Annotated[dict[str, Quantity], BeforeValidator(_flat)]


class Scenario(Strict):
    """What an actuator is commanded, what acts on it, what breaks, and for how long.

    Attributes
    ----------
    duration : float or str
        Simulated time; a bare number is in s.
    command : Command
        Mode and sum of waveforms; no command means a constant zero.
    loads : Load
        Key ``load`` of the file: loads on the motor shaft and the output side.
    supply : Terms
        V; when empty, the actuator file's supply voltage.
    ambient : Terms
        Temperature of the air, K; when empty, the actuator file's (``thermal.ambient``, of the
        landing gear ``lubricant.temperature``). Held over 10 ms.
    fault : tuple of Fault
        What breaks. Texts of the fault grammar and tables are accepted.
    initial : mapping
        Signal name to value at the start.
    parameters : mapping
        Parameter path to value: overrides of the actuator.
    text : str
        A line for the reader.

    Examples
    --------
    >>> scenario = Scenario.from_dict({
    ...     "duration": "2 s",
    ...     "command": {"terms": [{"kind": "sine", "amplitude": "7 deg", "frequency": "0.2 Hz"}]},
    ... })  # doctest: +SKIP
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, arbitrary_types_allowed=True
    )

    text: StrictStr = ""
    duration: Quantity
    command: Command = Command()
    loads: Load = Field(default=Load(), alias="load")
    supply: Terms = Terms()
    ambient: Terms = Terms()
    fault: Annotated[tuple[Fault, ...], BeforeValidator(_fault_table)] = ()
    initial: Values = Field(default_factory=dict)
    parameters: Values = Field(default_factory=dict)

    @field_validator("duration")
    @classmethod
    def _positive(cls, duration: float | str) -> float | str:
        try:
            seconds = parse_quantity(duration, "s")
        except InputError as error:
            raise ValueError(str(error)) from error
        if seconds <= 0.0:
            raise ValueError(f"{duration} must be longer than zero")
        return duration

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scenario:
        """Read a scenario file (TOML).

        A number without a unit that could be degrees or radians, mm or m, is refused there; in
        Python, in a dict too, a number is SI.

        Raises
        ------
        InputError
            The message lists every finding with file, line, key, limit and the nearest names.
        """
        document = read_toml(Path(path))
        check_units(document)
        data = located(document.data, document.folder)
        if "parameters" in data:
            data["parameters"] = with_texts(data["parameters"])
        return validated(cls, data, document)

    @classmethod
    def from_dict(cls, data: Mapping[str, object], place: str = "scenario") -> Scenario:
        """Build a scenario from nested mappings of the file's form.

        Raises
        ------
        InputError
            The message lists every finding with its place, limit and the nearest names.
        """
        return validated(cls, data, Document(place, "", {}))

    def to_dict(self) -> dict[str, Any]:
        """Return nested mappings of the file's form, without what was left at its default."""
        data = self.model_dump(exclude_unset=True, exclude={"fault"}, mode="json", by_alias=True)
        if self.fault:
            data["fault"] = [fault.to_dict() for fault in self.fault]
        return data

    def _repr_html_(self) -> str:
        return scenario_card(self)

    @property
    def seconds(self) -> float:
        """The duration in s."""
        return parse_quantity(self.duration, "s")

    def replaced(self, **changes: object) -> Scenario:
        """Return a scenario with some of its fields changed, checked as a whole."""
        return Scenario.from_dict({**self.to_dict(), **changes})

    def with_faults(self, faults: Iterable[Fault | str | Mapping[str, object]]) -> Scenario:
        """Return a scenario with further faults."""
        return self.replaced(fault=[*self.fault, *faults])


def located(data: Any, folder: Path | None) -> Any:
    """Make the files named in tables relative to the scenario's folder."""
    if isinstance(data, list):
        return [located(item, folder) for item in data]
    if not isinstance(data, dict):
        return data
    return {
        key: _resolved(folder / item)
        if key == "file" and isinstance(item, str) and folder is not None
        else located(item, folder)
        for key, item in data.items()
    }


def _resolved(path: Path) -> str:
    try:
        return str(path.resolve())
    except (ValueError, RuntimeError):  # a zero byte, links in a ring: reading it states so
        return str(path)
