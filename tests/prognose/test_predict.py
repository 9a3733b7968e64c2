"""From a folder of inspections to the remaining life, on the model."""

import json
from dataclasses import replace

import numpy as np
import pytest
import tomlkit

from elevon import Actuator, Scenario, simulate
from elevon.errors import FormatError, InputError
from elevon.number_text import count_text
from elevon.prognose import LAWS, Inspection, Law, Mission, Seen, predict, respond
from elevon.prognose.history import read_history, write_stamp
from elevon.prognose.requirement import MEASURES, Requirement, RunSignals
from tests.cli.conftest import elevon_cli  # noqa: F401 - a fixture

KEY = "backlash@transmission"
FLIGHT = {
    "unit": "flights", "hours": 1.5, "repeats": 200,
    "scenario": {
        "duration": "10 s",
        "command": {"terms": [{"kind": "sine", "amplitude": "7 deg", "frequency": "0.2 Hz"}]},
        "load": {"output": {"terms": [
            {"kind": "sine", "amplitude": "60 N m", "frequency": "0.2 Hz"}]}},
    },
    "requirement": [
        {"name": "error", "measure": "tracking_error", "limit": "1.8 deg", "after": 5},
    ],
    "growth": [{"law": "gear_wear", "dormant": 0}],
}  # fmt: skip


def mission(**changes):
    return Mission.from_dict({**FLIGHT, **changes})


@pytest.fixture(scope="module")
def unit():
    return Actuator.load("torino-rotary")


@pytest.fixture(scope="module")
def tables(unit):
    return respond(unit, mission())


def inspections(rate=4e-6, uses=(300, 700, 1200, 2000)):
    return [Inspection(u, {KEY: Seen(rate * u, 3e-4, 3e-4)}, name=f"{u}.json") for u in uses]


def diagnosis(severity):
    return {
        "status": "faulty",
        "faults": [{"kind": "backlash", "place": "transmission", "probability": 0.99,
                    "severity": severity, "interval": [severity - 4e-4, severity + 4e-4]}],
        "detectable": {KEY: 3e-4},
    }  # fmt: skip


def folder(place, **stamps):
    for k, item in enumerate(inspections()):
        extra = {key: value[k] for key, value in stamps.items()}
        write_stamp(place / f"{k}.json", diagnosis(4e-6 * item.usage), usage=item.usage,
                    unit="flights", **extra)  # fmt: skip
    return place


def test_the_answer_is_where_the_model_meets_its_requirement(unit, tables):
    result = predict(inspections(), unit, mission(), response=tables)
    backlash = np.linspace(0.0, LAWS["gear_wear"].highest, 400)
    errors = tables.measured(backlash[:, None])[0]
    end = np.interp(np.radians(1.8), errors, backlash) / 4e-6
    low, high = result.interval
    assert low < end - 2000.0 < high
    assert result.median == pytest.approx(end - 2000.0, rel=0.25)
    assert result.first == {"error": 1.0}
    assert result.survives(0.0) == 1.0
    answer = replace(result, horizons=(100.0,)).to_dict()
    assert answer["rul"]["unit"] == "flights"
    assert answer["p_survive"] == [[100.0, 1.0]]
    assert answer["eol_samples"] == 2000
    assert answer["findings"] == []


def test_more_inspections_narrow_the_answer_and_too_few_say_how_wide_it_is(unit, tables):
    few = predict(inspections(uses=(300,)), unit, mission(), response=tables)
    none = predict([], unit, mission(), response=tables)
    many = predict(inspections(), unit, mission(), response=tables)
    widths = [r.interval[1] / r.interval[0] for r in (none, few, many)]
    assert widths[0] > widths[1] > 2.0 * widths[2]
    for result in (few, none):
        assert "3 are needed" in result.findings[0]
        assert " to ".join(map(count_text, result.interval)) in result.findings[0]


def test_a_last_diagnosis_beyond_the_requirement_is_said_even_where_it_is_taken_as_stray(
    unit, tables
):
    last = Inspection(2100.0, {KEY: Seen(0.028, 3e-4, 3e-4)}, name="last.json")
    result = predict([*inspections(), last], unit, mission(), response=tables)
    (finding,) = [text for text in result.findings if "last.json" in text]
    assert "if what it says of backlash@transmission is true, the unit has failed" in finding
    assert "requirement error: 2" in finding
    assert "deg, limit 1.8 deg" in finding
    near = Inspection(2100.0, {KEY: Seen(4e-6 * 2100.0, 3e-4, 3e-4)}, name="last.json")
    assert predict([*inspections(), near], unit, mission(), response=tables).findings == ()


