"""``elevon check``: everything that is wrong with a set or a scenario, at once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer

from elevon.cli.output import answer, print_table
from elevon.cli.shell import Answer, command

app = typer.Typer(rich_markup_mode=None)

#: In the order in which findings are printed; a note needs nothing to be done.
_SEVERITIES = ("error", "warning", "note")


@command(app)
def check(
    file: Path,
    *,
    actuator: str | None = None,
) -> Answer:
    """Report every finding of an actuator file or a scenario file; nothing is simulated."""
    from elevon.documents import read_toml

    document = read_toml(file)  # a file that cannot be read is bad usage, not a finding
    # A set has groups of the same names: load.mass.
    top_keys = {"name", "base", "wiring"} & document.data.keys()
    words = {"duration", "command", "load", "supply", "ambient", "initial"} & document.data.keys()
    scenario = bool(words) and not top_keys
    rows = _of_scenario(file, actuator) if scenario else _of_set(file)
    failed = any(row["severity"] == "error" for row in rows)
    data = {
        "status": "fail" if failed else "pass",
        "file": str(file),
        "kind": "scenario" if scenario else "set",
        "findings": rows,
    }

    return Answer(data, lambda: _print(file, rows), 1 if failed else 0)


def _print(file: Path, rows: list[dict[str, Any]]) -> None:
    counts = {name: sum(row["severity"] == name for row in rows) for name in _SEVERITIES}
    notes = f", {counts['note']} notes" if counts["note"] else ""
    answer(f"{file}: {counts['error']} errors, {counts['warning']} warnings{notes}")
    if rows:
        print_table(("severity", "finding"), _grouped(rows))


def _grouped(rows: list[dict[str, Any]]) -> list[tuple[str, str]]:
    """Return errors first, each by itself, then the rest, those of one group in one row."""
    alone = [(row["severity"], row["message"]) for row in rows if "group" not in row]
    groups: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if "group" in row:
            groups.setdefault((row["severity"], row["group"]), []).append(row["name"])
    joined = [
        (severity, f"{group}: {', '.join(names)}") for (severity, group), names in groups.items()
    ]
    return sorted([*alone, *joined], key=lambda row: _SEVERITIES.index(row[0]))


def _of_scenario(file: Path, reference: str | None) -> list[dict[str, Any]]:
    from elevon.actuator import Actuator
    from elevon.errors import InputError
    from elevon.scenario import Scenario
    from elevon.scenario.compile import compile_scenario

    try:
        scenario = Scenario.load(file)
        if reference is not None:
            base = Actuator.load(reference)
            model = base.with_values(scenario.parameters, place=str(file))
            compile_scenario(scenario, model.wiring, "high")
    except InputError as error:
        return [_row("error", line) for line in str(error).splitlines()]
    return []


def _of_set(file: Path) -> list[dict[str, Any]]:
    """Return what loading says, or where it loads, what the core says of the values together."""
    from elevon.errors import InputError
    from elevon.parameters import set_errors

    lines = [*set_errors(file), *_own_scenarios(file)]
    if lines:
        return [_row("error", line) for line in lines]
    try:
        return _together(file)
    except InputError as error:
        return [_row("error", line) for line in str(error).splitlines()]


def _own_scenarios(file: Path) -> list[str]:
    """Return what is wrong with the units of the scenarios that a set brings."""
    from elevon.documents import Document, read_toml
    from elevon.errors import InputError
    from elevon.scenario.scenario import check_units

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


def _together(file: Path) -> list[dict[str, Any]]:
    from elevon.actuator import Actuator
    from elevon.parameters.records import wirings

    actuator = Actuator.load(file)
    rows: dict[str, dict[str, Any]] = {}
    for fidelity in wirings()[actuator.wiring]["fidelities"]:
        for item in actuator.findings(fidelity):
            start = "" if item["message"].startswith(item["path"]) else f"{item['path']}: "
            text = f"{start}{item['message']} ({fidelity} fidelity)"
            rows.setdefault(item["message"], _row(str(item["severity"]), text))
    findings = [*rows.values(), *_unsaid(actuator), *_idle(actuator, file)]
    return sorted(findings, key=lambda row: _SEVERITIES.index(row["severity"]))


def _unsaid(actuator: Any) -> list[dict[str, Any]]:
    return [
        _member("warning", "no source is stated for", f"{item.path} = {item.text}")
        for item in actuator.parameters.values()
        if item.confidence == "unknown"
    ]


def _idle(actuator: Any, file: Path) -> list[dict[str, Any]]:
    """Return what the file states that acts at no fidelity as long as the rest stays."""
    from elevon.parameters import load_set
    from elevon.simulate.acting import idle_values

    idle = idle_values(actuator, sorted(load_set(file).stated))
    return [_member("note", f"without effect, {why}", name) for name, why in idle.items()]


def _member(severity: str, group: str, name: str) -> dict[str, Any]:
    return {**_row(severity, f"{name}: {group}"), "group": group, "name": name}


def _row(severity: str, message: str) -> dict[str, Any]:
    return {"severity": severity, "message": message}
