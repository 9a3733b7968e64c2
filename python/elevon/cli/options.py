"""Arguments and options of a command: made from the signature and docstring of its functions.

Positional parameters are arguments, keyword-only ones options; of a door the first parameter is
the argument. A type and its `elevon.option.Option` stand in the annotation, the help in the
docstring; what many commands share is stated here once, by the parameter's name.
"""

from __future__ import annotations

import inspect
import os
import types
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_origin

import typer

from elevon.cli import completion
from elevon.cli.help import metavar_of, plain_type
from elevon.cli.output import show_details
from elevon.errors import ElevonWarning
from elevon.option import Option

#: Options that many commands take, by the parameter's name.
SHARED: Mapping[str, Option] = {
    "logs": Option(metavar="LOG", help="Drive logs."),
    "folder": Option(metavar="DIR", help="The campaign's folder."),
    "history": Option(
        metavar="HISTORY",
        help="Folder of inspections (JSON); with --limit a CSV of measurements.",
    ),
    "actuator": Option(
        metavar="ACTUATOR", complete="actuators",
        help="Name of an actuator file (elevon list actuators), or a file.",
    ),
    "fault": Option(metavar="SPEC", complete="faults",
                    help="'KIND@PLACE=VALUE[unit]...'; repeatable."),
    "settings": Option("--set", "PATH=VALUE[unit]", "Change a parameter; repeatable.",
                       complete="parameters"),
    "seed": Option(min=0, help="Seed of the random numbers."),
    "fidelity": Option(complete="fidelities", help="high or low."),
    "force": Option(help="Replace existing files."),
    "loadcell": Option(help="Load-cell file; one for each log in order. "
                            "By default NAME_loadcell.csv beside it."),
    "command": Option(help="Command note; one for each log, or one for all. "
                           "By default NAME_command.json."),
    "column_map": Option("--map", help="Column map (TOML)."),
    "drive": Option(metavar="NAME", help="Which drive, where a log holds several (a1)."),
    "role": Option(metavar="ROLE=COLUMN", help="Column that has a role, where the log leaves it "
                                               "open; repeatable."),
    "threads": Option(min=1, help="Threads; default one a core."),
    "scenario": Option(help="Scenario file (TOML)."),
    "date": Option(help="Date printed in the report."),
    "baseline": Option(metavar="LOG", help="Log of the healthy unit; repeatable."),
    "mission": Option(help="What the unit does and must hold (TOML)."),
    "particles": Option(min=100, max=100_000, help="Possible units drawn."),
    "transient": Option(min=0.0, help="Left out at the beginning of each log [s]."),
    "not_modelled": Option(help="Only what a fidelity (--fidelity: this one) does not carry."),
    "report": Option(help="HTML page to write."),
    "strict": Option(help="What is set where it cannot act, and every other warning, is an error."),
    "details": Option(help="Long lists of the answer whole."),
    "json": Option(help="One JSON object on stdout."),
    "as_json": Option("--json", help="Print one JSON object."),
}  # fmt: skip
#: Options that a command names instead of taking them: type and default. The callbacks of some do
#: their work; those of the files beside logs come with the logs, ``--set`` with the actuator.
ADDED: Mapping[str, tuple[object, object]] = {
    "strict": (bool, False),
    "details": (bool, False),
    "json": (bool, False),
    "report": (Path | None, None),
    "force": (bool, False),
    "date": (str | None, None),
    "settings": (list[str] | None, None),
    "loadcell": (list[Path] | None, None),
    "command": (list[Path] | None, None),
    "column_map": (Path | None, None),
    "drive": (str | None, None),
    "role": (list[str] | None, None),
}
#: Types of what is not read as its annotation says.
_READ: Mapping[str, Any] = {"actuator": str, "file": str, "path": Path}
_NAMED = ("actuator", "file", "faults")  # how these are written is the same everywhere
#: Options that come with what an argument is read as.
ACCOMPANYING = {
    "actuator": ("settings",),
    "logs": ("loadcell", "command", "column_map", "drive", "role"),
}


def _strict(value: bool) -> bool:
    """Turn Elevon's warnings into errors for the rest of this command."""
    if value:
        warnings.simplefilter("error", ElevonWarning)
    return value


#: Options that act as soon as they are read.
_CALLBACKS: Mapping[str, Callable[[bool], bool]] = {"strict": _strict, "details": show_details}


@dataclass(frozen=True)
class CommandParameter:
    """One argument or option: what typer makes it from."""

    name: str
    kind: Any
    default: Any
    option: Option
    argument: bool

    @property
    def annotation(self) -> Any:
        """What typer reads."""
        if self.kind is typer.Context:
            return self.kind
        return annotated(self.name, self.kind, self.option, argument=self.argument)

    @property
    def signature(self) -> inspect.Parameter:
        """Its place in the signature that typer reads."""
        kind = inspect.Parameter.KEYWORD_ONLY
        return inspect.Parameter(self.name, kind, default=self.default, annotation=self.annotation)


