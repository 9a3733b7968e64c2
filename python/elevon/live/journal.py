"""What was done to a live bench, from its start on."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from elevon.bench.rig import moved
from elevon.documents import Document, validated
from elevon.errors import InputError
from elevon.faults import Fault
from elevon.faults.catalogue import find_record
from elevon.scenario import Terms
from elevon.scenario.compile import evaluate_terms, port_units
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from elevon.live.unit import LiveUnit


Act = tuple[float, dict[str, Any]]
_LOADS = ("brake", "shaft", "output", "weight_on_wheels")
_RESTING = {"supply": "inverter.supply_voltage", "ambient": "thermal.ambient"}
"""Parameters that hold where an input is not given; the other inputs are zero."""
_EDGE = 1e-9  # s in which a severity becomes the next: a table's instants must rise


class ScenarioWriter:
    """Turns actions into the tables of a scenario file.

    Parameters
    ----------
    unit : LiveUnit
        What ran.
    mode : str
        Of the command at the start.
    entries : sequence of (float, mapping)
        Instant from the start [s], and what was done.
    end : float
        Instant that is reached [s].
    """

    def __init__(self, unit: LiveUnit, mode: str, entries: Sequence[Act], end: float) -> None:
        self._unit, self._mode, self._entries, self._end = unit, mode, entries, end
        self._units = port_units(mode, unit.actuator.wiring)
        self._remarks: list[str] = []

    def remark(self, text: str) -> None:
        """Add a remark on what the file does not reproduce."""
        self._remarks.append(text)

    def text(self) -> str:
        """Return the file."""
        inputs: dict[str, list[tuple[float, Any]]] = {}
        faults: dict[str, list[tuple[float, Any]]] = {}
        for at, acts in self._entries:
            for name, value in acts.get("set", {}).items():
                inputs.setdefault(name, []).append((at, value))
            for name, value in acts.get("fault", {}).items():
                faults.setdefault(name, []).append((at, value))
        body = self._command(self._commands() + self._constants(inputs.pop("command", [])))
        parameters = {name: inputs.pop(name) for name in [*inputs] if "." in name}
        for name, changes in inputs.items():
            body += self._input(name, changes)
        for name, changes in faults.items():
            body += self._fault(name, changes)
        body += self._parameters(parameters)
        unit, duration = self._unit, max(round(self._end, 6), 0.1)
        head = [
            f"# What was done on the live bench: {unit.actuator.name}, {unit.fidelity} fidelity, "
            f"seed {unit.seed}.",
            *(f"# {remark}" for remark in self._remarks),
            f'duration = "{duration} s"',
        ]
        text = "\n".join([*head, "", *body])
        return re.sub(r"\n{3,}", "\n\n", text).rstrip() + "\n"

    def _commands(self) -> list[tuple[float, Any]]:
        """Instant and command, None where it holds what it finds."""
        out: list[tuple[float, Any]] = []
        block: Mapping[str, Any] | None = None
        for at, acts in self._entries:
            block = acts.get("block", block)
            if acts.get("panel") == "move" and block is not None:
                out.append((at, block))
            elif acts.get("panel") in ("stop", "home", "disable", "enable", "reset"):
                out.append((at, None))
            if "command" in acts:
                out.append((at, acts["command"]))
        return out

    @staticmethod
    def _constants(changes: Sequence[tuple[float, Any]]) -> list[tuple[float, Any]]:
        return [(at, {"terms": [{"kind": "constant", "value": value}]}) for at, value in changes]

    def _command(self, commands: list[tuple[float, Any]]) -> list[str]:
        commands = sorted(commands, key=lambda each: each[0])
        given = [(at, command) for at, command in commands if command is not None]
        if not given:
            return ["[command]", f'mode = "{self._mode}"', ""]
        modes = {command.get("mode", self._mode) for _, command in given} | {self._mode}
        if len(modes) > 1:
            self.remark("the mode was changed on the way; a scenario has one, that of the start")
            given = [each for each in given if each[1].get("mode", self._mode) == self._mode]
        lines = ["[command]", f'mode = "{self._mode}"']
        if self._mode == "gear":
            return [*lines, *self._steps(given), ""]
        if len(commands) > 1:
            self.remark(f"the last of {len(commands)} commands is here; stop and home are none")
        for at, command in given[-1:]:
            lines += self._from(at, command["terms"], "command")
        return [*lines, ""]

    @staticmethod
    def _steps(given: Sequence[tuple[float, Any]]) -> list[str]:
        lines: list[str] = []
        for at, command in given:
            for step in command.get("steps", ()):
                time = parse_quantity(step["time"], "s", "time") + at
                lines += ["", "[[command.steps]]", *_keys({**step, "time": time})]
        return lines

    def _from(self, at: float, terms: Sequence[Mapping[str, Any]], port: str) -> list[str]:
        """Return terms that act from an instant on; what they hold before it is taken off."""
        # A constant acts always, so it becomes a step.
        steps = [
            {"kind": "step", "final": term["value"], "time": at}
            if term["kind"] == "constant"
            else moved(dict(term), at)
            for term in terms
        ]
        unit = self._units[port]
        read = validated(Terms, {"terms": steps}, Document(port, "", {}))
        before = float(evaluate_terms(read.terms, unit, [0.0], port)[0]) if at > 0.0 else 0.0
        if before != 0.0:
            steps.append(_step(at, initial=-before, final=0.0, unit=unit))
        return _tables(_place(port), steps)

    def _input(self, name: str, changes: Sequence[tuple[float, Any]]) -> list[str]:
        if any(isinstance(value, Mapping) for _, value in changes):
            return self._waveform(name, changes)
        unit, steps = self._units[name], list[dict[str, Any]]()
        before = self._resting(name)
        for at, value in changes:
            number = parse_quantity(value, unit, name)
            if not steps:
                steps.append(_step(at, initial=before, final=number, unit=unit))
            else:
                # Off before on: what is left in between is zero, and no bit is lost.
                steps.append(_step(at, initial=0.0, final=-before, unit=unit))
                steps.append(_step(at, initial=0.0, final=number, unit=unit))
            before = number
        return [*_tables(_place(name), steps), ""]

    def _waveform(self, name: str, changes: Sequence[tuple[float, Any]]) -> list[str]:
        at, value = changes[-1]
        if len(changes) > 1 or self._resting(name) != 0.0:
            self.remark(f"{name}: a waveform; what it was before {at:g} s is not in here")
        if not isinstance(value, Mapping):
            value = {"terms": [{"kind": "constant", "value": value}]}
        return [*self._from(at, value.get("terms", [value]), name), ""]

    def _resting(self, name: str) -> float:
        values = self._unit.actuator.parameters
        path = _RESTING.get(name, "")
        return float(values.value(path)) if path in values else 0.0

    def _fault(self, name: str, changes: Sequence[tuple[float, Any]]) -> list[str]:
        """Return a fault's table; several severities are the points of its profile."""
        kind, _, place = name.partition("@")
        record = find_record(kind, place, self._unit.actuator.wiring, name)
        tables = [dict(v) if isinstance(v, Mapping) else {"severity": v or 0.0} for _, v in changes]
        by_time = {
            at: record.read_severity(table.pop("severity", 0.0), name)
            for (at, _), table in zip(changes, tables, strict=True)
        }
        points = [*by_time.items()]
        most = max((severity for _, severity in points), key=abs)
        if most == 0.0:
            return []
        if any(table != tables[-1] for table in tables[:-1]):
            self.remark(f"{name}: what is stated beside its severity is that of the end")
        first = points[0][0]
        profile: dict[str, Any] = {"kind": "step", "time": first} if first > 0.0 else {}
        if len(points) > 1:
            self.remark(f"{name}: goes from one severity to the next within a nanosecond")
            profile = _profile(points, most)
        severity = f"{most!r} {record.unit}" if record.unit not in ("", "1") else most
        fault = Fault.from_dict({"kind": kind, "place": place, "severity": severity, **tables[-1]})
        lines = ["[[fault]]", *_keys({k: v for k, v in fault.to_dict().items() if k != "profile"})]
        if profile:
            inner = ", ".join(_keys(profile))
            lines.append(f"profile = {{ {inner} }}")
        return [*lines, ""]

    def _parameters(self, parameters: Mapping[str, Sequence[tuple[float, Any]]]) -> list[str]:
        if not parameters:
            return []
        if any(at > 0.0 for changes in parameters.values() for at, _ in changes):
            self.remark("parameters stand from the start here; they were changed on the way")
        return ["[parameters]", *(f'"{p}" = {json.dumps(c[-1][1])}' for p, c in parameters.items())]


