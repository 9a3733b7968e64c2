"""Numbers without a unit: refused in texts and files that could mean two things, SI in Python."""

import json

import pytest

from elevon import Actuator, Scenario
from elevon.errors import UnitError

ACTUATOR = Actuator.load("torino-rotary")


def test_a_setting_without_a_unit_is_refused_with_both_readings(elevon_cli):
    result = elevon_cli("show", "torino-rotary", "--set", "motor.inertia=8", "--json")
    assert result.code == 2
    assert result.out == ""
    for part in ("motor.inertia: 8", "'8 kg cm2' (0.0008 kg m2)", "'8 kg m2' (80000 kg cm2)"):
        assert part in result.err


def test_every_change_is_reported_on_stderr(elevon_cli):
    changes = (
        "motor.inertia=8 kg m2",
        "friction.dynamic=0.6",
        "drive.kind=pwm",
        "backlash.total=0",
    )
    settings = [part for change in changes for part in ("--set", change)]
    result = elevon_cli("show", "torino-rotary", *settings, "--json")
    assert json.loads(result.out)["name"] == "torino-rotary"
    lines = result.err.splitlines()
    assert "motor.inertia 7.7 -> 80000 kg cm2, x 10390" in lines
    assert "friction.dynamic 0.3 -> 0.6 N m, x 2" in lines
    assert "drive.kind hysteresis -> pwm" in lines
    assert "backlash.total 0.365568 -> 0 deg, x 0" in lines


def test_what_is_not_changed_is_not_reported(elevon_cli):
    same = elevon_cli("show", "torino-rotary", "--set", "motor.inertia=7.7 kg cm2", "--json")
    assert same.err == ""


def test_in_python_a_number_is_si_and_a_text_has_a_unit():
    assert ACTUATOR.with_values({"motor.inertia": 8e-4}).parameters.value("motor.inertia") == 8e-4
    with pytest.raises(UnitError, match="8 kg cm2"):
        ACTUATOR.with_values({"motor.inertia": "8"})
    sine = {"kind": "sine", "amplitude": 0.1, "frequency": 1.0}
    scenario = Scenario.from_dict({"duration": 1, "command": {"terms": [sine]}})
    assert scenario.command.terms[0].arguments["amplitude"] == 0.1


REFUSED = {
    "amplitude": ("[[command.terms]]\nkind = 'sine'\namplitude = 7\nfrequency = 1",
                  ["scenario.toml:4", "'7 deg'", "'7 rad'", "'7 mm'"]),
    "phase": ("[[load.output.terms]]\nkind = 'sine'\namplitude = 7\nfrequency = 1\nphase = 90",
              ["phase", "'90 deg'", "'90 rad'"]),
    "speed": ("[command]\nmode = 'speed'\n[[command.terms]]\nkind = 'constant'\nvalue = 5",
              ["'5 rpm'", "'5 rad/s'"]),
    "slope": ("[[command.terms]]\nkind = 'ramp'\nslope = 2", ["'2 deg/s'", "'2 rad/s'"]),
    "points": ("[[command.terms]]\nkind = 'table'\ntimes = [0, 1]\nvalues = [0, 7]",
               ["values: 7", "'7 deg'"]),
    "temperature": ("[initial]\nwinding_temperature = 20", ["'20 degC'", "'20 K'"]),
    "all at once": ("[initial]\noutput_position = 1\nwinding_temperature = 20",
                    ["initial.output_position", "initial.winding_temperature"]),
}  # fmt: skip


@pytest.mark.parametrize(("text", "parts"), REFUSED.values(), ids=REFUSED.keys())
def test_a_scenario_file_must_say_its_units(tmp_path, text, parts):
    path = tmp_path / "scenario.toml"
    path.write_text(f"duration = 2\n{text}\n")
    with pytest.raises(UnitError) as caught:
        Scenario.load(path)
    for part in parts:
        assert part in str(caught.value)


def test_what_is_the_same_in_every_unit_needs_none(tmp_path):
    path = tmp_path / "scenario.toml"
    path.write_text(
        "duration = 2\n[[command.terms]]\nkind = 'step'\ninitial = 0\nfinal = '7 deg'\ntime = 1\n"
        "[[load.output.terms]]\nkind = 'constant'\nvalue = 50\n"
        "[parameters]\nfriction.dynamic = 0.4\n"
    )
    scenario = Scenario.load(path)
    changed = ACTUATOR.with_values(scenario.parameters)
    assert changed.parameters.value("friction.dynamic") == 0.4


def test_a_scenarios_parameters_follow_the_rule_of_their_set(tmp_path, elevon_cli):
    path = tmp_path / "scenario.toml"
    path.write_text("duration = 1\n[parameters]\nmotor.inertia = 8\n")
    result = elevon_cli("simulate", "torino-rotary", "--scenario", path)
    assert result.code == 2
    assert "'8 kg cm2'" in result.err
