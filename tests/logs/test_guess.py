"""A first column map: from headers or their absence, units, and what integrates to what."""

import html
import json
import math
import re
import tomllib

import numpy as np
import pytest

from elevon.cli import main
from elevon.errors import InputError, QuestionError
from elevon.logs.formats.drive import write_drive_csv
from elevon.logs.formats.table import RawTable
from elevon.logs.importing import import_log
from elevon.logs.maps.agreement import lag_of
from elevon.logs.maps.guess import guess_map
from elevon.logs.maps.headers import role_hint, unit_hint
from elevon.logs.read import imported_log, read_log

LEAD = 5e-3  # m for one turn


@pytest.fixture(scope="module")
def motion():
    """A servo that follows a trapezoid 40 ms late, sampled every 10 ms, with noise."""
    t = np.arange(0.0, 12.0, 0.01)
    phase = np.mod(t, 4.0)
    demand = 1e-3 * np.interp(phase, [0, 1, 2, 3, 4], [0, 30, 30, 0, 0])
    position = np.interp(t - 0.04, t, demand)
    position = np.convolve(position, np.ones(9) / 9, "same")
    speed = np.gradient(position, t)
    current = 2.0 * np.sign(np.round(speed, 4)) + 0.2 * np.gradient(speed, t) + 10 * speed
    rng = np.random.default_rng(0)
    return {
        "t": t,
        "demand": demand,
        "position": position,
        "speed": speed + rng.normal(0.0, 2e-4, len(t)),
        "current": current + rng.normal(0.0, 0.05, len(t)),
    }


def written(path, motion, header, speed_scale=1e3):
    columns = (1e3 * motion["t"], 1e3 * motion["demand"], 1e3 * motion["position"],
               speed_scale * motion["speed"], motion["current"])  # fmt: skip
    np.savetxt(
        path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.6g"
    )
    return path