def _place(port: str) -> str:
    return f"load.{port}" if port in _LOADS else port


def _step(at: float, *, initial: float, final: float, unit: str) -> dict[str, Any]:
    def written(value: float) -> Any:
        return value if unit in ("", "1") else f"{value!r} {unit}"

    return {"kind": "step", "initial": written(initial), "final": written(final), "time": at}


def _profile(points: Sequence[tuple[float, float]], most: float) -> dict[str, Any]:
    times, values, before = [], [], 0.0
    for at, severity in points:
        edge = [at, at + _EDGE] if at > 0.0 else [at]
        times += edge
        values += [before / most, severity / most][-len(edge) :]
        before = severity
    return {"kind": "table", "times": times, "values": values}


def _tables(place: str, tables: Sequence[Mapping[str, Any]]) -> list[str]:
    return [line for table in tables for line in ("", f"[[{place}.terms]]", *_keys(table))]


def _keys(table: Mapping[str, Any]) -> list[str]:
    return [f"{key} = {json.dumps(value)}" for key, value in table.items()]


_MOST = 2000  # entries: a slider that is moved for minutes
_QUIET = ("record", "save", "factor", "pause", "restart", "repeat")  # none acts on the actuator


def moved_command(given: Mapping[str, Any], start: float) -> dict[str, Any]:
    """Return a command with its instants moved to a start [s], as a note states it."""
    out = dict(given)
    if "terms" in given:
        out["terms"] = [moved(dict(term), start) for term in given["terms"]]
    if "steps" in given:
        out["steps"] = [
            {**step, "time": max(0.0, parse_quantity(step["time"], "s", "time") + start)}
            for step in given["steps"]
        ]
    return out