def test_margin_and_severity_limits_and_a_least_value(unit):
    stall = {"name": "stall", "measure": "stall_load", "limit": "1200 N m", "slope": "10 deg/s",
             "load_slope": "150 N m/s", "margin": 0.1}  # fmt: skip
    bare = {"name": "backlash", "measure": "severity", "fault": KEY, "limit": "0.5 deg"}
    flight = mission(requirement=[stall, bare, *FLIGHT["requirement"]])
    tables = respond(unit, flight)
    assert tables.thresholds[0] == pytest.approx(1320.0)
    reserve = tables.reserve(np.array([[0.0], [np.radians(0.5)], [np.radians(0.6)]]))
    assert reserve[1] == pytest.approx([1.0, 0.0, -0.2])
    assert reserve[0, 0] == pytest.approx(tables.values[0, 0] / 1320.0 - 1.0)
    assert predict(inspections(), unit, flight, response=tables).first["backlash"] == 1.0


def test_a_law_of_ones_own(unit):
    def creep(damage, drivers, c):
        return c["pace"] * drivers["shaft_travel"] * (1.0 + damage / 0.01)

    base = LAWS["gear_wear"]
    law = Law(
        name="creep", text="", source="a user's", kind="backlash", place="transmission", unit="rad",
        rate=creep, drivers=("shaft_travel",), highest=base.highest,
        coefficients={"pace": base.coefficients["wear"]},
    )  # fmt: skip
    flight = mission(growth=[{"law": "creep"}])
    laws = flight.laws({"creep": law})
    result = predict(inspections(), unit, flight, response=respond(unit, flight, laws=laws))
    assert result.known[0].law == "creep"
    assert np.isfinite(result.median)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"requirement": []}, "at least one"),
        ({"growth": [{"law": "gear_ware"}]}, "gear_wear"),
        ({"growth": [{"law": "gear_wear"}, {"law": "screw_wear"}]}, "two laws drive"),
        ({"growth": [{"law": "gear_wear", "coefficients": {"wera": 1.0}}]}, "wear"),
        (
            {"requirement": [{"name": "a", "measure": "trackin_error", "limit": 1}]},
            "tracking_error",
        ),
        ({"requirement": [{"name": "a", "measure": "stall_load", "limit": 1}]}, "needs 'slope'"),
        ({"unit": "hours"}, "hours"),
        ({"scenario": {**FLIGHT["scenario"], "durasion": 1}}, "duration"),
        ({"repeats": 0}, "above 0"),
        ({"usage": {"load_spread": 3}}, "outside"),
    ],
)
def test_bad_missions_are_refused(changes, text):
    with pytest.raises(InputError, match=text):
        mission(**changes).laws()


def test_a_mission_beyond_the_actuator_and_a_requirement_violated_at_the_start(unit):
    fast = {**FLIGHT["scenario"], "command": {"terms": [
        {"kind": "sine", "amplitude": "40 deg", "frequency": "2 Hz"}]}}  # fmt: skip
    with pytest.raises(InputError, match=r"outside the capability.* deg of the 80 deg"):
        respond(unit, mission(scenario=fast))
    strict = [{"name": "error", "measure": "tracking_error", "limit": "0.2 deg", "after": 5}]
    with pytest.raises(InputError, match=r"requirement error: .* deg, limit 0\.2 deg"):
        predict([], unit, mission(requirement=strict))
    with pytest.raises(InputError, match="locked"):
        lock = [{"name": "lock", "measure": "lock_time", "limit": "2 s"}]
        respond(unit, mission(requirement=lock))


def test_a_unit_beyond_its_end_has_no_life_left(unit, tables):
    result = predict(inspections(rate=2e-5), unit, mission(), response=tables)
    assert result.median == 0.0
    assert any("already reached" in text for text in result.findings)


