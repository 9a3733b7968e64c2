"""The fault grammar, the catalogue, and what cannot be."""

import math
import re
import shlex
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import elevon
from elevon.errors import InputError, RangeError, UnknownNameError
from elevon.faults import Fault, Profile, catalogue, check_together, find_record

DOCS = Path(__file__).resolve().parents[2] / "docs" / "reference" / "faults.md"


def resolved(text, fidelity="high"):
    return Fault.parse(text).resolved("rotary", fidelity)


def test_a_full_specification():
    found = resolved(
        " jam @ transmission = 3 N m , position = 1 deg : ramp( start = 0.5 s, end = 800 ms )"
    )
    assert found["severity"] == 3.0
    assert found["attributes"] == {"position": pytest.approx(math.radians(1.0))}
    assert found["profile"]["kind"] == "ramp"
    assert found["profile"]["parameters"] == [0.5, 0.8]


def test_a_table():
    profile = resolved("short@motor.phase_a=0.2:table(times=0;5;10,values=0;0.5;1)")["profile"]
    assert profile["times"].tolist() == [0.0, 5.0, 10.0]
    assert profile["values"].tolist() == [0.0, 0.5, 1.0]


def documented():
    lines = re.findall(r"^elevon simulate (.*)$", DOCS.read_text(encoding="utf-8"), re.M)
    for line in lines:
        words = shlex.split(line)
        yield from (words[i + 1] for i, word in enumerate(words) if word == "--fault")


@pytest.mark.parametrize("text", list(documented()))
def test_every_documented_example_is_right(text):
    resolved(text)


numbers = st.floats(0.0, 0.9).map(repr)


@given(
    severity=numbers,
    phase=st.none() | numbers,
    profile=st.sampled_from(["", ":step(time=1.5)", ":ramp(start=0.5,end=2 s)", ":constant"]),
)
def test_text_and_object_are_the_same(severity, phase, profile):
    attribute = "" if phase is None else f",phase={phase} rad"
    fault = Fault.parse(f"eccentricity_static@motor={severity}{attribute}{profile}")
    assert Fault.parse(str(fault)) == fault
    assert Fault.from_dict(fault.to_dict()) == fault


@given(st.text(max_size=40))
def test_no_text_does_anything_but_read_or_refuse(text):
    with suppress(InputError):
        resolved(text)


REFUSED = {
    "short": (InputError, "is not of the form"),
    "short@motor.phase_a": (InputError, "is not of the form"),
    "short@motor.phase_a=": (InputError, "is not of the form"),
    "sort@motor.phase_a=0.1": (UnknownNameError, "did you mean 'short'"),
    "short@motor.phase_d=0.1": (UnknownNameError, "places: motor.phase_a, motor.phase_b"),
    "short@motor.phase_a=1.1": (RangeError, r"1\.1 is outside \[0, 0\.95\]"),
    "short@motor.phase_a=-0.1": (RangeError, "outside"),
    "short@motor.phase_a=nan": (RangeError, "not a finite number"),
    "short@motor.phase_a=0.1 N": (InputError, "is a force"),
    "backlash@transmission=1 m": (InputError, "expected an angle"),
    "short@motor.phase_a=0.1,phase=1": (UnknownNameError, "unknown attribute 'phase'"),
    "jam@transmission=1,postion=1": (UnknownNameError, "did you mean 'position'"),
    "jam@transmission=1,position": (InputError, "name=value"),
    "jam@transmission=1,position=1,position=2": (InputError, "given twice"),
    "short@motor.phase_a=0.1:rmp(end=1)": (UnknownNameError, "did you mean 'ramp'"),
    "short@motor.phase_a=0.1:ramp(nd=1)": (UnknownNameError, "did you mean 'end'"),
    "short@motor.phase_a=0.1:ramp": (InputError, "'end' is missing"),
    "short@motor.phase_a=0.1:ramp(start=3,end=1)": (InputError, "ends before it starts"),
    "short@motor.phase_a=0.1:ramp(start=1,end=1)": (InputError, "ends before it starts"),
    "short@motor.phase_a=0.1:intermittent(period=0)": (InputError, "must be positive"),
    "short@motor.phase_a=0.1:intermittent(period=1,duty=2)": (InputError, "from 0 to 1"),
    "short@motor.phase_a=0.1:table(times=0;1,values=0)": (InputError, "2 times but 1 values"),
    "short@motor.phase_a=0.1:table(times=1;0,values=0;1)": (InputError, "must increase"),
    "short@motor.phase_a=0.1:table(times=0;1,values=0;2)": (InputError, "from 0 to 1"),
    "short@motor.phase_a=0.1:table(times=0;x,values=0;1)": (InputError, "list of numbers"),
    "short@motor.phase_a=0.1:step(time=1": (InputError, "is not of the form"),
    "short@motor.phase_a=0.1:step(time=1,values=1)": (InputError, "only a table"),
}


@pytest.mark.parametrize("text", REFUSED)
def test_refused(text):
    error, message = REFUSED[text]
    with pytest.raises(error, match=message):
        resolved(text)


def test_a_fault_the_low_model_cannot_show_is_refused_there():
    hidden = [record for record in catalogue("rotary") if record.fidelities == ("high",)]
    assert hidden
    record = hidden[0]
    fault = Fault(record.kind, record.places[0], 0.0)
    fault.resolved("rotary", "high")
    with pytest.raises(InputError, match="fidelity high, not low"):
        fault.resolved("rotary", "low")


def test_one_kind_may_have_two_units():
    assert find_record("offset", "sensor.current_a", "rotary").unit == "A"
    assert find_record("offset", "sensor.encoder", "rotary").unit == "rad"


@pytest.mark.parametrize(
    "texts",
    [
        ("short@motor.phase_a=0.1", "short@motor.phase_a=0.2"),
        ("short@motor.phase_a=0.1", "open_phase@motor.phase_a=1"),
        ("shorted_switch@inverter.a_high=1", "open_switch@inverter.a_high=1"),
    ],
)
def test_contradictions(texts):
    with pytest.raises(InputError, match=r"contradict|given twice"):
        check_together([Fault.parse(text) for text in texts])


def test_different_places_do_not_contradict():
    texts = ("short@motor.phase_a=0.1", "short@motor.phase_b=0.1", "open_phase@motor.phase_c=1")
    check_together([Fault.parse(text) for text in texts])


def test_the_severity_applied_is_recorded():
    scenario = elevon.Scenario.from_dict({"duration": "0.1 s"}).with_faults(
        [
            Fault("friction", "transmission", 0.5, profile=Profile("step", {"time": "50 ms"})),
            "backlash@transmission=0.1 deg:ramp(end=100 ms)",
        ]
    )
    recording = elevon.simulate(
        elevon.Actuator.load("torino-rotary"), scenario, record="output_position@1 kHz"
    )
    assert [label["channel"] for label in recording.labels] == ["fault_1", "fault_2"]
    step, ramp = recording["fault_1"], recording["fault_2"]
    assert step.values.tolist() == [0.0] * 50 + [0.5] * 51
    assert ramp.unit == "rad"
    assert ramp.to("deg") == pytest.approx(ramp.time, abs=2e-3)
