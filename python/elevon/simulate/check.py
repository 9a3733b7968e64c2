"""Everything that is wrong with an actuator file or a scenario file, at once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from elevon.actuator import Actuator
from elevon.documents import Document, read_toml
from elevon.errors import InputError
from elevon.parameters import load_set, set_errors
from elevon.parameters.records import wirings
from elevon.scenario import Scenario
from elevon.scenario.compile import compile_scenario
from elevon.scenario.scenario import check_units
from elevon.simulate.acting import idle_values

#: In the order in which findings are listed; a note needs nothing to be done.
SEVERITIES = ("error", "warning", "note")


@dataclass(frozen=True)
class FileFinding:
    """What is to be said of a file.

    Attributes
    ----------
    severity : str
        One of `SEVERITIES`.
    message : str
        The finding in words.
    group, name : str
        What findings that differ only in a name have in common, and the name; else empty.
    """

    severity: str
    message: str
    group: str = ""
    name: str = ""

    def to_dict(self) -> dict[str, str]:
        """Return the finding as plain types; a group only where it has one."""
        return {key: value for key, value in vars(self).items() if value}


@dataclass(frozen=True)
class FileCheck:
    """Findings of one file.

    Attributes
    ----------
    kind : str
        ``set`` or ``scenario``.
    findings : list of FileFinding
        Errors first.
    """

    kind: Literal["set", "scenario"]
    findings: list[FileFinding]

    @property
    def failed(self) -> bool:
        """Whether any finding is an error."""
        return any(item.severity == "error" for item in self.findings)

    def count(self, severity: str) -> int:
        """Return how many findings have a severity."""
        return sum(item.severity == severity for item in self.findings)


def check_file(file: Path, actuator: str | None = None) -> FileCheck:
    """Return every finding of an actuator file or a scenario file; nothing is simulated.

    Parameters
    ----------
    file : path
        An actuator file or a scenario (TOML).
    actuator : str, optional
        Of a scenario: its signals, faults and parameters are checked, too.

    Raises
    ------
    InputError
        The file cannot be read as TOML.
    """
    document = read_toml(file)
    # A set has groups of the same names: load.mass.
    top_keys = {"name", "base", "wiring"} & document.data.keys()
    words = {"duration", "command", "load", "supply", "ambient", "initial"} & document.data.keys()
    if words and not top_keys:
        return FileCheck("scenario", _of_scenario(file, actuator))
    return FileCheck("set", _of_set(file))


def _of_scenario(file: Path, reference: str | None) -> list[FileFinding]:
    try:
        scenario = Scenario.load(file)
        if reference is not None:
            base = Actuator.load(reference)
            model = base.with_values(scenario.parameters, place=str(file))
            compile_scenario(scenario, model.wiring, "high")
    except InputError as error:
        return [FileFinding("error", line) for line in str(error).splitlines()]
    return []


def _of_set(file: Path) -> list[FileFinding]:
    """Return what loading says, or where it loads, what the core says of the values together."""
    lines = [*set_errors(file), *_own_scenarios(file)]
    if lines:
        return [FileFinding("error", line) for line in lines]
    try:
        return _together(file)
    except InputError as error:
        return [FileFinding("error", line) for line in str(error).splitlines()]


def _own_scenarios(file: Path) -> list[str]:
    """Return what is wrong with the units of the scenarios that a set brings."""
    document = read_toml(file)
    compare = document.data.get("compare")
    given: dict[tuple[str, ...], Any] = {("scenario",): document.data.get("scenario")}
    if isinstance(compare, dict):
        given["compare", "scenario"] = compare.get("scenario")
    lines: list[str] = []
    for prefix, data in given.items():
        try:
            if isinstance(data, dict):
                check_units(Document(document.origin, document.text, data, prefix=prefix))
        except InputError as error:
            lines += str(error).splitlines()
    return lines


def _together(file: Path) -> list[FileFinding]:
    actuator = Actuator.load(file)
    rows: dict[str, FileFinding] = {}
    for fidelity in wirings()[actuator.wiring]["fidelities"]:
        for item in actuator.findings(fidelity):
            start = "" if item["message"].startswith(item["path"]) else f"{item['path']}: "
            text = f"{start}{item['message']} ({fidelity} fidelity)"
            rows.setdefault(item["message"], FileFinding(str(item["severity"]), text))
    findings = [*rows.values(), *_unsaid(actuator), *_idle(actuator, file)]
    return sorted(findings, key=lambda row: SEVERITIES.index(row.severity))


def _unsaid(actuator: Actuator) -> list[FileFinding]:
    return [
        _grouped("warning", "no source is stated for", f"{item.path} = {item.text}")
        for item in actuator.parameters.values()
        if item.confidence == "unknown"
    ]


def _idle(actuator: Actuator, file: Path) -> list[FileFinding]:
    """Return what the file states that acts at no fidelity as long as the rest stays."""
    idle = idle_values(actuator, sorted(load_set(file).stated))
    return [_grouped("note", f"without effect, {why}", name) for name, why in idle.items()]


def _grouped(severity: str, group: str, name: str) -> FileFinding:
    return FileFinding(severity, f"{name}: {group}", group, name)
