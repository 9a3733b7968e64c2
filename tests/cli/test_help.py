"""Help and progress: every command in one style, with an example that its own options bear."""

import re
import shlex
from importlib.metadata import EntryPoint
from inspect import getdoc, signature

import pytest
import typer

from elevon.cli import main, registry
from elevon.cli.help import example_of, help_rows
from elevon.cli.options import own_parameters, parameter_texts
from elevon.cli.output import progress_bar
from elevon.cli.registry import commands as entries
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
        entry.group for entry in entries().values())]  # fmt: skip
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


def test_a_command_of_a_door_has_its_arguments_types_defaults_and_texts():
    """Nothing of a door is written down twice: the signature is where an option comes from."""
    from elevon.calibrate.door import validate

    options = {item.name: item for item in FOUND["validate"].params}
    parameters = signature(validate).parameters
    assert parameters.keys() - {"progress"} <= options.keys()
    assert options["fidelity"].default == parameters["fidelity"].default
    texts = parameter_texts(getdoc(validate))
    assert options["transient"].help == texts["transient"]
    assert "[s]" in texts["transient"]


def test_a_parameter_that_nothing_describes_is_refused():
    def silent(*, unheard_of: int = 1) -> None:
        """Do nothing."""

    with pytest.raises(LookupError, match="unheard_of"):
        own_parameters(silent)


def test_another_package_adds_its_command_by_an_entry_point(monkeypatch, capsys):
    point = EntryPoint("added", "elevon.cli.lives:predict", registry.ENTRY_POINTS)
    monkeypatch.setattr(registry, "entry_points", lambda group: [point])
    registry.commands.cache_clear()
    try:
        assert main(["added", "--help"]) == 0
        assert "HISTORY" in capsys.readouterr().out
        assert "Added by elevon." in registry.commands()["added"].help
    finally:
        registry.commands.cache_clear()
