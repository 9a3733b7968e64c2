"""Flags, limits and help of the commands' arguments and options: `options.toml`, read.

A command's function states the type and the default of each; positional parameters are arguments,
keyword-only ones options.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Mapping
from typing import Annotated, Any, get_type_hints

import typer

from elevon.cli import completion
from elevon.cli.help import metavar_of, plain_type
from elevon.cli.output import show_details
from elevon.data import packaged_toml
from elevon.errors import ElevonWarning


def _strict(value: bool) -> bool:
    """Turn Elevon's warnings into errors for the rest of this command."""
    if value:
        warnings.simplefilter("error", ElevonWarning)
    return value


#: Options that act as soon as they are read.
_CALLBACKS: Mapping[str, Callable[[bool], bool]] = {"strict": _strict, "details": show_details}


def declared(work: Callable[..., object]) -> dict[str, Any]:
    """Return the annotations of a command's function, each type with its flags, limits and help.

    Raises
    ------
    LookupError
        A parameter that `options.toml` does not know.
    """
    hints = get_type_hints(work, include_extras=True)
    parameters = inspect.signature(work).parameters
    return {
        name: hints[name]
        if hints[name] is typer.Context
        else annotated(
            name,
            hints[name],
            _entry(work, item),
            argument=item.kind is not inspect.Parameter.KEYWORD_ONLY,
        )
        for name, item in parameters.items()
    }


def shared_option(name: str, kind: object) -> Any:
    """Return the annotation of an option that many commands share."""
    return annotated(name, kind, packaged_toml("elevon.cli", "options.toml")["options"][name])


def annotated(name: str, kind: Any, entry: Mapping[str, Any], *, argument: bool = False) -> Any:
    """Return a type with what an entry of `options.toml` says of it."""
    words = {key: entry[key] for key in ("metavar", "min", "max", "help") if key in entry}
    if "complete" in entry:
        words["autocompletion"] = getattr(completion, entry["complete"])
    if argument:
        return Annotated[kind, typer.Argument(**words)]
    inner = plain_type(kind)
    if inner is not bool:
        words.setdefault("metavar", metavar_of(name, inner))
    flags = entry.get("flags", f"--{name.replace('_', '-')}")
    names = [flags] if isinstance(flags, str) else flags
    return Annotated[kind, typer.Option(*names, callback=_CALLBACKS.get(name), **words)]


def _entry(work: Callable[..., object], item: inspect.Parameter) -> Mapping[str, Any]:
    """Return the entry of one parameter: the function's own, its module's, the shared one."""
    module = work.__module__.rpartition(".")[2]
    texts = packaged_toml("elevon.cli", "options.toml")
    of_module = texts.get(module, {})
    shared = "options" if item.kind is item.KEYWORD_ONLY else "arguments"
    for table in (of_module.get(work.__name__, {}), of_module, texts[shared]):
        entry: Mapping[str, Any] = table.get(item.name, {})
        if "help" in entry:
            return entry
    raise LookupError(f"options.toml: no entry for {item.name} of {module}.{work.__name__}")
