"""`python -m studies`: its names are those that `elevon reproduce` refers to, its errors exit 2."""

import pytest
import typer

from elevon.cli import main as elevon
from elevon_cases.commands import STUDIES
from elevon_cases.commands import app as reproduce
from studies import main
from studies.commands import app


def names(application):
    return set(typer.main.get_command(application).commands)


def test_reproduce_knows_every_study_and_lists_none():
    assert names(app) == set(STUDIES)
    assert names(reproduce).isdisjoint(STUDIES)


@pytest.mark.parametrize("study", STUDIES)
def test_asked_for_under_reproduce_a_study_says_where_it_is(study, capsys):
    assert elevon(["reproduce", study, "--json"]) == 2
    captured = capsys.readouterr()
    assert f"python -m studies {study}" in captured.err
    assert captured.out == ""


def test_a_study_that_is_none(capsys):
    assert main(["diagnosis-limit"]) == 2
    captured = capsys.readouterr()
    assert "Did you mean diagnosis-limits" in captured.err
    assert captured.out == ""
    assert main(["next-test", "--units", "1"]) == 2
