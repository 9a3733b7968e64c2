"""Scenarios: what is accepted, what crosses the seam, what every refusal says."""

import math

import numpy as np
import pytest

import elevon
from elevon.errors import FormatError, InputError, UnitError, UnknownNameError
from elevon.scenario import Scenario, compile_scenario
from elevon.waveforms import wave_records

SINE = {"kind": "sine", "amplitude": "7 deg", "frequency": "0.2 Hz"}


def scenario(**changes):
    return {"duration": "1 s", "command": {"terms": [SINE]}} | changes


def compiled(**changes):
    return compile_scenario(Scenario.from_dict(scenario(**changes)), "rotary", "high")


def test_reads_and_writes_the_same():
    data = scenario(
        load={"brake": {"terms": [{"kind": "constant", "value": "1 N m", "enabled": False}]}},
        supply={"terms": [{"kind": "ramp", "slope": "-10 V/s", "initial": 380}]},
        ambient={"terms": [{"kind": "step", "initial": "20 degC", "final": "-40 degC"}]},
        fault=[{"kind": "short", "place": "motor.phase_a", "severity": "10 %"}],
        initial={"motor_speed": "10 rpm"},
        parameters={"motor.inertia": "9 kg cm2"},
    )
    read = Scenario.from_dict(data)
    assert Scenario.from_dict(read.to_dict()) == read
    assert read.to_dict() == data


def test_values_cross_in_si_in_the_order_of_the_records():
    term = compiled().inputs["command"][0]
    names = wave_records()["sine"].names
    values = dict(zip(names, term["parameters"], strict=True))
    assert values["amplitude"] == pytest.approx(math.radians(7.0))
    assert values["frequency"] == 0.2
    assert values["end"] == math.inf


def test_air_is_in_kelvin_and_a_file_says_so(tmp_path):
    air = {"terms": [{"kind": "constant", "value": "-40 degC"}]}
    assert compiled(ambient=air).inputs["ambient"][0]["parameters"] == [pytest.approx(233.15)]
    file = tmp_path / "scenario.toml"
    file.write_text('duration = "1 s"\n[[ambient.terms]]\nkind = "constant"\nvalue = 20\n')
    with pytest.raises(UnitError, match=r"ambient\.terms.*degC"):
        Scenario.load(file)


def test_the_unit_of_the_command_goes_with_its_mode():
    speed = {"mode": "speed", "terms": [{"kind": "ramp", "slope": "60 rpm/s"}]}
    found = compiled(command=speed)
    assert found.command_mode == "speed"
    assert found.inputs["command"][0]["parameters"][1] == pytest.approx(2.0 * math.pi)
    torque = {"mode": "torque", "terms": [{"kind": "constant", "value": "50 N cm"}]}
    assert compiled(command=torque).inputs["command"][0]["parameters"] == [0.5]
    with pytest.raises(UnitError, match="expected a"):
        compiled(command={"mode": "torque", "terms": [SINE]})


def test_a_file_of_points_is_found_beside_the_scenario(tmp_path):
    (tmp_path / "points.csv").write_text("time,value\n0,0\n1,10\n2.5,-5\n")
    file = tmp_path / "scenario.toml"
    file.write_text(
        'duration = 3\n[[command.terms]]\nkind = "table"\nfile = "points.csv"\n'
        'unit = "deg"\nrepeat = true\n'
    )
    term = compile_scenario(Scenario.load(file), "rotary", "high").inputs["command"][0]
    assert term["times"].tolist() == [0.0, 1.0, 2.5]
    assert np.degrees(term["values"]) == pytest.approx([0.0, 10.0, -5.0])
    assert term["parameters"][1] == 1.0


def test_a_table_of_points_reaches_the_model():
    table = {"kind": "table", "times": [0, 1, 2], "values": [0, 2, -1], "unit": "deg"}
    run = elevon.simulate(
        elevon.Actuator.load("torino-rotary"),
        Scenario.from_dict({"duration": "2 s", "command": {"terms": [table]}}),
        fidelity="low",
        record="command@100 Hz",
    )
    time, command = run["command"].time, run["command"].to("deg")
    assert command == pytest.approx(np.interp(time, [0, 1, 2], [0, 2, -1]), abs=1e-9)


