"""The demonstration of a life: its unit, its pictures, and the whole of it."""

import base64
import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

from elevon import Actuator
from elevon.cli import main
from elevon.demo.page import sweep
from elevon.demo.unit import demo_mission, faults_at, hidden_unit, of_day
from elevon.prognose.future import Life
from elevon.report.mechanism import mechanism, moving_svg, trace


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
    new, worn = ("".join(sweep(demo, usage)) for usage in (0.0, 3000.0))
    assert new.count("<animateTransform") == worn.count("<animateTransform") == 7
    total = np.degrees(demo.hidden.parameters.value("backlash.total"))
    printed = [float(re.search(r"([\d.]+)° in all", text)[1]) for text in (new, worn)]
    assert printed == pytest.approx([total, total + np.degrees(0.015)], rel=0.1)


def test_the_drawing_follows_the_signals():
    turn = np.linspace(0.0, 2.0 * np.pi, 101)
    gap = 0.01 * np.sign(np.cos(turn))
    drawn = {"motor_position": 10.0 * turn, "output_position": 0.1 * np.sin(turn),
             "command": 0.1 * np.sin(turn)}  # fmt: skip
    picture = moving_svg([mechanism(drawn, gap, 10.0, 5.0), trace(np.degrees(gap), 5.0)], "x",
                         height=280)  # fmt: skip
    assert "http" not in picture.replace('xmlns="http://www.w3.org/2000/svg"', "")
    moved = re.search(r'type="translate" values="([^"]*)" dur="5.00s"', picture)[1]
    places = np.array([float(text.split()[0]) for text in moved.split(";")])
    assert np.ptp(places) == pytest.approx(0.02 / 0.03 * 60.0, abs=0.1)
    assert "1.15° in all" in picture


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
    picture = re.search(r'src="data:image/svg\+xml;base64,([^"]+)"', page)[1]
    assert b"<animateTransform" in base64.b64decode(picture)
    for outside in ("<script src", "<link", '<img src="http', "url(http"):
        assert outside not in page
    options = ["--actuator", str(out / "calibrated.toml"), "--mission", str(out / "mission.toml")]
    assert main(["predict", str(out / "history"), *options, "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["usage"] == result["rows"][-1]["usage"]
    low, high = again["rul"]["interval"]
    assert low <= result["rows"][-1]["rul"] <= high