def test_histories_that_are_none(tmp_path):
    with pytest.raises(InputError, match="no inspections"):
        read_history(tmp_path, unit="flights")
    place = folder(tmp_path)
    assert [e.usage for e in read_history(place, unit="flights").entries] == [300, 700, 1200, 2000]
    with pytest.raises(InputError, match="counted in flights"):
        read_history(place, unit="hours")

    def changed(name="1.json", **values):
        data = json.loads((place / name).read_text())
        (place / "9.json").write_text(json.dumps({**data, **values}))
        return pytest.raises((InputError, FormatError))

    with changed(usage=-1) as error:
        read_history(place, unit="flights")
    assert "usage" in str(error.value)
    with changed(usage=3000, unit="hours") as error:
        read_history(place, unit="flights")
    assert "more than one unit of use" in str(error.value)
    with changed(usage=3000, usag=1) as error:
        read_history(place, unit="flights")
    assert "usag" in str(error.value)
    with changed(usage=3000, date="22.11.2026") as error:
        read_history(place, unit="flights")
    assert "2026-11-22" in str(error.value)
    (place / "9.json").write_text("{")
    with pytest.raises(FormatError, match="not JSON"):
        read_history(place, unit="flights")


def test_two_units_and_dates_against_use(tmp_path):
    place = folder(tmp_path, serial=["A", "A", "B", "B"])
    with pytest.raises(InputError, match=r"more than one unit: A \(0.json\) and B"):
        read_history(place, unit="flights")
    place = folder(
        tmp_path / "dated", date=["2026-01-05", "2026-04-01", "2026-03-01", "2026-05-01"]
    )
    with pytest.raises(InputError, match="out of order: use falls"):
        read_history(place, unit="flights")


def test_the_command_line(elevon_cli, tmp_path):  # noqa: F811
    place = folder(tmp_path / "unit", serial=["A7"] * 4)
    page = tmp_path / "page.html"
    flight = tmp_path / "flight.toml"
    flight.write_text(tomlkit.dumps(FLIGHT))
    options = ("--actuator", "torino-rotary", "--mission", flight, "--json")
    got = elevon_cli("predict", place, *options, "--report", page)
    assert got.code == 0, got.err
    answer = json.loads(got.out)
    assert answer["serial"] == "A7"
    assert {"median", "interval", "unit"} <= answer["rul"].keys()
    low, high = answer["rul"]["interval"]
    assert 0.0 < low < answer["rul"]["median"] < high
    assert len(answer["p_survive"]) == 10
    assert answer["first_requirement"] == "error"
    assert "Remaining life" in page.read_text("utf-8")
    again = elevon_cli("predict", place, *options)
    assert json.loads(again.out)["rul"] == answer["rul"]
    bad = elevon_cli("predict", tmp_path / "none", *options)
    assert (bad.code, bad.out) == (2, "")
    assert "is not a folder" in bad.err


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
def test_a_history_of_logs_is_diagnosed_on_the_way(elevon_cli, tmp_path):  # noqa: F811
    place = tmp_path / "unit"
    for k, use in enumerate((0, 500, 1000, 1500)):
        fault = () if use == 0 else ("--fault", f"backlash@transmission={4e-6 * use!r} rad")
        logs = []
        for test in ("backlash", "chirp"):
            options = ("--actuator", "torino-rotary", "--fidelity", "low", "--seed", k, *fault)
            got = elevon_cli("bench", "run", test, "--out", place / f"{test}{use}", *options)
            assert got.code == 0, got.err
            logs.append(f"{test}{use}/{test}.csv")
        stamp = {"usage": use, "unit": "flights", "logs": logs, "healthy": use == 0}
        (place / f"{k}.json").write_text(json.dumps(stamp))
    flight = tmp_path / "flight.toml"
    flight.write_text(tomlkit.dumps(FLIGHT))
    got = elevon_cli("predict", place, "--actuator", "torino-rotary", "--mission", flight, "--json")
    assert got.code == 0, got.err
    answer = json.loads(got.out)
    (backlash,) = answer["faults"]
    assert backlash["severity"] == pytest.approx(4e-6 * 1500, rel=0.1)
    assert backlash["inspections"] == 3


def test_the_airs_temperature_sets_what_the_actuator_has():
    warm = mission(temperature="45 degC")
    every = warm.scenarios().parameters
    assert set(every) == {"thermal.ambient", "motor.winding_temperature"}
    assert set(warm.scenarios(known=["motor.winding_temperature"]).parameters) < set(every)
    with pytest.raises(InputError, match=r"temperature: the actuator has neither thermal.ambient"):
        warm.scenarios(known=["backlash.total"])