def guessed(tmp_path, capsys, log):
    target = tmp_path / "map.toml"
    assert main(["import", str(log), "--guess", "--out", str(target), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    return answer, tomllib.loads(target.read_text())


HEADERS = {
    "plain": "time_ms,pos_demand_mm,pos_mm,speed_mm/s,current_A",
    "bracketed": "t [ms],Position setpoint [mm],Position [mm],Velocity [mm/s],Motor current [A]",
    "units left out": "ms,demand,actual,velocity,i",
    "none": "",
}


@pytest.mark.parametrize("header", HEADERS.values(), ids=HEADERS.keys())
def test_a_linear_drive_is_recognised_and_its_map_imports(tmp_path, capsys, motion, header):
    log = written(tmp_path / "log.csv", motion, header)
    answer, stated = guessed(tmp_path, capsys, log)
    # Without a header or a unit nothing tells a current from another effort: that is asked.
    effort, unit = ("torque_current", "A") if header else ("effort", "1")
    assert [column["role"] for column in stated["column"]] == [
        "time", "command", "output_position", "output_speed", effort,
    ]  # fmt: skip
    assert [column["unit"] for column in stated["column"]] == ["ms", "mm", "mm", "mm/s", unit]
    question = {"role": "effort", "candidates": ["torque_current", "effort"]}
    assert (question in answer["questions"]) == (not header)
    assert all(column["reasons"] for column in answer["columns"])
    recording = import_log(log, column_map=tmp_path / "map.toml").recording
    np.testing.assert_allclose(
        recording.role("output_position").values, motion["position"], atol=1e-7
    )


def test_a_motors_speed_shows_the_ratio(tmp_path, capsys, motion):
    log = written(tmp_path / "log.csv", motion, "", speed_scale=60.0 / LEAD)
    answer, stated = guessed(tmp_path, capsys, log)
    assert answer["travel_per_turn_m"] == pytest.approx(LEAD, rel=0.01)
    roles = {column["role"]: column["unit"] for column in stated["column"]}
    assert roles["motor_speed"] == "rpm"
    assert roles["output_position"] == "mm"
    import_log(log, column_map=tmp_path / "map.toml")


def benchmark():
    """Columns as a public benchmark of robotics names them: a drive's command in no unit."""
    t = np.arange(0.0, 12.0, 0.002)
    goal, place = (0.1 * np.sin(2.0 * (x + 0.3 * np.sin(x))) for x in (t, t - 0.004))
    speed = np.gradient(place, t)
    force = 3.0 * np.gradient(speed, t) + 0.2 * np.sign(speed) + speed
    rng = np.random.default_rng(5)
    return {"t": t, "qg": goal, "qm": place + rng.normal(0.0, 1e-6, len(t)), "vir": force}


def test_an_effort_that_is_no_current_is_asked_for_and_taken():
    columns = benchmark()
    with pytest.raises(QuestionError, match="what is 'vir'"):
        read_log(columns)
    with pytest.raises(QuestionError, match=r"in what unit is 'qm'.*output_position=qm \[UNIT\]"):
        read_log(columns, roles={"effort": "vir"})
    log = read_log(columns, roles={"effort": "vir [V]", "output_position": "qm [m]"})
    assert {role: log.units[role] for role in log} == {
        "command": "m", "output_position": "m", "effort": "V",
    }  # fmt: skip
    np.testing.assert_array_equal(log["effort"], columns["vir"])
    as_current = read_log(
        columns, roles={"torque_current": "vir [0.5 A]", "output_position": "qm [mm]"}
    )
    np.testing.assert_allclose(as_current.current, 0.5 * columns["vir"])
    np.testing.assert_allclose(as_current.output, 1e-3 * columns["qm"])


@pytest.mark.parametrize(
    ("role", "answer", "message"),
    [
        ("effort", "vir [A]", "unit 'A'"),
        ("effort", "vr [V]", "unknown column 'vr'"),
        ("effrot", "vir", "unknown role 'effrot'"),
        ("output_position", "qm [-1 mm]", "must be above 0"),
        ("output_position", "qm [furlong]", "furlong"),
    ],
)
def test_an_answer_that_cannot_be_is_refused(role, answer, message):
    with pytest.raises(InputError, match=message):
        read_log(benchmark(), roles={role: answer})


def test_the_other_sign_is_seen(tmp_path, capsys, motion):
    log = written(tmp_path / "log.csv", motion, HEADERS["plain"], speed_scale=-1e3)
    _, stated = guessed(tmp_path, capsys, log)
    assert [column.get("sign", 1) for column in stated["column"]] == [1, 1, 1, -1, 1]


def test_the_drives_own_trace(tmp_path, capsys, truth):
    log = write_drive_csv(tmp_path / "log.csv", truth.signals)
    answer, stated = guessed(tmp_path, capsys, log)
    roles = {column["name"]: column["role"] for column in stated["column"]}
    assert roles["Drive_axis_1.r62"] == "speed_ref"
    assert roles["C1Drive_axis_1r4820"] == "motor_position"
    units = {column["role"]: column.get("unit") for column in stated["column"]}
    assert units["motor_position"] == "deg"
    assert answer["status"] == "ok"


def test_hints():
    assert role_hint("Motor current ref") == "current_ref"
    assert role_hint("current_a") == "current_a"
    assert role_hint("current_A") == "torque_current"
    assert role_hint("DC bus voltage") == "supply_voltage"
    assert (role_hint("Speed_mm_s"), unit_hint("Speed_mm_s", "")) == ("motor_speed", "mm/s")
    assert unit_hint("ramp_s", "") == "s"
    assert role_hint("column_3") == ""
    assert unit_hint("x", "nonsense") == ""
    assert unit_hint("pos_mm", "") == "mm"


@pytest.mark.parametrize(
    ("names", "role"),
    [
        (("time_s", "position_deg", "speed_deg_s", "current_a"), "torque_current"),
        (("time_s", "position_deg", "current_b", "current_a"), "current_a"),
        (("time", "position", "speed", "current_a"), "current_a"),
    ],
)
def test_a_last_word_is_the_unit_where_the_other_headers_end_in_theirs(names, role):
    time = np.arange(0.0, 4.0, 0.01)
    values = (time, 10.0 * np.sin(time), 10.0 * np.cos(time), np.sign(np.cos(time)))
    table = RawTable("log.csv", dict(zip(names, values, strict=True)))
    roles = {item.name: item.role for item in guess_map(table).columns}
    assert roles["current_a"] == role


def test_a_clock_whose_readings_repeat_has_a_unit():
    time = np.repeat(np.arange(0.0, 40.0), 10)
    table = RawTable("log.mat", {"t": time, "x": np.sin(time)})
    assert guess_map(table).columns[0].unit in {"s", "ms"}


def test_what_cannot_be_guessed_is_refused(tmp_path, capsys, motion):
    log = tmp_path / "log.csv"
    np.savetxt(log, np.sin(np.arange(200.0)).reshape(-1, 2), delimiter=",")
    assert main(["import", str(log), "--guess", "--out", str(tmp_path / "m.toml")]) == 2
    assert "none can be the time" in capsys.readouterr().err
    assert main(["import", str(log)]) == 2
    assert "--guess" in capsys.readouterr().err
    assert not (tmp_path / "m.toml").exists()
    assert math.isfinite(motion["current"].sum())


@pytest.mark.parametrize(
    ("header", "unit", "message"),
    [
        ("time,demand_mm,position_mm,speed_mm/s,current_A", "s", "the integral of its speed"),
        ("time_ms,demand_mm,position_mm,speed_mm/s,current_A", "s", "the motion contradicts it"),
        ("time_ms,demand,position,speed,current", "ms", "both are possible"),
        ("time,demand,position,speed,current", "s", "both are possible"),
    ],
)
def test_a_time_of_thousandths_is_no_ms_without_doubt(tmp_path, capsys, header, unit, message):
    t = np.round(np.arange(0.0, 4.0, 1e-3), 3)
    demand, position = (30.0 * np.sin(3.0 * (t - late)) for late in (0.0, 0.02))
    table = np.column_stack((t, demand, position, np.gradient(position, t), np.cos(3.0 * t)))
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=header, comments="", fmt="%.6f")
    answer, _ = guessed(tmp_path, capsys, tmp_path / "log.csv")
    column = answer["columns"][0]
    assert column["unit"] == unit
    assert any(message in reason for reason in column["reasons"]), column["reasons"]


def test_a_command_that_steps_once_is_no_clock(tmp_path, capsys, motion):
    """It rises throughout too, and a repeated clock is still one."""
    path = tmp_path / "log.csv"
    clock = np.floor(motion["t"] / 0.02) * 0.02
    step = np.where(motion["t"] < 6.0, 0.0, 0.05)
    rows = np.column_stack((step, clock, motion["position"], motion["speed"]))
    np.savetxt(path, rows, delimiter=",", header="a,b,position [mm],speed [mm/s]", comments="")
    answer, _ = guessed(tmp_path, capsys, path)
    assert [item["name"] for item in answer["columns"] if item["role"] == "time"] == ["b"]


@pytest.mark.parametrize("late", [0.0, 0.006, -0.02])
def test_a_channel_that_comes_later_is_reported_and_not_shifted(late):
    """The lag is the one set: a position recorded later than its speed, or sooner."""
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 12.0, 0.004)

    def swing(x):
        return 0.6 * np.sin(1.5 * x) + 0.2 * np.sin(4.4 * x + 0.5 * x**2 / 4.0)

    speed = (swing(t + 1e-6) - swing(t - 1e-6)) / 2e-6 + rng.normal(0.0, 0.01, len(t))
    place = swing(t - late) + rng.normal(0.0, 1e-4, len(t))
    found, deviation = lag_of(t, place, speed)
    assert found == pytest.approx(late, abs=max(4.0 * deviation, 0.02 * abs(late)))
    assert deviation < 2e-4
    columns = {"time [s]": t, "command [rad]": swing(t + 0.05), "output_position [rad]": place,
               "output_speed [rad/s]": speed, "torque_current [A]": np.sign(speed)}  # fmt: skip
    imported = imported_log(columns)
    lags = [f for f in imported.report.findings if f.code == "lag"]
    assert [f.place for f in lags] == (
        [] if late == 0.0 else ["output_position" if late > 0.0 else "output_speed"]
    )
    assert np.array_equal(imported.recording.role("output_position").values, place)


def test_a_report_draws_each_role_beside_its_reason(tmp_path, capsys, motion):
    log = written(tmp_path / "log.csv", motion, HEADERS["units left out"])
    page = tmp_path / "guess.html"
    assert main(["import", str(log), "--guess", "--report", str(page)]) == 0
    text = html.unescape(page.read_text())
    guess = json_of(tmp_path, capsys, log)
    sections = re.findall(r"<h2[^>]*>(.*?)</h2>", text, re.DOTALL)
    for role in guess["roles"]:
        assert role["role"] == "time" or any(role["role"] in heading for heading in sections)
        assert role["role"] == "time" or role["reason"] in text
    assert text.count('<section class="elevon-chart">') == len(guess["roles"]) - 1
    assert f"{len(guess['questions'])} question" in text or not guess["questions"]


def json_of(tmp_path, capsys, log):
    capsys.readouterr()
    assert main(["import", str(log), "--guess", "--json"]) == 0
    return json.loads(capsys.readouterr().out)
