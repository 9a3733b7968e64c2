"""The demonstration: the hidden actuator is another one, and the whole chain finds it again."""

import json

import pytest

from elevon import Actuator
from elevon.bench.hidden import RECOVERED, hidden_actuator
from elevon.cli import main


def test_the_hidden_actuator_differs_and_is_drawn_by_the_seed():
    base = Actuator.load("torino-rotary")
    hidden = hidden_actuator(base, 3)
    assert hidden.hash == hidden_actuator(base, 3).hash
    assert hidden.hash != hidden_actuator(base, 4).hash
    moved = [path for path in RECOVERED if path in base.parameters]
    assert len(moved) == 6
    for path in moved:
        assert hidden.parameters.value(path) != base.parameters.value(path)
    assert not hidden.findings("high")


def test_what_is_there_is_not_replaced(tmp_path, capsys):
    (tmp_path / "report.html").write_text("mine")
    assert main(["demo", "--part", "bench", "--out", str(tmp_path), "--json"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "--force" in captured.err
    assert (tmp_path / "report.html").read_text() == "mine"


@pytest.mark.long
def test_the_whole_chain(tmp_path, capsys):
    code = main(["demo", "--part", "bench", "--out", str(tmp_path / "demo"), "--json"])
    result = json.loads(capsys.readouterr().out)
    assert [check["name"] for check in result["checks"] if not check["passed"]] == []
    assert code == 0
    assert result["wall_s"] < 120.0
    page = (tmp_path / "demo" / "report.html").read_text("utf-8")
    assert "friction.dynamic" in page
    for outside in ("<script src", "<link", '<img src="http'):
        assert outside not in page
    assert (tmp_path / "demo" / "backlash.html").is_file()
