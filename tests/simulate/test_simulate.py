"""What `simulate` takes beside a scenario: a duration, faults, a list of signals."""

import pytest

import elevon
from elevon.errors import ArgumentTypeError, InputError, UnknownNameError

SINE = {"kind": "sine", "amplitude": "5 deg", "frequency": "2 Hz"}
SCENARIO = {"duration": "1 s", "command": {"terms": [SINE]}}
BACKLASH = "backlash@transmission=1 deg"


def _run(**options):
    return elevon.simulate("torino-rotary", SCENARIO, fidelity="low", **options)


def test_duration_and_faults_are_those_of_a_scenario():
    whole = {**SCENARIO, "duration": "60 ms", "fault": [BACKLASH]}
    same = elevon.simulate("torino-rotary", whole, fidelity="low")
    ours = _run(duration="60 ms", faults=[BACKLASH])
    assert ours.names == same.names
    assert all(ours[name].equals(same[name]) for name in same.names)
    assert _run(duration=0.06, faults=[BACKLASH]).clock().time[-1] == pytest.approx(0.06)


def test_a_list_of_signals_takes_the_usual_rate():
    recording = _run(duration=0.1, record=["output_position", "current_q@1 kHz"])
    assert {name: clock.rate for name, clock in recording.clocks.items()} == {
        "at_400_hz": pytest.approx(400.0),
        "at_1000_hz": pytest.approx(1000.0),
    }
    assert set(recording.names) == {"output_position", "current_q"}


def test_units_in_the_columns_of_a_table():
    table = _run(duration=0.05, record=["output_position", "current_q"]).to_pandas(units=True)
    assert list(table.columns) == ["output_position [rad]", "current_q [A]"]
    assert table.index.name == "time [s]"
    assert table.attrs["units"]["current_q"] == "A"


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"faults": BACKLASH}, ArgumentTypeError, "expected a list"),
        ({"faults": ["shor@motor.phase_a=1"]}, UnknownNameError, "did you mean 'short'"),
        ({"duration": "2 N"}, InputError, "expected a time"),
        ({"duration": 0}, InputError, "longer than zero"),
        ({"record": ["output_positon"]}, UnknownNameError, "output_position"),
    ],
)
def test_what_cannot_be_is_refused(options, error, words):
    with pytest.raises(error, match=words):
        _run(**options)
