"""A log has roles: its own, a map's, a wiring's; a wrong map is refused with the figure."""

import math

import numpy as np
import pytest

import elevon
from elevon import _core
from elevon.errors import InputError
from elevon.logs.importing import import_log
from elevon.logs.maps.column_map import read_column_map, shipped_map, shipped_maps

ACTUATORS = {
    "torino-rotary": {"terms": [{"kind": "sine", "amplitude": "2 deg", "frequency": "5 Hz"}]},
    "nasa-ballscrew": {"terms": [{"kind": "sine", "amplitude": "1 mm", "frequency": "5 Hz"}]},
    "pisa-landing-gear": {"mode": "gear", "steps": [{"time": 0.02, "action": "extend"}]},
}


@pytest.mark.parametrize("name", ACTUATORS)
def test_an_own_recording_needs_neither_map_nor_note(tmp_path, name):
    scenario = elevon.Scenario.from_dict({"duration": 0.2, "command": ACTUATORS[name]})
    run = elevon.simulate(elevon.Actuator.load(name), scenario, fidelity="low")
    log = import_log(run.save(tmp_path / "run.parquet"))
    expected = {"command", "output_position", "motor_position", "motor_speed", "speed_ref"}
    assert expected | {"torque_current"} <= log.recording.roles.keys()
    assert log.recording.role("motor_speed").unit == "rad/s"
    assert log.scenario == scenario
    assert log.note.command == scenario.command


def test_every_default_actuator_is_tried_here():
    assert len(ACTUATORS) == len(_core.wirings())


def linear(path, *, sign=1.0, lead=5.0):
    """A linear drive's log in mm, mm/s, rpm, without headers' units."""
    t = np.arange(0.0, 4.0, 0.01)
    position = 20.0 * np.sin(2 * math.pi * 0.5 * t)
    speed = 20.0 * math.pi * np.cos(2 * math.pi * 0.5 * t)
    columns = np.column_stack(
        (1000 * t, position + 0.3, sign * position, speed, 60.0 * speed / lead, 0.1 * speed)
    )
    np.savetxt(
        path, columns, delimiter=",", header="ms,demand,actual,v,n,i", comments="", fmt="%.6f"
    )
    return path


MAP = """
travel_per_turn = "5 mm"
current = "peak"
[[column]]
name = "ms"
role = "time"
unit = "ms"
[[column]]
name = "demand"
role = "command"
unit = "mm"
[[column]]
name = "actual"
role = "output_position"
unit = "mm"
[[column]]
name = "v"
role = "output_speed"
unit = "mm/s"
[[column]]
name = "n"
role = "motor_speed"
unit = "rpm"
[[column]]
name = "i"
role = "torque_current"
unit = "A"
"""


def test_a_linear_log_through_a_map_of_roles(tmp_path):
    (tmp_path / "map.toml").write_text(MAP)
    log = import_log(linear(tmp_path / "log.csv"), column_map=tmp_path / "map.toml")
    output = log.recording.role("output_position")
    assert (output.name, output.unit) == ("output_position", "m")
    assert np.ptp(output.values) == pytest.approx(0.04, rel=1e-4)
    assert not [f for f in log.report.findings if f.level == "warning"]


CONTRADICTED = {
    "unit": (MAP.replace('role = "output_position"\nunit = "mm"', 'role = "output_position"'
                         '\nunit = "cm"'), r"contradict.*10 times"),
    "lead": (MAP.replace("5 mm", "10 mm"), r"contradict.*0\.5 times"),
    "role": (MAP.replace("output_speed", "output_sped"), "output_speed"),
    "twice": (MAP.replace('"n"', '"v"'), "stands twice"),
    "kind": (MAP.replace("mm/s", "A"), "rad/s or m/s"),
    "long": (MAP + "#" * 1_000_001, "longer than"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), CONTRADICTED.values(), ids=CONTRADICTED.keys())
def test_a_map_that_cannot_be_is_refused(tmp_path, text, message):
    (tmp_path / "map.toml").write_text(text)
    with pytest.raises(InputError, match=message):
        import_log(linear(tmp_path / "log.csv"), column_map=tmp_path / "map.toml")


def without(text, *names):
    """The map without some of its columns."""
    tables = text.split("[[column]]\n")
    return "[[column]]\n".join(t for t in tables if not any(f'name = "{n}"' in t for n in names))


AGAINST = {
    "command": (("v", "n"), r"output_position moves -1 times command"),
    "speed": (("demand", "n"), r"output_position moves -1 times the integral of output_speed"),
    "motor": (("demand", "v"), r"contradicts the log.*runs in the other direction"),
}


@pytest.mark.parametrize(("left_out", "message"), AGAINST.values(), ids=AGAINST.keys())
def test_a_position_of_the_wrong_sign_is_refused(tmp_path, left_out, message):
    (tmp_path / "map.toml").write_text(without(MAP, *left_out))
    log = linear(tmp_path / "log.csv", sign=-1.0)
    with pytest.raises(InputError, match=message):
        import_log(log, column_map=tmp_path / "map.toml")


def test_the_package_ships_three_layouts():
    assert shipped_maps() == ["cranfield", "pisa", "torino"]
    for name in shipped_maps():
        assert {"command", "speed_ref"} & {entry.role_name for entry in shipped_map(name).column}


def test_a_column_that_is_subtracted(tmp_path):
    (tmp_path / "map.toml").write_text(
        '[[column]]\nname = "ms"\nrole = "time"\nunit = "ms"\n'
        '[[column]]\nname = "demand"\nrole = "command"\nunit = "mm"\n'
        '[[column]]\nname = "actual"\nrole = "output_position"\nunit = "mm"\n'
        'subtract_from = "demand"\n'
    )
    assert read_column_map(tmp_path / "map.toml").column[2].subtract_from == "demand"
    log = import_log(linear(tmp_path / "log.csv"), column_map=tmp_path / "map.toml")
    np.testing.assert_allclose(log.recording.role("output_position").values, 3e-4, atol=1e-8)
