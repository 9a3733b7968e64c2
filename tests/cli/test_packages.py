"""Commands that other packages add: found by their entry point, missed in words."""

from importlib.metadata import EntryPoint

import pytest
import typer

from elevon.cli import main, registry

GROUP = registry.ENTRY_POINTS


@pytest.fixture
def installed(monkeypatch):
    """Return a function that lets these be the entry points of the installation."""

    def place(*points):
        monkeypatch.setattr(registry, "entry_points", lambda group: points)
        registry.commands.cache_clear()

    yield place
    registry.commands.cache_clear()


app = typer.Typer()


@app.callback(invoke_without_command=True)
def _work() -> int:
    return 7


def test_a_command_of_an_installed_package_works_and_is_listed(installed, capsys):
    installed(EntryPoint("reproduce", f"{__name__}:app", GROUP))
    assert main(["reproduce"]) == 7
    assert main(["--help"]) == 0
    assert "\n  reproduce " in capsys.readouterr().out


def test_without_the_package_the_command_says_how_to_install_it(installed, capsys):
    installed()
    assert main(["reproduce", "torino-backlash", "--json"]) == 2
    streams = capsys.readouterr()
    assert streams.out == ""
    assert "pip install elevon-cases" in streams.err
    assert main(["--help"]) == 0
    assert "\n  reproduce " not in capsys.readouterr().out
    assert main(["reprduce"]) == 2
    assert "No such command 'reprduce'" in capsys.readouterr().err


@pytest.mark.parametrize("there", [True, False])
def test_the_shell_completes_what_is_installed(installed, monkeypatch, capsys, there):
    points = [EntryPoint("reproduce", f"{__name__}:app", GROUP)] if there else []
    installed(*points)
    monkeypatch.setenv("_ELEVON_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "elevon\nre")
    monkeypatch.setenv("COMP_CWORD", "1")
    with pytest.raises(SystemExit):
        main([])
    offered = capsys.readouterr().out.split()
    assert "response" in offered
    assert ("reproduce" in offered) is there


def test_the_product_names_no_module_of_another_package(installed):
    installed()
    assert registry.packages().keys().isdisjoint(registry.commands())
    assert set(registry.packages()) == {"reproduce"}
