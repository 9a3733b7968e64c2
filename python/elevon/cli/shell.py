"""A command: its options from signatures, its answer as JSON, page or print.

A command is a function of `elevon.cli` that returns an `Answer`, or a *door* (a public function of
the package) with a function that prints its result. Of a door the command takes arguments, types,
defaults and help; logs, actuators and faults are read as `elevon.option.Option.reads` says.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from functools import wraps
from importlib import import_module
from typing import Any, cast

import typer

from elevon.cli import common
from elevon.cli.groups import CommandGroup
from elevon.cli.help import PlainCommand
from elevon.cli.options import (
    ACCOMPANYING,
    CommandParameter,
    added_parameter,
    door_parameters,
    leading_text,
    own_parameters,
)
from elevon.cli.output import print_json, print_result, progress_bar, say
from elevon.errors import BudgetError
from elevon.files import check_output
from elevon.report import Report
from elevon.results import Result

#: What most commands with a page share.
REPORT = ("strict", "details", "report", "force")


@dataclass(frozen=True)
class Answer:
    """What a command has found.

    Attributes
    ----------
    data : mapping or Result
        What ``--json`` prints.
    show : callable, optional
        Prints it for a person; default: the result as every one is printed.
    code : int
        Exit code.
    page : callable, optional
        The page that ``--report`` writes; given the date where the command has that option.
    """

    data: Mapping[str, Any] | Result
    show: Callable[[], None] | None = None
    code: int = 0
    page: Callable[..., Report] | None = None

    def print(self, *, json: bool) -> None:
        """Write it on stdout."""
        data = self.data
        if json:
            print_json(data.to_dict(stored=False) if isinstance(data, Result) else data)
        elif self.show is not None:
            self.show()
        elif isinstance(data, Result):
            print_result(data)


@dataclass(frozen=True)
class DoorCall:
    """A door with what the command line gave for it; a call reads that and runs the door.

    Attributes
    ----------
    door : callable
        The function.
    parameters : list of CommandParameter
        What the command takes for it.
    options : dict of str to object
        The options as typed, by the parameter's name, those of logs and actuator with them.
    working : str
        Shown while the door works; empty: the door reports no progress.
    """

    door: Callable[..., Any]
    parameters: list[CommandParameter]
    options: dict[str, Any]
    working: str

    def __call__(self, **changes: object) -> Any:
        """Run the door; what is given here takes the place of what was typed."""
        values = self.read(changes)
        with progress_bar(self.working) if self.working else nullcontext() as advance:
            return self.door(**values, **({"progress": advance} if self.working else {}))

    def read(self, changes: Mapping[str, object]) -> dict[str, object]:
        """Return the door's arguments: actuators first, since faults are those of one."""
        values = dict(changes)
        first = sorted(self.parameters, key=lambda item: item.option.reads != "actuator")
        for item in first:
            given = self.options.get(item.name)
            if item.name in values or given is None:
                continue
            values[item.name] = self._read(item, given, values)
        return values

    def _read(self, item: CommandParameter, given: Any, values: Mapping[str, Any]) -> object:
        options = self.options
        if item.option.reads == "actuator":
            return common.read_actuator(given, options["settings"])
        if item.option.reads == "faults":
            return common.read_faults(given, values["actuator"].wiring)
        if item.option.reads == "logs" and item.argument:
            with_logs = (options[name] for name in ("column_map", "loadcell", "command"))
            return common.read_logs(given, *with_logs, drive=options["drive"], role=options["role"])
        if item.option.reads == "logs":
            return common.read_logs(
                given, options["column_map"], drive=options["drive"], role=options["role"]
            )
        return given