class Journal:
    """The actions on a unit with their instants, counted from its last start from rest.

    Parameters
    ----------
    unit : LiveUnit
        What runs.
    """

    def __init__(self, unit: LiveUnit) -> None:
        self._unit = unit
        self.begin()

    def begin(self) -> None:
        """Clear the journal: the unit has started from rest with its present settings."""
        unit = self._unit
        self.zero, self.mode = unit.time, unit.mode
        self._missed = 0
        self._entries: list[Act] = []
        standing = {
            "set": dict(unit.inputs),
            "fault": {
                name: {"severity": fault.severity, **fault.attributes}
                for name, fault in unit.faults.items()
            },
        }
        self.note({key: value for key, value in standing.items() if value})

    def note(self, done: Mapping[str, Any]) -> None:
        """Record an action at the present instant."""
        acts = {key: value for key, value in done.items() if key not in _QUIET}
        if acts and len(self._entries) < _MOST:
            self._entries.append((round(self._unit.time - self.zero, 9), acts))
        elif acts:
            self._missed += 1

    def steps(self) -> list[dict[str, Any]]:
        """Return the actions with their instants [s], as a bench takes them to repeat them."""
        return [{"time": 0.0, "mode": self.mode}, *({"time": t, **a} for t, a in self._entries)]

    def scenario(self) -> str:
        """Return a scenario file that repeats the actions; comments state what it cannot repeat.

        Raises
        ------
        InputError
            Nothing was done that a scenario could hold.
        """
        if not self._entries:
            raise InputError("save: nothing was done yet")
        end = self._unit.time - self.zero
        writer = ScenarioWriter(self._unit, self.mode, self._entries, end)
        if self._missed:
            writer.remark(f"{self._missed} acts more than {_MOST} are not in here")
        return writer.text()