REFUSED = {
    "no duration": ({"command": {}}, "duration: is missing"),
    "zero duration": (scenario(duration=0), "longer than zero"),
    "negative duration": (scenario(duration="-1 s"), "longer than zero"),
    "nan": (scenario(duration=math.nan), "nan is not a finite number"),
    "wrong kind": (scenario(duration="1 m"), "expected a time"),
    "bool": (scenario(duration=True), "is not a number"),
    "unknown key": (scenario(comand={}), "did you mean 'command'"),
    "unknown inner key": (scenario(command={"tems": []}), "did you mean 'terms'"),
    "unknown load": (scenario(load={"brak": {}}), "did you mean 'brake'"),
    "mode": (scenario(command={"mode": "speeed"}), "position"),
    "waveform": (scenario(command={"terms": [{"kind": "sin"}]}), "did you mean 'sine'"),
    "parameter": (
        scenario(command={"terms": [{**SINE, "frequncy": 1}]}),
        "did you mean 'frequency'",
    ),
    "needed": (scenario(command={"terms": [{"kind": "sine"}]}), "a sine needs 'amplitude'"),
    "points of a sine": (
        scenario(command={"terms": [{**SINE, "times": [0]}]}),
        "unknown key 'times' of a sine",
    ),
    "no points": (scenario(command={"terms": [{"kind": "table"}]}), "either 'times'"),
    "falling times": (
        scenario(command={"terms": [{"kind": "table", "times": [0, 2, 1], "values": [0, 0, 0]}]}),
        r"times\[2\] = 1 follows 2",
    ),
    "lengths": (
        scenario(command={"terms": [{"kind": "table", "times": [0, 1], "values": [0]}]}),
        "2 times but 1 values",
    ),
    "infinite point": (
        scenario(command={"terms": [{"kind": "table", "times": [0], "values": [math.inf]}]}),
        "inf is not a finite number",
    ),
    "enabled": (scenario(command={"terms": [{**SINE, "enabled": "yes"}]}), "enabled"),
    "fault text": (scenario(fault=["short"]), "is not of the form KIND@PLACE"),
    "fault key": (scenario(fault=[{"kind": "short"}]), "'place' is missing"),
    "fault profile": (
        scenario(fault=[{"kind": "a", "place": "b", "severity": 1, "profile": 3}]),
        "neither a table nor a text",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name):
    data, message = REFUSED[name]
    with pytest.raises(InputError, match=message):
        Scenario.from_dict(data)


REFUSED_FOR_THIS_ACTUATOR = {
    "unit": ({"command": {"terms": [{**SINE, "amplitude": "7 m"}]}}, "expected an angle"),
    "unknown unit": (
        {"command": {"terms": [{**SINE, "amplitude": "7 dge"}]}},
        "deg",
    ),
    "frequency": ({"command": {"terms": [{**SINE, "frequency": -1}]}}, "must not be negative"),
    "end": ({"command": {"terms": [{**SINE, "start": 2, "end": 1}]}}, "ends before it starts"),
    "triangle": (
        {"command": {"terms": [{"kind": "triangle", "amplitude": 1, "frequency": 0}]}},
        "must be positive",
    ),
    "sweep": (
        {
            "command": {
                "terms": [{"kind": "chirp", "amplitude": 1, "end_frequency": 1, "sweep_time": 0}]
            }
        },
        "must be positive",
    ),
    "duty": (
        {"command": {"terms": [{"kind": "rectangle", "high": 1, "period": 1, "duty": 1.5}]}},
        "from 0 to 1",
    ),
    "cycle": (
        {"command": {"terms": [{"kind": "trapezoid", "high": 1, "rise": 0, "fall": 0}]}},
        "longer than zero",
    ),
    "cycle below rounding": (
        {"command": {"terms": [{"kind": "trapezoid", "high": 1, "rise": 1e-17, "fall": 1e-17}]}},
        "at least 1e-09 s",
    ),
    "cycle far away": (
        {"command": {"terms": [{**SINE, "frequency": 1e4, "start": -1e9}]}},
        "frequency = 10000 Hz: above 1000",
    ),
    "period below rounding": (
        {"command": {"terms": [{"kind": "rectangle", "high": 1, "period": 1e-20}]}},
        "period = 1e-20 s: below 1e-09",
    ),
    "frequency above rounding": (
        {"command": {"terms": [{"kind": "triangle", "amplitude": 1, "frequency": 1e17}]}},
        r"above 1e\+09",
    ),
    "repeat": (
        {"command": {"terms": [{"kind": "table", "times": [0], "values": [0], "repeat": 2}]}},
        "true or false",
    ),
    "flag": ({"command": {"terms": [{**SINE, "phase": True}]}}, "is not a number"),
    "signal": ({"initial": {"mtor_speed": 1}}, "did you mean 'motor_speed'"),
    "derived signal": ({"initial": {"motor_torque": 1}}, "cannot be set"),
    "signal unit": ({"initial": {"motor_speed": "1 rad"}}, "expected an angular speed"),
}


@pytest.mark.parametrize("name", REFUSED_FOR_THIS_ACTUATOR)
def test_refused_for_this_actuator(name):
    changes, message = REFUSED_FOR_THIS_ACTUATOR[name]
    with pytest.raises(InputError, match=message):
        compiled(**changes)


def test_bad_override_names_the_place():
    actuator = elevon.Actuator.load("torino-rotary")
    bad = Scenario.from_dict(scenario(parameters={"motor": {"inertai": 1}}))
    with pytest.raises(
        UnknownNameError, match=r"scenario parameters.*did you mean 'motor\.inertia"
    ):
        elevon.simulate(actuator, bad)


def test_errors_name_file_and_line(tmp_path):
    file = tmp_path / "bad.toml"
    file.write_text('duration = 1\n\n[[command.terms]]\nkind = "sine"\namplitude = [1]\n')
    with pytest.raises(InputError, match=r"bad\.toml:5: command\.terms\[0\]\.amplitude"):
        Scenario.load(file)
    file.write_text("duration = \n")
    with pytest.raises(FormatError, match="line 1"):
        Scenario.load(file)
    with pytest.raises(InputError, match="cannot be read"):
        Scenario.load(tmp_path / "absent.toml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0,0\n1\n", r"points\.csv:2: expected two numbers"),
        ("0,0\n1,x\n", r"points\.csv:2"),
        ("0,0\n1,nan\n", r"points\.csv:2"),
        ("0,0\n0,1\n", "must increase"),
        ("time,value\n", "no points"),
    ],
)
def test_malformed_files_of_points(tmp_path, text, message):
    (tmp_path / "points.csv").write_text(text)
    file = tmp_path / "scenario.toml"
    file.write_text('duration = 1\n[[command.terms]]\nkind = "table"\nfile = "points.csv"\n')
    with pytest.raises(InputError, match=message):
        Scenario.load(file)


@pytest.mark.parametrize("given", [1.5, ["a.csv"]])
def test_a_table_file_that_is_no_path_is_refused(given):
    from elevon.series import read_series

    with pytest.raises(InputError, match=r"terms\[0\]: .* is not the path of a file"):
        read_series(given, "terms[0]")