@dataclass(frozen=True)
class TerminalCommand:
    """One command.

    Attributes
    ----------
    work : callable
        Returns the `Answer`; of a door, given its `DoorCall`, or prints the door's result.
    shared : tuple of str
        Options of `elevon.cli.options.ADDED` that it has with ``--json``.
    door : str
        ``MODULE:FUNCTION``; empty: the work alone.
    working : str
        Shown while the door works.
    without : tuple of str
        Parameters of the door that the command has no option for.
    help : str
        Of a command that only prints the result of its door; empty: the docstring of `work`.
    arguments : int
        How many of the door's first parameters are arguments; the others are options.
    """

    work: Callable[..., Any]
    shared: tuple[str, ...] = ()
    door: str = ""
    working: str = ""
    without: tuple[str, ...] = ()
    help: str = ""
    arguments: int = 1

    def app(self) -> typer.Typer:
        """Return the program that has this command alone."""
        app = typer.Typer(rich_markup_mode=None)
        self.add_to(app)
        return app

    def add_to(self, app: typer.Typer, name: str | None = None) -> None:
        """Add it to a group; the door's module is imported for its signature."""
        app.command(name, cls=PlainCommand)(self._shell())

    def _shell(self) -> Callable[..., int]:
        call_name = next(iter(inspect.signature(self.work).parameters), "") if self.door else ""
        own_options = [] if self.help else own_parameters(self.work, without=[call_name])
        names = {item.name for item in own_options}
        door, of_door = None, []
        if self.door:
            module, _, function = self.door.partition(":")
            door = getattr(import_module(module), function)
            of_door = door_parameters(door, self.arguments, without=[*self.without, *names])
        with_logs = dict.fromkeys(
            n for item in of_door for n in ACCOMPANYING.get(item.option.reads, ())
        )
        extra = dict.fromkeys(n for n in (*with_logs, *self.shared, "json") if n not in names)
        parameters = [*of_door, *own_options, *(added_parameter(name) for name in extra)]
        parameters.sort(key=lambda item: not item.argument)

        @wraps(self.work)
        def shell(**options: Any) -> int:
            report, force = options.get("report"), options.get("force", False)
            if report is not None:
                check_output(report, force=force)
            call = None if door is None else DoorCall(door, of_door, options, self.working)
            try:
                result = self._answer(call, {name: options[name] for name in names})
            except BudgetError as error:
                if options["json"]:  # the one error with figures that a program goes on from
                    print_json(error.to_dict())
                raise
            if report is not None and result.page is not None:
                page = result.page(date=options["date"]) if "date" in extra else result.page()
                say(f"report: {page.save(report, force=force)}")
            result.print(json=options["json"])
            return result.code

        doc = (
            self.help
            or inspect.getdoc(self.work)
            or (inspect.getdoc(door) or "").partition("\n\n")[0]
        )
        shell.__doc__ = leading_text(doc)
        return _signed(shell, parameters)

    def _answer(self, call: DoorCall | None, own_options: dict[str, Any]) -> Answer:
        if call is None:
            return cast("Answer", self.work(**own_options))
        if not self.help:
            return cast("Answer", self.work(call, **own_options))
        result: Result = call()
        code = 1 if getattr(result, "status", "") == "fail" else 0
        return Answer(result, None, code, result.report if "report" in self.shared else None)


def command(
    app: typer.Typer | None,
    *shared: str,
    name: str | None = None,
    door: str = "",
    working: str = "",
    without: tuple[str, ...] = (),
) -> Callable[[Callable[..., Answer]], TerminalCommand]:
    """Return a decorator that makes a function a command, added to a group where one is given.

    Parameters
    ----------
    app : typer.Typer or None
        The group.
    *shared : str
        Options that it has with ``--json``; ``report`` is written before the answer, and refused
        before the work where it cannot be.
    name : str, optional
        In the group; default: the function's.
    door, working, without
        As `TerminalCommand`; the function is given the `DoorCall`.
    """

    def make(work: Callable[..., Answer]) -> TerminalCommand:
        made = TerminalCommand(work, shared, door, working, without)
        if isinstance(app, CommandGroup):  # in its order, whichever have doors
            app.waiting.append(lambda: made.add_to(app, name))
        elif app is not None:
            made.add_to(app, name)
        return made

    return make


def result_command(
    door: str,
    help: str,  # noqa: A002 - what it is everywhere
    *shared: str,
    working: str = "",
    arguments: int = 1,
) -> TerminalCommand:
    """Return the command that runs a door and prints its result; arguments as `TerminalCommand`."""
    return TerminalCommand(print_result, shared, door, working, (), help, arguments)


def add_plain(
    app: typer.Typer, name: str | None = None
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that adds a function as a command that prints and exits by itself."""

    def add(work: Callable[..., Any]) -> Callable[..., Any]:
        app.command(name, cls=PlainCommand)(styled(work))
        return work

    return add


def styled(work: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function whose parameters have what its docstring and `SHARED` say of them."""

    @wraps(work)
    def shell(**options: Any) -> Any:
        return work(**options)

    shell.__doc__ = leading_text(inspect.getdoc(work) or "")
    return _signed(shell, own_parameters(work))


def _signed(shell: Callable[..., Any], parameters: list[CommandParameter]) -> Callable[..., Any]:
    """Give a function the signature that typer reads."""
    shell.__signature__ = inspect.Signature([item.signature for item in parameters])  # type: ignore[attr-defined]
    shell.__annotations__ = {item.name: item.annotation for item in parameters}
    del shell.__dict__["__wrapped__"]
    return shell
