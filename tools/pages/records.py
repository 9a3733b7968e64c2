"""The reference, made from the records that the program itself works by; nothing of it by hand."""

import importlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

import elevon
from elevon import _core, errors
from elevon.actuator import Actuator, list_actuators
from elevon.cli.help import example_of, help_rows
from elevon.cli.registry import commands as entries
from elevon.extras import APART, EXTRAS
from elevon.prognose import LAWS

WIRINGS = [item["name"] for item in _core.wirings()]


def pages(root: Path) -> Iterator[tuple[str, str]]:  # noqa: ARG001 - the same for each module
    """Yield name and text of each page."""
    yield from commands()
    yield "reference/python-api.md", api()
    for wiring in WIRINGS:
        yield f"reference/records/parameters-{wiring}.md", parameters(wiring)
        yield f"reference/records/faults-{wiring}.md", faults(wiring)
        yield f"reference/records/signals-{wiring}.md", signals(wiring)
    for name in shipped():
        yield f"reference/records/actuator-{name}.md", actuator(name)
    yield "reference/records/features.md", features()
    yield "reference/records/laws.md", laws()
    yield "reference/records/waveforms.md", waveforms()
    yield "reference/records/errors.md", error_family()
    yield "reference/records/extras.md", extras()


def shipped() -> list[str]:
    """Return the names of the actuators in the package."""
    return sorted(item if isinstance(item, str) else item.name for item in list_actuators())


def plain(text: object) -> str:
    """Return a text as Markdown that shows it unchanged, within one table cell."""
    words = " ".join(str(text).split())
    for mark in "\\`*_$[]":
        words = words.replace(mark, f"\\{mark}")
    return words.replace("|", "\\|").replace("<", "&lt;").replace(">", "&gt;")


def code(text: object) -> str:
    """Return a text as code within one table cell."""
    return f"`{text}`".replace("|", "\\|") if str(text) else ""


