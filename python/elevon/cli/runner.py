"""The root command group, its lazy loading, and the mapping of errors to exit codes."""

from __future__ import annotations

import errno
import importlib
import os
import re
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

from elevon.cli import completion, interrupt
from elevon.cli.groups import NamingGroup, UsageError
from elevon.cli.registry import commands, packages
from elevon.errors import ElevonError, ElevonWarning, Interrupted
from elevon.extras import missing_package
from elevon.files import journal
from elevon.retired import remark

USAGE = 2
FAILED = 1


_ROOT_ONLY = ("install_completion", "show_completion")


class LazyGroup(NamingGroup):
    """A group that imports a command's module only when that command is run."""

    def list_commands(self, ctx: object) -> list[str]:  # noqa: ARG002 - click's signature
        """Names of the commands of this installation, in the registry's order."""
        return list(commands())

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002 - click's signature
        """Load one command, or None when there is no such command."""
        entry = commands().get(cmd_name)
        if entry is None:
            return None
        loaded = typer.main.get_command(entry.load())
        loaded.name = cmd_name
        # Completion is installed for the program, not for one of its commands.
        loaded.params = [item for item in loaded.params if item.name not in _ROOT_ONLY]
        return loaded

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command of the first argument, or raise `UsageError`."""
        package = packages().get(args[0]) if args and args[0] not in commands() else None
        if package is not None:
            raise UsageError(
                f"'{args[0]}' is a command of the package {package}, which is not installed: "
                f"pip install {package}, or pip install ./cases in a checkout of the sources",
                ctx,
            )
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002 - click's signature
        """Write the commands by purpose from the registry, importing none of them."""
        entries = commands()
        widest = max(len(name) for name in entries)
        for group in dict.fromkeys(entry.group for entry in entries.values()):
            rows = [
                (name.ljust(widest), entry.help)
                for name, entry in entries.items()
                if entry.group == group
            ]
            with formatter.section(group):
                formatter.write_dl(rows)


app = typer.Typer(
    name="elevon",
    cls=LazyGroup,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Models, faults, virtual bench and diagnosis of electromechanical actuators.",
)


def _print_version(value: bool) -> None:
    if value:
        from elevon.cli.version import version_line

        typer.echo(version_line())
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: bool = typer.Option(  # noqa: ARG001 - its callback does the work
        False, "--version", callback=_print_version, is_eager=True, help="Print the version."
    ),
) -> None:
    """Models, faults, virtual bench and diagnosis of electromechanical actuators."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def run(
    argv: Sequence[str] | None = None,
    module: str = "elevon.cli.runner",
    program: str = "elevon",
) -> int:
    """Run the command line, turning every expected failure into a message and an exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    with journal() as written, _warnings_in_words():
        try:
            code = _code(arguments, module, program)
        except (KeyboardInterrupt, Interrupted, typer.Abort):
            return _interrupted(written)
        except Exception:
            # A Ctrl-C inside a library may come out as an error of that library.
            if interrupt.noticed():
                return _interrupted(written)
            raise
        # Typer, too, knows Ctrl-C, but has nothing to say about it.
        return _interrupted(written) if code == interrupt.INTERRUPTED else code


def _code(arguments: list[str], module: str, program: str) -> int:
    if os.environ.get("_ELEVON_COMPLETE") == "complete_bash":
        completion.join_words()
    try:
        command = typer.main.get_command(importlib.import_module(module).app)
        outcome = command.main(args=arguments, prog_name=program, standalone_mode=False)
    except Interrupted:
        raise
    except UsageError as error:
        return _usage(error, arguments)
    except (ElevonError, ElevonWarning) as error:
        interrupt.check()
        return _fail(str(error), error.exit_code)
    except BrokenPipeError:
        return _closed_pipe()
    except ModuleNotFoundError as error:
        needed = missing_package(error)
        if needed is None:
            raise
        return _fail(needed, USAGE)
    except OSError as error:
        interrupt.check()
        # A name that no file system takes is a wrong argument; all else has gone wrong on the way.
        return _fail(str(error), USAGE if error.errno == errno.ENAMETOOLONG else FAILED)
    return outcome if isinstance(outcome, int) else 0


@contextmanager
def _warnings_in_words() -> Iterator[None]:
    """Write Elevon's own warnings as a line on stderr; ``--strict`` makes errors of them."""
    with warnings.catch_warnings():
        warnings.simplefilter("default", ElevonWarning)
        usual = warnings.showwarning

        def show(  # noqa: PLR0917 - the hook's own signature
            message: Warning | str,
            category: type[Warning],
            filename: str,
            lineno: int,
            file: Any = None,
            line: str | None = None,
        ) -> None:
            if issubclass(category, ElevonWarning):
                typer.echo(f"elevon: warning: {message}", err=True)
            else:
                usual(message, category, filename, lineno, file, line)

        warnings.showwarning = show
        yield


def _interrupted(written: Sequence[Path]) -> int:
    interrupt.ignore()
    interrupt.drop_output()
    return _fail(f"interrupted; {interrupt.story() or _story(written)}", interrupt.code())


def _story(written: Sequence[Path], most: int = 4) -> str:
    """Say which files of this command are there; each of them is whole."""
    files = [str(path) for path in dict.fromkeys(written) if path.is_file()]
    if not files:
        return "nothing was written; give the command again to start over"
    more = f" and {len(files) - most} more" if len(files) > most else ""
    return (
        f"kept, each whole: {', '.join(files[:most])}{more}; give the command again with --force "
        "to do all of it"
    )


def _usage(error: Any, arguments: Sequence[str]) -> int:
    context, message = getattr(error, "ctx", None), error.format_message()
    if context is not None:
        typer.echo(context.get_usage(), err=True)
        name = context.command_path.partition(" ")[2]
        option = getattr(error, "option_name", "")
        about = remark("option", f"{name} {option}")
        message = f"No such option: {option}; {about}" if about else message
        if extra := re.fullmatch(r"Got unexpected extra arguments?(?:\(s\))? \((\S+)\)", message):
            place = arguments.index(extra[1])
            about = remark("argument", f"{name} {arguments[place - 1]}")
            message = f"{message}; {about}" if about else message
    missing = getattr(error, "param", None)
    if missing is not None and missing.name == "actuator" and message.startswith("Missing"):
        from elevon.actuator import list_actuators

        known = ", ".join(list_actuators())
        message = f"{message.rstrip('.')}: {known}, or a file; elevon list actuators"
    return _fail(message, USAGE)


def _fail(message: str, code: int) -> int:
    typer.echo(f"elevon: {message}", err=True)
    return code


def _closed_pipe() -> int:
    # The reader (head, less) left: point stdout elsewhere so that the interpreter's last flush
    # does not complain.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return FAILED
