"""Every command that writes, found from the program itself."""

import typer

from elevon.cli.runner import app
from studies.commands import app as studies

#: Options by which a command is told where to write.
OUTPUTS = {
    "--out",
    "--report",
    "--plot",
    "--svg",
    "--schema",
    "--picture",
    "--table",
    "--runs",
    "--append",
}


def commands():
    """Yield the words of each command and its object; those of ``python -m studies`` too."""

    def walk(command, words):
        if not hasattr(command, "list_commands"):
            yield " ".join(words), command
            return
        if words and command.invoke_without_command:  # it works by itself, too
            yield " ".join(words), command
        context = typer.Context(command)
        for name in command.list_commands(context):
            yield from walk(command.get_command(context, name), [*words, name])

    yield from walk(typer.main.get_command(app), [])
    yield from walk(typer.main.get_command(studies), ["studies"])


def writes(command):
    """Whether a command takes a place to write to, a flag to replace files, or a folder."""
    return any(
        OUTPUTS & set(item.opts)
        or ("--force" in item.opts and getattr(item, "is_flag", False))
        or (item.param_type_name == "argument" and "DIR" in (item.metavar or ""))
        for item in command.params
    )


def writing():
    """Return name and object of each command that writes, or is given a folder."""
    return {name: command for name, command in commands() if writes(command)}


def shared_writer(command):
    """Tell whether a reproduction writes by the one writer that all of them share."""
    return command.callback is not None and _module(command) == "elevon_cases.case"


def _module(command):
    return getattr(command.callback, "__wrapped__", command.callback).__module__
