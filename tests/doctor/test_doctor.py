"""The first look at a log: what it composes, what it says of bad data, its page and its codes."""

import json

import numpy as np
import pytest

import elevon
from elevon.cli import main
from elevon.diagnose.engine.answer import Cause, Diagnosis
from elevon.doctor import door
from elevon.errors import FormatError, InputError
from elevon.logs import read

NAMES = "time_ms,pos_deg,motor_angle_deg,speed_demand_rpm,speed_rpm,iq_A"
RATIO = 124.0
UNIT = ("--actuator", "torino-rotary")


def motion():
    """A turning servo's log in the columns of some logger: ms, deg, rpm, A."""
    t = np.arange(0.0, 8.0, 0.01)
    motor = 300.0 * np.sin(np.pi * t) * (1.0 + 0.1 * t)
    speed = np.gradient(motor, t) / 6.0
    demand = np.interp(t + 0.04, t, speed)
    current = 0.5 * np.sign(np.round(speed, 3)) + 0.01 * np.gradient(speed, t)
    return np.column_stack((1e3 * t, motor / RATIO, motor, demand, speed, current))


def written(path, values, header=NAMES):
    np.savetxt(path, values, delimiter=",", header=header, comments="", fmt="%.6g")
    return path


@pytest.fixture
def verdict(monkeypatch):
    """A stand-in for the diagnosis, which is tested where it is."""

    def put(status="healthy"):
        causes = (Cause("backlash", "transmission", "rad", 0.99, 2e-3, (1e-3, 3e-3)),)
        named = causes if status == "faulty" else ()
        answer = Diagnosis(
            ("a.csv",), status, 0.01, 0.05, 0.5, named,
            tuple(f"{c.kind}@{c.place}" for c in named), 0.98, (), {}, (), (), 0.1,
            actuator="torino-rotary",
        )  # fmt: skip
        monkeypatch.setattr(door, "diagnose", lambda *_, **__: answer)
        monkeypatch.setattr(door, "validate", refused)

    return put


def refused(*_, **__):
    raise InputError("not compared here")


def test_columns_that_nobody_stated_are_guessed_and_the_guess_serves_the_baseline(
    tmp_path, verdict
):
    verdict()
    log, new = written(tmp_path / "a.csv", motion()), written(tmp_path / "new.csv", motion())
    result = elevon.doctor(log, "torino-rotary", new)
    assert result.columns_by == "guess"
    roles = {c.name: c.role for c in result.columns if c.log == "a.csv"}
    assert roles["pos_deg"] == "output_position"
    assert roles["speed_demand_rpm"] == "speed_ref"
    assert all(check.ok for check in result.checks), result.checks
    assert result.headline.startswith("HEALTHY")
    assert "data: sound, columns guessed" in result.headline
    assert 'role = "output_position"' in result.map_text
    again = elevon.doctor(log, "torino-rotary", map=_saved(tmp_path, result.map_text))
    assert (again.columns_by, again.map_text) == ("map", "")


def _saved(folder, text):
    path = folder / "map.toml"
    path.write_text(text)
    return path


def _gap(values):
    return np.delete(values, np.s_[300:340], axis=0)


def _clipped(values):
    out = values.copy()
    out[:, 5] = np.clip(out[:, 5], -0.4, 0.4)
    return out


def _swapped(values):
    return values[:, [0, 2, 1, 3, 4, 5]]


def _jitter(values):
    out = values.copy()
    out[:, 0] += 3.0 * np.sin(2.0 * np.arange(len(out)))
    return out


@pytest.mark.parametrize(
    ("spoil", "check", "text"),
    [
        (_gap, "gaps", "40 samples missing"),
        (_clipped, "values", "sit at 0.4"),
        (_swapped, "columns", "'pos_deg' and 'motor_angle_deg' are swapped"),
        (_jitter, "clock", "stray up to"),
    ],
)
def test_bad_data_are_named_by_question(tmp_path, verdict, spoil, check, text):
    verdict()
    result = elevon.doctor(written(tmp_path / "a.csv", spoil(motion())), "torino-rotary")
    seen = {item.check: item.text for item in result.checks if not item.ok}
    assert text in seen[check]
    assert "to look at" in result.headline


def test_page_answer_and_map_are_written_and_the_first_line_is_the_verdict(
    tmp_path, verdict, capsys, monkeypatch
):
    verdict("faulty")
    monkeypatch.chdir(tmp_path)
    written(tmp_path / "a.csv", motion())
    assert main(["doctor", "a.csv", *UNIT, "--out", "look"]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("FAULTY: backlash")
    assert sorted(p.name for p in (tmp_path / "look").iterdir()) == [
        "doctor.html", "doctor.json", "map.toml"
    ]  # fmt: skip
    saved = elevon.load(tmp_path / "look" / "doctor.json")
    assert saved.headline == first
    page = (tmp_path / "look" / "doctor.html").read_text("utf-8")
    assert "elevon-chart" in page
    assert 'src="' not in page


def test_a_log_that_cannot_be_diagnosed_fails_with_its_reason(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path / "a.csv", motion()[:, [0, 1, 5]], "time_ms,pos_deg,iq_A")
    assert main(["doctor", "a.csv", *UNIT, "--json"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert answer["status"] == "no_verdict"
    assert answer["verdict"] is None
    assert "a.csv" in answer["reasons"]["verdict"]


def test_a_log_whose_columns_stand_otherwise_has_a_guess_of_its_own(tmp_path, verdict):
    verdict()
    log = written(tmp_path / "a.csv", _swapped(motion()))
    result = elevon.doctor(log, "torino-rotary", written(tmp_path / "new.csv", motion()))
    roles = {(c.log, c.name): c.role for c in result.columns}
    assert roles["a.csv", "pos_deg"] == roles["new.csv", "motor_angle_deg"] == "motor_position"
    assert [c.log for c in result.checks if not c.ok] == ["a.csv"]


def test_a_guess_that_does_not_hold_says_how_to_correct_it(tmp_path, monkeypatch):
    def contradicted(table, mapped, *_, **__):
        raise (FormatError if mapped is None else InputError)("it contradicts the data")

    monkeypatch.setattr(read, "import_table", contradicted)
    log = written(tmp_path / "a.csv", motion())
    with pytest.raises(
        InputError, match=r"the guess does not hold: .*a\.csv --guess --out map\.toml"
    ):
        elevon.doctor(log, "torino-rotary")
