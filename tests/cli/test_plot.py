"""`plot`: what can be drawn, by which signals, into which files; nothing half written."""

import json

import numpy as np
import pytest

import elevon
from elevon import Recording
from elevon.calibrate.validation import SignalError, Validation
from tests.harness.recipes import PLAN


@pytest.fixture
def rec(tmp_path):
    t = np.arange(0.0, 1.0, 0.01)
    values = {"output_position": np.sin(t), "motor_speed": 10.0 * np.cos(t), "current_a": t}
    units = {"output_position": "rad", "motor_speed": "rad/s", "current_a": "A"}
    return Recording.build(t, values, units).save(tmp_path / "rec.parquet")


def test_a_recording_becomes_a_page_named_after_it(rec, elevon_cli):
    result = elevon_cli("plot", rec)
    assert result.out.splitlines()[0] == "wrote rec.html: 3 signals of rec.parquet"
    assert "uPlot" in (rec.parent / "rec.html").read_text("utf-8")
    again = elevon_cli("plot", rec)
    assert (again.code, again.out) == (2, "")


def test_chosen_signals_in_the_units_of_the_terminal(rec, elevon_cli):
    words = ("--signal", "motor_speed", "--signal", "output_position")
    answer = elevon_cli("plot", rec, *words, "--out", "a.svg", "--out", "a.html", "--json").json
    assert answer["written"] == ["a.svg", "a.html"]
    drawn = {row["name"]: row for row in answer["signals"]}
    assert drawn["motor_speed"]["unit"] == "rpm"
    assert drawn["motor_speed"]["greatest"] == pytest.approx(300.0 / np.pi)
    assert drawn["output_position"]["unit"] == "deg"
    assert (rec.parent / "a.svg").is_file()
    assert (rec.parent / "a.html").is_file()


def test_a_log_of_unknown_columns_is_drawn_by_its_guess(tmp_path, elevon_cli):
    t = np.arange(0.0, 4.0, 0.01)
    columns = np.column_stack((1e3 * t, 30.0 * np.sin(t), 30.0 * np.cos(t)))
    np.savetxt(
        tmp_path / "log.csv", columns, delimiter=",", comments="", header="ms,actual_mm,v_mm/s"
    )
    answer = elevon_cli("plot", "log.csv", "--json").json
    assert [row["name"] for row in answer["signals"]] == ["output_position", "output_speed"]


def test_a_run_of_a_campaign(elevon_cli, tmp_path):
    (tmp_path / "plan.toml").write_text(
        PLAN.replace("count = 3", "count = 1").replace("seeds = [1, 2]", "seeds = [1]")
    )
    assert elevon_cli("campaign", "run", "plan.toml", "--out", "set").code == 0
    answer = elevon_cli("plot", "set", "--run", "0", "--json").json
    assert {"output_position", "motor_speed"} <= {row["name"] for row in answer["signals"]}
    assert answer["written"] == ["set.html"]
    wrong = elevon_cli("plot", "set", "--run", "7", "--out", "b.html")
    assert wrong.code == 2
    assert "run 7" in wrong.err


def test_a_result_is_drawn_as_its_own_page_and_picture(elevon_cli, tmp_path):
    row = SignalError("a.csv", "motor_speed", "rad/s", 1.0, 2.0, 1.0, 0.5, 1.0, None)
    result = Validation("unit", "low", 1.0, (row,), {}, ())
    result.save(tmp_path / "fit.json")
    answer = elevon_cli("plot", "fit.json", "--out", "fit.html", "--out", "fit.png", "--json").json
    assert answer["kind"] == "validation"
    assert answer["headline"] == elevon.load(tmp_path / "fit.json").headline
    assert (tmp_path / "fit.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("rec.parquet", "--signal", "motor_sped"), "did you mean 'motor_speed'"),
        (("rec.parquet", "--out", "a.gif"), "ending of a plot '.gif'"),
        (("rec.parquet", "--run", "1"), "is no folder of a campaign"),
        (("rec.parquet", "--out", "a.svg", "--out", "a.svg"), "is given twice"),
        (("fit.json", "--signal", "motor_speed"), "a result has no signals"),
        (("missing.csv",), "missing.csv"),
    ],
)
def test_mistakes_are_named_and_write_nothing(rec, elevon_cli, words, text):
    (rec.parent / "fit.json").write_text(json.dumps({"schema": "elevon/validation/1"}))
    before = sorted(rec.parent.iterdir())
    result = elevon_cli("plot", *words)
    assert result.code == 2
    assert text in result.err
    assert sorted(rec.parent.iterdir()) == before