def annotated(name: str, kind: Any, option: Option, *, argument: bool = False) -> Any:
    """Return a type with what typer needs to know of an argument or option."""
    words: dict[str, Any] = {"help": option.help or None}
    words |= {k: v for k in ("min", "max") if (v := getattr(option, k)) is not None}
    words |= {"metavar": option.metavar} if option.metavar else {}
    if option.complete:
        words["autocompletion"] = getattr(completion, option.complete)
    if argument:
        return Annotated[kind, typer.Argument(**words)]
    inner = plain_type(kind)
    if inner is not bool:
        words.setdefault("metavar", metavar_of(name, inner))
    flags = option.flags or f"--{name.replace('_', '-')}"
    names = (flags,) if isinstance(flags, str) else flags
    return Annotated[kind, typer.Option(*names, callback=_CALLBACKS.get(name), **words)]


def own_parameters(
    work: Callable[..., object], *, without: Sequence[str] = ()
) -> list[CommandParameter]:
    """Return the parameters of a command's own function, in its order.

    Raises
    ------
    LookupError
        A parameter of which neither docstring nor annotation says what it is.
    """
    return list(_parameters(work, set(without)))


def door_parameters(
    door: Callable[..., object], arguments: int = 1, *, without: Sequence[str] = ()
) -> list[CommandParameter]:
    """Return the parameters of a door as a command takes them; its first ones are arguments."""
    return list(_parameters(door, {"progress", *without}, arguments))


def added_parameter(name: str) -> CommandParameter:
    """Return an option that a command names instead of taking it."""
    kind, default = ADDED[name]
    return CommandParameter(name, kind, default, SHARED[name], argument=False)


def _parameters(
    work: Callable[..., object], without: set[str], arguments: int | None = None
) -> Iterator[CommandParameter]:
    texts = parameter_texts(inspect.getdoc(work) or "")
    names = vars(inspect.getmodule(work))
    for place, (name, item) in enumerate(inspect.signature(work).parameters.items()):
        if name in without:
            continue
        stated = item.annotation
        annotation = eval(stated, names) if isinstance(stated, str) else stated  # noqa: S307
        if annotation is typer.Context:
            yield CommandParameter(name, annotation, item.default, Option(), argument=False)
            continue
        kind, option = _command_type(annotation)
        text = "" if option.reads in _NAMED else texts.get(name, "")
        shared = SHARED.get("fault" if option.reads == "faults" else name, Option())
        option = Option(help=text).over(option).over(shared)
        if not option.help:
            raise LookupError(f"{work.__module__}.{work.__qualname__}: no text of {name}")
        default = item.default
        if isinstance(default, tuple):  # of a door: none given
            default = None
        optional = default is None and kind is not bool
        positional = item.kind is not item.KEYWORD_ONLY
        argument = positional and (arguments is None or place < arguments)
        yield CommandParameter(name, kind | None if optional else kind, default, option, argument)


def _command_type(annotation: Any) -> tuple[Any, Option]:
    """Return what the command line reads of a type: a number, a text, a path, a list of one."""
    if get_origin(annotation) is Annotated:
        inner, *about = get_args(annotation)
        kind, option = _command_type(inner)
        for item in about:
            option = item.over(option) if isinstance(item, Option) else option
        return _READ.get(option.reads, kind), option
    if get_origin(annotation) in (Union, types.UnionType):
        members = [_command_type(m) for m in get_args(annotation) if m is not type(None)]
        option = next((o for _, o in members if o != Option()), Option())
        kinds = [kind for kind, _ in members]
        for wanted in (list[Path], list[str], list[float], Path, bool, str, int, float):
            if wanted in kinds:
                return _READ.get(option.reads, wanted), option
        return kinds[0], option
    if inspect.isclass(get_origin(annotation)) and issubclass(get_origin(annotation), Sequence):
        kind, option = _command_type(get_args(annotation)[0])
        return list[plain_type(kind)], replace(option, reads="")  # type: ignore[misc]
    if get_origin(annotation) is os.PathLike:
        return Path, Option()
    return annotation, Option()


def leading_text(doc: str) -> str:
    """Return a docstring up to its first section."""
    lines = doc.splitlines()
    ends = [k - 1 for k, line in enumerate(lines) if k and line and not line.strip("-")]
    return "\n".join(lines[: ends[0]] if ends else lines).strip()


def parameter_texts(doc: str) -> dict[str, str]:
    """Return what a NumPy docstring says of each parameter: its first sentence, without marks."""
    lines = doc.splitlines()
    heads = [k for k, line in enumerate(lines[:-1]) if line and not lines[k + 1].strip("-")]
    heads = [k for k in heads if lines[k + 1]]
    start = next((k for k in heads if lines[k] == "Parameters"), None)
    if start is None:
        return {}
    end = next((k for k in heads if k > start), len(lines))
    texts: dict[str, list[str]] = {}
    names: list[str] = []
    for line in lines[start + 2 : end]:
        if line and not line.startswith(" "):
            names = [name.strip() for name in line.partition(" : ")[0].split(",")]
            texts |= {name: [] for name in names}
        elif line.strip():
            for name in names:
                texts[name].append(line.strip())
    return {name: text for name, words in texts.items() if (text := _first_sentence(words))}


def _first_sentence(words: Sequence[str]) -> str:
    text = " ".join(words).replace("`", "")
    if text.startswith(("As elevon.", "As the ")) or (text.startswith("As ") and "." in text[:40]):
        return ""
    head, dot, _ = text.partition(". ")
    return head + dot.strip()
