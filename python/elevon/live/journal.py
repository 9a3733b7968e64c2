"""What was done to a live bench, and the scenario that does it again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from elevon.bench.rig import moved
from elevon.errors import InputError
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from elevon.actuator import Actuator


_MOST = 2000  # entries: a slider that is moved for minutes
_QUIET = ("record", "save", "factor", "pause")  # nothing of these acts on the actuator
_LOADS = ("brake", "shaft", "output", "weight_on_wheels")


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
    """The acts of a session with their instants.

    Parameters
    ----------
    actuator, fidelity, seed
        Of what runs.
    """

    def __init__(self, actuator: Actuator, fidelity: str, seed: int) -> None:
        self._actuator, self._fidelity, self._seed = actuator, fidelity, seed
        self._entries: list[tuple[float, dict[str, Any]]] = []

    def note(self, time: float, done: Mapping[str, Any]) -> None:
        """Note what was done at an instant [s]."""
        acts = {key: value for key, value in done.items() if key not in _QUIET}
        if acts.get("restart"):
            self._entries = []
        if acts and len(self._entries) < _MOST:
            self._entries.append((time, acts))

    def steps(self) -> list[dict[str, Any]]:
        """Return the acts, each with its instant [s]; a link holds them."""
        return [{"time": round(time, 4), **acts} for time, acts in self._entries]

    def scenario(self, end: float) -> str:
        """Return a scenario file that does what was done; comments state what none can.

        Raises
        ------
        InputError
            Nothing was done that a scenario could hold.
        """
        if not self._entries:
            raise InputError("save: nothing was done yet")
        return _Writer(self._actuator, self._fidelity, self._entries, end).text()


class _Writer:
    """Turns acts into the tables of a scenario file."""

    def __init__(
        self, actuator: Actuator, fidelity: str, entries: list[tuple[float, dict[str, Any]]],
        end: float,
    ) -> None:  # fmt: skip
        self._actuator, self._fidelity = actuator, fidelity
        self._entries, self._end = entries, end
        self._zero = entries[0][0]
        self._remarks: list[str] = []
        self._block: Mapping[str, Any] | None = None

    def text(self) -> str:
        commands, values, faults, parameters = [], {}, {}, {}  # type: ignore[var-annotated]
        for time, acts in self._entries:
            at = round(time - self._zero, 6)
            for name, value in acts.get("set", {}).items():
                if "." in name:
                    parameters.setdefault(name, []).append((at, value))
                else:
                    values.setdefault(name, []).append((at, value))
            for name, value in acts.get("fault", {}).items():
                faults.setdefault(name, []).append((at, value))
            commands += self._commands(at, acts)
        body = [*self._command(commands), *self._inputs(values), *self._faults(faults)]
        body += self._parameters(parameters)
        duration = max(round(self._end - self._zero, 3), 0.1)
        head = [
            f"# What was done on the live bench: {self._actuator.name}, {self._fidelity} fidelity.",
            *(f"# {remark}" for remark in self._remarks),
            f'duration = "{duration} s"',
        ]
        return "\n".join([*head, "", *body]) + "\n"

    def _commands(self, at: float, acts: Mapping[str, Any]) -> list[tuple[float, Any]]:
        out: list[tuple[float, Any]] = []
        if "block" in acts:
            self._block = acts["block"]
        if acts.get("panel") == "move" and self._block is not None:
            out.append((at, self._block))
        elif acts.get("panel") in ("stop", "home", "disable"):
            out.append((at, None))
        if "command" in acts:
            out.append((at, acts["command"]))
        return out

    def _command(self, commands: list[tuple[float, Any]]) -> list[str]:
        given = [(at, command) for at, command in commands if command is not None]
        if not given:
            return []
        first = given[0][1]
        if first.get("mode") == "gear":
            return self._steps(given)
        mode = first.get("mode", "position")
        lines = ["[command]", f'mode = "{mode}"']
        if len(commands) > len(given):
            self._remarks.append("stop and home hold the position they find: not in here")
        if len(given) > 1:
            self._remarks.append(f"{len(given)} commands followed each other; the last one is here")
        at, last = given[-1]
        for term in moved_command(last, at).get("terms", ()):
            lines += ["", "[[command.terms]]", *_keys(term)]
        return [*lines, ""]

    def _steps(self, given: list[tuple[float, Any]]) -> list[str]:
        lines = ["[command]", 'mode = "gear"']
        for at, command in given:
            for step in moved_command(command, at).get("steps", ()):
                lines += ["", "[[command.steps]]", *_keys(step)]
        return [*lines, ""]

    def _inputs(self, values: Mapping[str, list[tuple[float, Any]]]) -> list[str]:
        lines: list[str] = []
        for name, changes in values.items():
            place = f"load.{name}" if name in _LOADS else name
            for index, (at, value) in enumerate(changes):
                if isinstance(value, Mapping):
                    self._remarks.append(f"{name}: a waveform from {at:g} s on: not in here")
                    continue
                before = changes[index - 1][1] if index else 0.0
                if isinstance(before, Mapping):
                    before = 0.0
                lines += [f"[[{place}.terms]]", 'kind = "step"', f"time = {at!r}"]
                lines += [f"final = {json.dumps(value)}"]
                if index:
                    lines += ["", f"[[{place}.terms]]", 'kind = "step"', f"time = {at!r}"]
                    lines += [f"final = {json.dumps(_negative(before))}"]
                lines.append("")
        return lines

    def _faults(self, faults: Mapping[str, list[tuple[float, Any]]]) -> list[str]:
        lines: list[str] = []
        for name, changes in faults.items():
            kind, _, place = name.partition("@")
            at, value = changes[-1]
            data = dict(value) if isinstance(value, Mapping) else {"severity": value or 0.0}
            if len(changes) > 1:
                self._remarks.append(f"{name}: changed {len(changes)} times; the last one is here")
            lines += ["[[fault]]", f'kind = "{kind}"', f'place = "{place}"', *_keys(data)]
            lines += [f'profile = {{ kind = "step", time = {at!r} }}', ""]
        return lines

    def _parameters(self, parameters: Mapping[str, list[tuple[float, Any]]]) -> list[str]:
        if not parameters:
            return []
        self._remarks.append("parameters stand from the start here; they were changed on the way")
        return ["[parameters]", *(f'"{p}" = {json.dumps(c[-1][1])}' for p, c in parameters.items())]


def _negative(value: Any) -> Any:
    if isinstance(value, str):
        return value[1:] if value.lstrip().startswith("-") else f"-{value.lstrip()}"
    return -value


def _keys(table: Mapping[str, Any]) -> list[str]:
    return [f"{key} = {json.dumps(value)}" for key, value in table.items()]