def table(head: list[str], rows: list[list[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def span(record: dict) -> str:
    """Return the range of a parameter or a fault as an interval."""
    low, high = record["minimum"], record["maximum"]
    left = "(" if record["minimum_open"] or not math.isfinite(low) else "["
    right = ")" if record.get("maximum_open") or not math.isfinite(high) else "]"
    words = [f"{value:g}" if math.isfinite(value) else "no limit" for value in (low, high)]
    return f"{left}{words[0]}, {words[1]}{right}"


def commands() -> Iterator[tuple[str, str]]:
    """Yield a page for each command."""
    for name, entry in entries().items():
        command = typer.main.get_command(importlib.import_module(entry.module).app)
        yield f"reference/commands/{name}.md", f"# elevon {name}\n\n" + _command(command, name)


def _command(command: Any, path: str) -> str:
    """Return usage, text, arguments and options of a command, and of what is below it."""
    context = command.context_class(command, info_name=f"elevon {path}")
    usage = command.get_usage(context).removeprefix("Usage: ")
    text = f"{_help(command.help)}\n\n```text\n{usage}\n```\n\n"
    lines = [row for _, group in help_rows(command, context) for row in group]
    rows = [[code(name), plain(meaning)] for name, meaning in lines]
    rows = [row for row in rows if "-completion" not in row[0]]
    if rows:
        text += table(["name", "meaning"], rows) + "\n"
    example = example_of(command, context.command_path)
    if example:
        text += f"```text\n{example}\n```\n\n"
    if hasattr(command, "list_commands"):
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            text += f"## {path} {name}\n\n" + _command(below, f"{path} {name}")
    return text


def _help(text: str | None) -> str:
    return "\n\n".join(plain(part) for part in (text or "").replace("\b", "").split("\n\n"))


def api() -> str:
    """Return the page of the public names, by autodoc."""
    text = (
        "# Python API\n\nEvery name of `import elevon`, from its docstring. Numbers are SI; texts "
        "carry units.\n\n"
    )
    for name in sorted(elevon.__all__, key=str.lower):
        if name.startswith("__"):
            continue
        kind = "autoclass" if isinstance(getattr(elevon, name), type) else "autofunction"
        members = "\n   :members:" if kind == "autoclass" else ""
        text += f"```{{eval-rst}}\n.. {kind}:: elevon.{name}{members}\n```\n\n"
    return text


def parameters(wiring: str) -> str:
    """Return the page of a wiring's parameters."""
    rows = [
        [
            code(r["path"]), plain(r["symbol"]), plain(r["unit"]),
            plain(" or ".join(r["choices"]) if r["choices"] else span(r)),
            plain(", ".join(r["fidelities"])), plain(r["text"] + _when(r)),
        ]
        for r in _core.parameters(wiring)
    ]  # fmt: skip
    head = ["path", "symbol", "unit", "range or choices", "fidelity", "meaning"]
    lead = f"{len(rows)} parameters of the wiring `{wiring}`, in SI.\n\n"
    return f"# Parameters of {wiring}\n\n{lead}{table(head, rows)}"


def _when(record: dict) -> str:
    where = "; where " + " and ".join(record["when"]) if record["when"] else ""
    return where + "".join(f"; not {f}: {why}" for f, why in record["not_modelled"].items())


def faults(wiring: str) -> str:
    """Return the page of a wiring's faults."""
    text = f"# Faults of {wiring}\n\nGrammar of a fault: [faults](../faults.md).\n\n"
    for r in _core.faults(wiring):
        unit = "" if r["unit"] == "1" else f" {r['unit']}"
        text += f"## {r['kind']}\n\n{plain(r['effect'])}\n\n"
        text += f"* Places: {', '.join(code(p) for p in r['places'])}\n"
        text += (
            f"* Severity: {plain(span(r))}{plain(unit)}{' (whole numbers)' if r['whole'] else ''}\n"
        )
        text += f"* Fidelities: {', '.join(r['fidelities'])}\n"
        text += "".join(f"* Not {f}: {plain(why)}\n" for f, why in r["not_modelled"].items())
        for attribute in r["attributes"]:
            text += f"* Attribute {code(attribute['name'])} [{plain(attribute['unit'])}]: "
            text += f"{plain(attribute['text'])}\n"
        text += f"* Rate: {r['rate']:g} an hour ({plain(r['rate_source'])})\n"
        text += f"* Source: {plain(r['source'])}\n\n"
    return text


def signals(wiring: str) -> str:
    """Return the page of a wiring's signals."""
    high, low = ({s["name"]: s for s in _core.signals(wiring, f)} for f in ("high", "low"))
    rows = []
    for name, r in {**low, **high}.items():
        where = [f for f, known in (("high", high), ("low", low)) if name in known]
        row = [code(name), plain(r["symbol"]), plain(r["unit"]), plain(", ".join(where))]
        rows.append([*row, code(r["role"] or ""), plain(r["text"])])
    head = ["signal", "symbol", "unit", "fidelity", "role in a log", "meaning"]
    ports = [[code(p["name"]), plain(p["unit"]), plain(p["text"])] for p in _core.ports(wiring)]
    return (
        f"# Signals of {wiring}\n\n{table(head, rows)}\n## Inputs\n\n"
        f"{table(['input', 'unit', 'meaning'], ports)}"
    )


def actuator(name: str) -> str:
    """Return the page of a shipped actuator: each value with its source."""
    unit = Actuator.load(name)
    rows = [
        [code(p.path), plain(p.value), plain(p.unit), plain(p.confidence), plain(p.source),
         plain(p.note)]
        for p in unit.parameters.values()
    ]  # fmt: skip
    head = ["path", "value", "unit", "confidence", "source", "note"]
    return f"# {name}\n\n{plain(unit.title)}. Wiring: `{unit.wiring}`.\n\n{table(head, rows)}"


def features() -> str:
    """Return the page of the features of a motion."""
    rows = [
        [code(r["name"]), plain(r["unit"]), plain(r["family"]), plain(", ".join(r["roles"])),
         plain(r["text"])]
        for r in _core.feature_records()
    ]  # fmt: skip
    head = ["feature", "unit", "family", "channels it needs, by role", "meaning"]
    return f"# All features\n\n{table(head, rows)}"


def laws() -> str:
    """Return the page of the laws of growth."""
    text = (
        "# Laws of growth\n\nWhat makes a fault grow with use: "
        "[prognosis](../../explanation/prognosis.md).\n\n"
    )
    for law in LAWS.values():
        text += (
            f"## {law.name}\n\n{plain(law.text)}: `{law.kind}@{law.place}` [{plain(law.unit)}].\n\n"
        )
        text += f"* Source: {plain(law.source)}\n* Driven by: {plain(', '.join(law.drivers))}\n"
        for name, c in law.coefficients.items():
            text += f"* {code(name)} = {c.value:g} {plain(c.unit)}: {plain(c.source)}\n"
        text += "\n"
    return text


def waveforms() -> str:
    """Return the page of waveforms and of the profiles of faults."""
    text = "# Waveforms and profiles\n\n## Waveforms of commands and loads\n\n"
    text += _kinds(_core.waveforms()) + "## Profiles of faults over time\n\n"
    return text + _kinds(_core.profiles())


def _kinds(kinds: list[dict]) -> str:
    text = ""
    for kind in kinds:
        text += f"* {code(kind['kind'])}: {plain(kind['text'])}\n"
        for p in kind["parameters"]:
            unit = p["unit"] or "the quantity's own"
            default = "" if p["default"] is None else f", default {p['default']:g}"
            text += f"  * {code(p['name'])} [{plain(unit)}{default}]: {plain(p['text'])}\n"
    return text + "\n"


def error_family() -> str:
    """Return the page of the exceptions and warnings."""
    rows = [
        [code(c.__name__), code(c.__mro__[1].__name__), plain((c.__doc__ or "").split("\n\n")[0])]
        for c in vars(errors).values()
        if isinstance(c, type) and issubclass(c, Exception) and c.__module__ == errors.__name__
    ]
    exits = (
        "Exit codes of every command: 0 done, 1 a run or a check failed, 2 bad usage or input, "
        "130 interrupted, 143 terminated.\n"
    )
    return f"# Errors\n\n{table(['error', 'is a', 'raised for'], rows)}\n{exits}"


def extras() -> str:
    """Return the page of the optional packages."""
    rows = [
        [code(name), plain(", ".join(packages)), "no" if name in APART else "yes"]
        for name, packages in EXTRAS.items()
    ]
    return f"# Extras\n\n{table(['extra', 'packages', 'part of `all`'], rows)}"
