"""Faults of the command line: their units, and how each is said."""

import pytest

SIMULATE = ("simulate", "torino-rotary", "--duration", "0.02", "--fidelity", "low", "--json")


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ("backlash@transmission=0.5 deg", "backlash@transmission: 0.5 deg"),
        ("friction@transmission=25", "friction@transmission: +2500 %"),
        ("short@motor.phase_a=0.1", "short@motor.phase_a: 10 %"),
        ("open_phase@motor.phase_a=1", "open_phase@motor.phase_a: 1\n"),
        ("backlash@transmission=0", "backlash@transmission: 0 deg"),
    ],
)
def test_each_is_said_as_it_was_read(elevon_cli, fault, text):
    done = elevon_cli(*SIMULATE, "--fault", fault)
    assert done.code == 0
    assert f"fault {text}" in done.err


@pytest.mark.parametrize(
    "command",
    [
        SIMULATE,
        ("compare", "torino-rotary"),
        ("bench", "run", "backlash", "--actuator", "torino-rotary", "--out", "logs"),
    ],
)
def test_a_severity_with_a_unit_needs_one(elevon_cli, tmp_path, command):
    refused = elevon_cli(*command, "--fault", "backlash@transmission=0.5")
    assert refused.code == 2
    assert "0.5 has no unit; write '0.5 deg' or '0.5 rad'" in refused.err
    assert not (tmp_path / "logs").exists()
