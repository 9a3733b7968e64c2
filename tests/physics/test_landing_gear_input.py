"""What the landing gear refuses: names, values and steps, each with what would be right."""

import pytest

import elevon
from elevon.errors import DivergedError, RangeError
from tests.physics.gear import EXTENDED, NAME, gear


def test_names_that_nobody_knows_get_the_near_ones() -> None:
    """What an engineer would type first."""
    for typed, near in (
        ("brake_stuck", "brake_not_releasing"),
        ("weak_lock_spring", "lock_spring_weak"),
        ("release_cable", "release_cable_failed"),
        ("shorted_motor", "motor_shorted"),
        ("hall_stuck", "hall_high"),
        ("proximity_stuck_on", "proximity_on"),
    ):
        with pytest.raises(elevon.InputError, match=near):
            gear(duration=0.1, faults=[f"{typed}@brake=1"])


def test_a_lock_loaded_beyond_its_strength_ends_the_run() -> None:
    """The watch names the lock."""
    overload = {"output": {"terms": [{"kind": "constant", "value": "80 kN"}]}}
    with pytest.raises(DivergedError, match="lock_force"):
        gear(duration=0.1, start=EXTENDED, load=overload)


def test_an_open_triangle_is_refused_with_its_position() -> None:
    """The first ram position at which it does not close, and the lengths."""
    with pytest.raises(elevon.InputError, match=r"does not close at output_position = [\d.]+ mm"):
        gear((0.1, "extend"), duration=1.0, values={"lever.arm": "0.12 m"})


@pytest.mark.parametrize("path", ["screw.efficiency_loaded", "gear.efficiency_first"])
@pytest.mark.parametrize("efficiency", [1.2, 0.0, -0.1])
def test_an_efficiency_outside_its_range_is_refused(path: str, efficiency: float) -> None:
    """Above one, zero or below."""
    with pytest.raises(RangeError, match=path):
        elevon.Actuator.load(NAME).with_values({path: efficiency})


@pytest.mark.parametrize("supply", [10.0, 40.0])
def test_a_supply_outside_the_limits_is_refused(supply: float) -> None:
    """With the limits in the message."""
    with pytest.raises(elevon.InputError, match=r"12 V to control\.overvoltage = 34 V"):
        gear((0.1, "extend"), duration=1.0, values={"inverter.supply_voltage": supply})


def test_other_wrong_input() -> None:
    """Unknown action, steps out of order, steps in another mode, an input the gear lacks."""
    with pytest.raises(elevon.InputError, match="extend"):
        gear((0.1, "exted"), duration=1.0)
    with pytest.raises(elevon.InputError, match="not after"):
        gear((0.5, "extend"), (0.2, "stop"), duration=1.0)
    with pytest.raises(elevon.InputError, match="gear"):
        elevon.Scenario.from_dict(
            {"duration": 1.0, "command": {"steps": [{"time": 0.0, "action": "extend"}]}}
        )
    with pytest.raises(elevon.InputError, match=r"load\.brake"):
        gear((0.1, "extend"), duration=1.0,
             load={"brake": {"terms": [{"kind": "constant", "value": 1.0}]}})  # fmt: skip
    scenario = elevon.Scenario.from_dict({"duration": 1.0, "command": {"mode": "speed"}})
    with pytest.raises(elevon.InputError, match="mode: gear"):
        elevon.simulate(elevon.Actuator.load(NAME), scenario)
