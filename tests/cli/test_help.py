"""Help and progress: every command in one style, with an example that its own options bear."""

import re
import shlex
from importlib import import_module
from inspect import signature

import pytest
import typer

from elevon.cli import main
from elevon.cli.help import example_of, help_rows
from elevon.cli.output import progress_bar
from elevon.cli.registry import COMMANDS
from elevon.data import packaged_toml
from tests.harness.registry import commands

FOUND = {name: command for name, command in commands() if not name.startswith("studies")}
#: A name in capitals, or one of the forms that say what stands in them.
METAVAR = re.compile(
    r"[A-Z][A-Z_]*(\|[A-Z]+)?|KIND@PLACE|PATH=VALUE\[unit\]|KEY=QUANTITY|[A-Z]+[=@:][A-Z]+|local:N"
)


def context(name):
    return typer.Context(FOUND[name], info_name=f"elevon {name}")


@pytest.mark.parametrize("name", FOUND)
def test_names_and_metavars_have_one_style(name):
    for item in FOUND[name].params:
        if item.param_type_name == "argument" or not item.is_flag:
            text = item.metavar or ""
            assert METAVAR.fullmatch(text), f"{name}: {item.name}: {text!r}"
    names = [row for _, rows in help_rows(FOUND[name], context(name)) for row, _ in rows]
    assert not [row for row in names if "<" in row or "{" in row]


@pytest.mark.parametrize("name", FOUND)
def test_each_command_has_an_example_of_its_own_options(name):
    words = shlex.split(example_of(FOUND[name], f"elevon {name}"))
    assert words[: 1 + len(name.split())] == ["elevon", *name.split()]
    known = {option for item in FOUND[name].params for option in item.opts}
    given = {word for word in words if re.match(r"--?[a-z]", word)}
    assert given <= known
    needed = [i for i in FOUND[name].params if i.required and i.param_type_name == "option"]
    assert all(set(item.opts) & given for item in needed)


@pytest.mark.parametrize("name", ["", *FOUND])
def test_help_fits_a_terminal(name, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert main([*name.split(), "--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("Usage: ")
    assert max(len(line) for line in lines) <= 80
    if name:
        assert "Example:" in lines


def test_commands_are_grouped_by_purpose(capsys):
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    places = [text.index(f"\n{group}:\n") for group in dict.fromkeys(
        entry.group for entry in COMMANDS.values())]  # fmt: skip
    assert places == sorted(places)
    assert len(places) > 4


def test_progress_ends_at_the_whole_and_not_where_work_stopped(capsys):
    with progress_bar("work") as advance:
        advance(0.42)
    assert capsys.readouterr().err.splitlines() == ["work: 40 %", "work: 100 %"]
    with progress_bar("work") as advance:
        advance(1.0)
    assert capsys.readouterr().err.splitlines() == ["work: 100 %"]

    class StopError(Exception):
        pass

    def stopped():
        with progress_bar("work") as advance:
            advance(0.42)
            raise StopError

    with pytest.raises(StopError):
        stopped()
    assert capsys.readouterr().err.splitlines() == ["work: 40 %"]


def test_each_text_of_an_option_belongs_to_a_parameter():
    homes = {"all_cases": "elevon.cli.reproduce.all_cases"}
    texts = packaged_toml("elevon.cli", "options.toml")
    for name in texts.keys() - {"arguments", "options", "case"}:
        module = import_module(homes.get(name, f"elevon.cli.{name}"))
        functions = [
            f for f in vars(module).values() if getattr(f, "__module__", "") == module.__name__
        ]
        taken = {function.__name__: {*signature(function).parameters} for function in functions}
        for entry, words in texts[name].items():
            if "help" in words:
                assert any(entry in parameters for parameters in taken.values()), (name, entry)
            else:
                assert words.keys() <= taken[entry], (name, entry)