def test_the_time_of_the_tables_is_told_whoever_made_them(unit, tables):
    result = predict(inspections(), unit, mission(), response=tables)
    assert result.seconds["tables"] == tables.seconds > 0.0


def test_a_part_made_new_is_known_since_then(unit, tables):
    worn = inspections()
    new = Inspection(2000, worn[-1].seen, reset=(KEY,), name="new.json")
    result = predict([*worn[:-1], new], unit, mission(), response=tables)
    assert "0 inspection(s) saw a growing fault since its part was made new" in result.findings[0]


def test_a_ball_screw_and_its_stall_load():
    actuator = Actuator.load("nasa-ballscrew")
    flight = Mission.from_dict({
        "unit": "cycles", "hours": 0.01,
        "scenario": {
            "duration": "4 s",
            "command": {"terms": [{"kind": "sine", "amplitude": "20 mm", "frequency": "0.5 Hz"}]},
            "load": {"output": {"terms": [
                {"kind": "sine", "amplitude": "2000 N", "frequency": "0.5 Hz"}]}},
        },
        "requirement": [
            {"name": "backlash", "measure": "severity", "fault": KEY, "limit": "0.5 mm"},
            {"name": "stall", "measure": "stall_load", "limit": "3000 N", "slope": "20 mm/s",
             "load_slope": "1500 N/s"},
        ],
        "growth": [{"law": "screw_wear", "dormant": 0}],
    })  # fmt: skip
    tables = respond(actuator, flight)
    assert tables.units == ("m", "N")
    assert tables.values[0, 1] > 3000.0
    result = predict([], actuator, flight, response=tables)
    mean = 0.5e-3 / (2e-11 * tables.drivers["friction_work"][0])
    assert result.median == pytest.approx(mean, rel=0.2)


def test_no_load_speed_is_the_greatest_that_holds():
    """The bench's drive turns at 500 rpm at most: 24.2 deg/s behind 1:124."""
    requirement = Requirement(name="fast", measure="no_load_speed", limit="15 deg/s", step="60 deg")
    assert requirement.unit("rad", "N m", {}) == "rad/s"
    time = np.arange(0.0, 2.0, 0.01)
    position = -np.clip(0.5 * time, 0.0, 0.6)
    run = RunSignals(time, {"command": np.full(200, -1.0), "output_position": position})
    assert requirement.value([run]) == pytest.approx(0.5, rel=1e-6)
    flight = Scenario.from_dict(FLIGHT["scenario"])
    (scenario,) = MEASURES["no_load_speed"].scenarios(requirement, flight)
    done = simulate(
        "torino-rotary", scenario, fidelity="low", record="command,output_position@400 Hz"
    )
    signals = {name: done[name].values for name in ("command", "output_position")}
    speed = requirement.value([RunSignals(done["command"].time, signals)])
    assert speed == pytest.approx(500 * np.pi / 30 / 124, rel=0.01)
    assert speed > requirement.threshold("rad/s")


def test_a_landing_gear_locks_in_time_until_its_bearings_are_worn():
    actuator = Actuator.load("pisa-landing-gear")
    scenario = dict(actuator.default_scenario)
    lock = {"name": "lock", "measure": "lock_time", "limit": "20 s"}
    bare = {"name": "rotor", "measure": "severity", "fault": "eccentricity_static@motor",
            "limit": 0.3}  # fmt: skip
    growth = [{"law": "bearing_wear", "dormant": 0, "coefficients": {"wear": 1e-8}}]
    flight = Mission.from_dict({"unit": "landings", "hours": 0.02, "scenario": scenario,
                               "requirement": [lock, bare], "growth": growth})  # fmt: skip
    tables = respond(actuator, flight)
    assert 2.0 < tables.values[0, 0] < 9.0
    result = predict([], actuator, flight, response=tables)
    assert result.first["rotor"] > 0.99
    tracking = {"name": "error", "measure": "tracking_error", "limit": "1 mm"}
    with pytest.raises(InputError, match="is no position"):
        respond(actuator, flight.model_copy(update={"requirement": (Requirement(**tracking),)}))
