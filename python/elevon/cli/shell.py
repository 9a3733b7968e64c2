"""The shell of a command: the options that many share, the report, and what is printed."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any

import typer

from elevon.cli.help import PlainCommand
from elevon.cli.options import declared, shared_option
from elevon.cli.output import print_json, say
from elevon.files import check_output
from elevon.report import Report
from elevon.results import Result

#: Options that a command names instead of taking them: type and default. The callbacks of some do
#: their work.
_SHARED: Mapping[str, tuple[object, object]] = {
    "strict": (bool, False),
    "details": (bool, False),
    "json": (bool, False),
    "report": (Path | None, None),
    "force": (bool, False),
    "date": (str | None, None),
}


@dataclass(frozen=True)
class Answer:
    """What a command has found.

    Attributes
    ----------
    data : mapping or Result
        What ``--json`` prints.
    show : callable
        Prints it for a person.
    code : int
        Exit code.
    page : callable, optional
        The page that ``--report`` writes; given the date where the command has that option.
    """

    data: Mapping[str, Any] | Result
    show: Callable[[], None]
    code: int = 0
    page: Callable[..., Report] | None = None


def command(
    app: typer.Typer, *shared: str, name: str | None = None
) -> Callable[[Callable[..., Answer]], Callable[..., Answer]]:
    """Return a decorator that adds a command with ``--json`` and the shared options it names.

    ``report`` is written before the answer, and refused before the work where it cannot be.
    """

    def add(work: Callable[..., Answer]) -> Callable[..., Answer]:
        app.command(name, cls=PlainCommand)(_shell(work, (*shared, "json")))
        return work

    return add


def add_plain(
    app: typer.Typer, name: str | None = None
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that adds a function as a command that prints and exits by itself."""

    def add(work: Callable[..., Any]) -> Callable[..., Any]:
        app.command(name, cls=PlainCommand)(styled(work))
        return work

    return add


def styled(work: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function whose parameters have what `options.toml` says of them."""
    work.__annotations__ = declared(work)
    return work


def _shell(work: Callable[..., Answer], shared: tuple[str, ...]) -> Callable[..., int]:
    parameters = inspect.signature(work).parameters
    extra = [name for name in shared if name not in parameters]
    hints = declared(work) | {name: shared_option(name, _SHARED[name][0]) for name in extra}

    @wraps(work)
    def shell(**options: Any) -> int:
        values = {name: options.pop(name) for name in extra}
        report, force = values.get("report"), {**options, **values}.get("force", False)
        if report is not None:
            check_output(report, force=force)
        result = work(**options)
        if report is not None and result.page is not None:
            page = result.page(date=values["date"]) if "date" in values else result.page()
            say(f"report: {page.save(report, force=force)}")
        if values["json"]:
            data = result.data
            print_json(data.to_dict(stored=False) if isinstance(data, Result) else data)
        else:
            result.show()
        return result.code

    kind = inspect.Parameter.KEYWORD_ONLY
    options = [
        inspect.Parameter(name, kind, default=_SHARED[name][1], annotation=hints[name])
        for name in extra
    ]
    leading = [item.replace(annotation=hints[name]) for name, item in parameters.items()]
    shell.__signature__ = inspect.Signature([*leading, *options])  # type: ignore[attr-defined]
    shell.__annotations__ = hints
    del shell.__dict__["__wrapped__"]
    return shell
