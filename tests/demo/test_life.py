"""The demonstration of a life: its unit, its pictures, and the whole of it."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

from elevon import Actuator
from elevon.cli import main
from elevon.demo.mechanism import Motion, mechanism, motion
from elevon.demo.unit import demo_mission, faults_at, hidden_unit, of_day
from elevon.prognose.future import Life


@pytest.fixture(scope="module")
def base():
    return Actuator.load("torino-rotary")


def life():
    usage = np.array([0.0, 1000.0, 3000.0])
    return Life(usage, np.array([[0.0, 0.0], [0.005, 0.2], [0.015, 0.8]]), 3000.0, 0)


def test_the_unit_differs_from_the_published_one_and_from_day_to_day(base):
    unit = hidden_unit(base, 3)
    assert unit.hash == hidden_unit(base, 3).hash
    assert unit.hash != hidden_unit(base, 4).hash
    days = {of_day(unit, np.random.default_rng(k)).hash for k in range(3)}
    assert len(days | {unit.hash}) == 4


def test_faults_follow_the_life():
    assert faults_at(life(), 0.0) == []
    backlash, friction = faults_at(life(), 2000.0)
    assert (backlash.kind, float(backlash.severity)) == ("backlash", pytest.approx(0.01))
    assert (friction.kind, float(friction.severity)) == ("friction", pytest.approx(0.5))
    assert [law.key for law in demo_mission().laws()] == [
        f"{f.kind}@{f.place}" for f in (backlash, friction)
    ]


def test_the_picture_moves_with_the_simulated_motion(base):
    demo = SimpleNamespace(hidden=hidden_unit(base, 0), life=life())
    new, worn = motion(demo, 0.0), motion(demo, 3000.0)
    assert np.ptp(new.output) == pytest.approx(14.0, rel=0.1)
    gaps = [float(np.ptp(m.driver - m.output)) for m in (new, worn)]
    assert gaps == pytest.approx([new.backlash, worn.backlash], rel=0.1)
    assert worn.backlash - new.backlash == pytest.approx(np.degrees(0.015))
    markup = str(mechanism([("new", new), ("<worn>", worn)]))
    assert markup.count("<animateTransform") == 6
    assert "&lt;worn&gt;" in markup
    assert "http" not in markup.replace('xmlns="http://www.w3.org/2000/svg"', "")


def test_the_pin_stays_within_its_fork():
    swing = 7.0 * np.sin(np.linspace(0.0, 2.0 * np.pi, 101))
    gap = 0.5 * np.sign(np.cos(np.linspace(0.0, 2.0 * np.pi, 101)))
    markup = str(mechanism([("x", Motion(swing, swing + gap, swing, swing, 1.0, 0.0))]))
    angles = [
        np.array([float(v.split()[0]) for v in text.split(";")])
        for text in re.findall(r'rotate"[^>]*values="([^"]*)"', markup)
    ]
    _, fork, pin = angles
    assert np.abs(pin - fork).max() == pytest.approx(0.5 * 26.0, abs=0.05)


@pytest.mark.parametrize("option", ["--part", "--which"])
def test_the_second_demonstration_is_refused_with_where_its_story_is(option, capsys):
    assert main(["demo", option, "bench"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "docs/start/tutorial.md" in captured.err


def test_what_is_there_is_not_replaced(tmp_path, capsys):
    (tmp_path / "history").mkdir()
    (tmp_path / "history" / "mine.json").write_text("{}")
    assert main(["demo", "--out", str(tmp_path), "--json"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "--force" in captured.err
    assert (tmp_path / "history" / "mine.json").read_text() == "{}"


@pytest.mark.long
def test_the_whole_story(tmp_path, capsys):
    out = tmp_path / "demo"
    code = main(["demo", "--out", str(out), "--json"])
    result = json.loads(capsys.readouterr().out)
    assert [check["name"] for check in result["checks"] if not check["passed"]] == []
    assert code == 0
    page = (out / "report.html").read_text("utf-8")
    assert "<animateTransform" in page
    for outside in ("<script src", "<link", '<img src="http', "url(http"):
        assert outside not in page
    options = ["--actuator", str(out / "calibrated.toml"), "--mission", str(out / "mission.toml")]
    assert main(["predict", str(out / "history"), *options, "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["usage"] == result["rows"][-1]["usage"]
    low, high = again["rul"]["interval"]
    assert low <= result["rows"][-1]["rul"] <= high
