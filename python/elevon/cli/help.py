"""How `--help` looks, in every command alike: plain text, one style of metavars, one example."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import typer
import typer.core

from elevon.data import packaged_toml

#: Options whose text is a number with its unit.
_QUANTITIES = frozenset((
    "amplitude", "area", "arm", "bias", "chord", "coil", "duration", "extension",
    "false_alarm_time", "force", "guide", "high", "limit", "load", "longest", "low", "modulus",
    "mover", "step", "strength", "torque", "travel", "window", "wire",
))  # fmt: skip


def metavar_of(name: str, kind: object) -> str:
    """Return what stands for an option's value: ``FILE``, ``N``, ``X``, ``QUANTITY``, or its name.

    Parameters
    ----------
    name : str
        Of the function's argument.
    kind : type
        Of the value, ``list`` and ``None`` beside it left out.
    """
    if kind is Path:
        return "FILE"
    if kind is int or kind is float:
        return "N" if kind is int else "X"
    return "QUANTITY" if name in _QUANTITIES else name.rpartition("_")[2].upper()


def plain_type(annotation: Any) -> Any:
    """Return the type within ``X | None`` and ``list[X]``."""
    inner = [item for item in get_args(annotation) if item is not type(None)]
    return plain_type(inner[0]) if inner else annotation


class PlainCommand(typer.core.TyperCommand):
    """A command whose help has names and metavars alone, and its example."""

    def format_usage(self, ctx: Any, formatter: Any) -> None:
        """Write the command with its arguments."""
        arguments = [p for p in self.get_params(ctx) if p.param_type_name == "argument"]
        words = ["[OPTIONS]", *(_usage(item) for item in arguments)]
        formatter.write_usage(ctx.command_path, " ".join(words))

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments and options."""
        for title, rows in help_rows(self, ctx):
            with formatter.section(title):
                formatter.write_dl(rows)

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the example."""
        write_example(self, ctx, formatter)


def _folded(example: str, width: int) -> str:
    """Return a command line, in several lines for the shell where one is too long."""
    lines = [""]
    for part in example.split(" --"):
        piece = part if not lines[0] else f"--{part}"
        if lines[-1] and len(lines[-1]) + len(piece) + 3 > width:
            lines.append(f"  {piece}")
        else:
            lines[-1] = f"{lines[-1]} {piece}".strip() if lines[0] else piece
    return " \\\n".join(f"  {line}" for line in lines)


def write_example(command: Any, ctx: Any, formatter: Any) -> None:
    """Write a command's example, where it has one."""
    example = example_of(command, ctx.command_path)
    if example:
        with formatter.section("Example"):
            formatter.write(f"{_folded(example, formatter.width - 2)}\n")


def example_of(command: Any, path: str) -> str:
    """Return the example of a command by its whole path, such as ``elevon campaign run``.

    A command of another package has the words of its example as its attribute ``example``.
    """
    name = path.partition(" ")[2]
    words = getattr(command, "example", None)
    if words is None:
        words = packaged_toml("elevon.cli", "commands.toml")["examples"].get(name)
    return "" if words is None else f"elevon {name} {words}".strip()


def help_rows(command: Any, ctx: Any) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """Yield ``Arguments`` and ``Options`` of a command, each with rows of name and meaning."""
    groups: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
    for item in command.get_params(ctx):
        record = item.get_help_record(ctx)
        if record is not None:
            kind = "Arguments" if item.param_type_name == "argument" else "Options"
            groups[kind].append((_name(item), record[1]))
    yield from ((title, rows) for title, rows in groups.items() if rows)


def _name(item: Any) -> str:
    if item.param_type_name == "argument":
        return str(item.metavar or item.name.upper())
    names = ", ".join(sorted(item.opts, key=len))
    if item.secondary_opts:
        names += f" / {', '.join(item.secondary_opts)}"
    return names if item.metavar is None else f"{names} {item.metavar}"


def _usage(item: Any) -> str:
    name = _name(item) + ("..." if item.nargs != 1 else "")
    return name if item.required else f"[{name}]"
