"""What people type first: the message leads to what they meant; what works in Python works."""

import numpy as np
import pytest

import elevon
from elevon.errors import InputError, OutputExistsError

SHIPPED = "nasa-ballscrew, nasa-dema, pisa-landing-gear, torino-rotary"
STUMBLES = {
    ("new", "x", "--linear", "--force", "2kN"): "rated force of a ram is --thrust",
    ("simulate",): SHIPPED,
    ("diagnose", "a.csv"): SHIPPED,
    ("plot", "mine.toml"): "is an actuator or a scenario, not a recording",
    ("simulate", "torino-rotary", "--fault", "backlash=1 deg"): "backlash@transmission=1 deg",
    ("simulate", "torino-rotary", "--fault", "short=0.1"): "'short@motor.phase_b=0.1'",
}


@pytest.mark.parametrize("words", STUMBLES)
def test_a_stumble_is_answered_with_what_was_meant(elevon_cli, words):
    result = elevon_cli(*words)
    assert result.code == 2
    assert STUMBLES[words] in result.err


def test_another_extra_word_has_no_hint_of_thrust(elevon_cli):
    assert "thrust" not in elevon_cli("new", "x", "--linear", "2kN").err


def test_faults_fit_eighty_columns_without_a_terminal(elevon_cli, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert max(map(len, elevon_cli("list", "faults").out.splitlines())) <= 80


def test_the_way_to_replace_a_file_is_said_once(tmp_path):
    growth = elevon.simulate("torino-rotary", {"duration": "10 ms"}, fidelity="low")
    growth.save(tmp_path / "a.csv")
    with pytest.raises(OutputExistsError) as caught:
        growth.save(tmp_path / "a.csv")
    assert str(caught.value).count("--force") == 1


def test_what_people_type_first_works_in_python(monkeypatch):
    monkeypatch.delenv("ELEVON_ACTUATORS", raising=False)
    assert ", ".join(elevon.actuators()) == SHIPPED
    actuator = elevon.Actuator.load("torino-rotary")
    table = actuator.parameters.to_pandas()
    assert len(table) == len(actuator.parameters)
    assert table.loc["gear.ratio", "value"] == actuator.parameters["gear.ratio"].value
    scenario = {"duration": "20 ms"}
    one = elevon.simulate(actuator, scenario, fidelity="low", record="output_position")
    assert np.array_equal(one.time, one["output_position"].time)
    assert one.plot().axes
    two = elevon.simulate(
        actuator, scenario, fidelity="low", record=["output_position", "current_q@1 kHz"]
    )
    with pytest.raises(InputError, match="2 clocks; name one of 'at_400_hz', 'at_1000_hz'"):
        _ = two.time
