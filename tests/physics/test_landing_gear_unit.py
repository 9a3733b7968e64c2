"""The control unit: interlocks, time-outs, retries, fault states; and input it must refuse."""

from __future__ import annotations

from typing import Any

import pytest

import elevon
from elevon.errors import DivergedError, RangeError
from tests.physics.gear import EXTENDED, NAME, gear, states

RETRACTED, EXTENDING, LOCKED, RETRACTING, STOPPED, RELEASED, FAULT = range(7)
MOTION, NOT_RELEASED, NOT_ENGAGED, STALLED, OVERSPEED, OVERCURRENT, HALL, PROXIMITY = range(1, 9)
JAM = {"kind": "jam", "place": "screw", "severity": 40e3, "position": "130 mm", "width": "20 mm"}
ON_WHEELS = {"weight_on_wheels": {"terms": [{"kind": "constant", "value": 1.0}]}}


def test_a_whole_cycle() -> None:
    """Every state of a healthy cycle, in order, and none else."""
    rec = gear((0.1, "extend"), (9.0, "retract"), duration=18.0)
    assert states(rec) == [RETRACTED, EXTENDING, LOCKED, RETRACTING, RETRACTED]
    assert rec.final["brake_released"] == 0.0
    assert rec.final["fault_code"] == 0.0
    assert 0.0 < rec.final["nut_position"] < 0.0015


def test_stop_and_reversal_pass_through_stopped() -> None:
    """A stop holds the leg on its brake; the opposite command starts from there."""
    rec = gear((0.1, "extend"), (2.0, "stop"), (6.0, "retract"), duration=12.0)
    assert states(rec) == [RETRACTED, EXTENDING, STOPPED, RETRACTING, RETRACTED]
    rec = gear((0.1, "extend"), (2.0, "retract"), duration=9.0)
    assert states(rec) == [RETRACTED, EXTENDING, STOPPED, RETRACTING, RETRACTED]


@pytest.mark.parametrize(
    ("fault", "action", "duration", "code", "tries"),
    [
        ("lock_not_engaging@lock=1", "extend", 28.0, NOT_ENGAGED, 3),
        ("lock_not_releasing@lock=1", "retract", 10.0, NOT_RELEASED, 3),
        (JAM, "extend", 20.0, STALLED, 3),
        ("open_phase@motor.phase_a=1", "retract", 8.0, NOT_RELEASED, 3),
    ],
)
def test_retries_then_a_fault(
    fault: Any, action: str, duration: float, code: int, tries: int
) -> None:
    """Two retries after the first try, then the fault state, bridge off and brake set."""
    rec = gear((0.1, action), duration=duration, faults=[fault],
               start=EXTENDED if action == "retract" else None)  # fmt: skip
    assert rec.final["fault_code"] == code
    assert rec.final["state"] == FAULT
    assert rec.meta["status"] == "tripped"
    passed = states(rec)
    assert passed.count(EXTENDING if action == "extend" else RETRACTING) >= tries
    assert rec.final["brake_released"] == 0.0
    assert rec.final["voltage_ref"] == 0.0


@pytest.mark.parametrize("sensor", ["hall_a", "hall_b", "hall_c"])
@pytest.mark.parametrize("kind", ["hall_high", "hall_low"])
def test_stuck_hall_sensors_end_in_a_fault(sensor: str, kind: str) -> None:
    """Invalid codes while it turns; where it cannot start, a stall."""
    rec = gear((0.1, "extend"), duration=12.0, faults=[f"{kind}@sensor.{sensor}=1"])
    assert rec.final["state"] == FAULT
    assert rec.final["fault_code"] in (HALL, STALLED)
    assert sensor  # every one of the three


@pytest.mark.parametrize(
    ("fault", "action"),
    [
        ("proximity_on@sensor.proximity_0=1", "extend"),
        ("proximity_on@sensor.proximity_25=1", "retract"),
        ("proximity_on@sensor.proximity_75=1", "retract"),
        ("proximity_on@sensor.proximity_100=1", "retract"),
        ("proximity_off@sensor.proximity_25=1", "extend"),
        ("proximity_off@sensor.proximity_75=1", "extend"),
    ],
)
def test_failed_switches_are_found(fault: str, action: str) -> None:
    """By an impossible set, or by the travel that the Hall sensors count."""
    start = EXTENDED if action == "retract" else None
    rec = gear((0.1, action), duration=10.0, faults=[fault], start=start)
    assert rec.final["fault_code"] == PROXIMITY
    assert rec.final["state"] == FAULT


@pytest.mark.parametrize("action", ["extend", "retract"])
def test_a_dead_end_switch_stalls_at_the_stop(action: str) -> None:
    """P0 or the lock's switch never comes: stall, retries, fault, not for ever under current."""
    place = "proximity_100" if action == "extend" else "proximity_0"
    rec = gear((0.1, action), duration=14.0, faults=[f"proximity_off@sensor.{place}=1"],
               start=EXTENDED if action == "retract" else None)  # fmt: skip
    assert rec.final["fault_code"] in (STALLED, NOT_ENGAGED)


def test_a_faulted_unit_moves_again_after_stop_and_command() -> None:
    """Stop acknowledges; the next command runs, and the cause being gone it arrives."""
    brief = {
        "kind": "hall_high",
        "place": "sensor.hall_a",
        "severity": 1.0,
        "profile": {"kind": "intermittent", "start": 0.0, "period": 1000.0, "duty": 0.001},
    }
    rec = gear((0.1, "extend"), (2.0, "stop"), (2.5, "extend"), duration=11.0, faults=[brief])
    assert states(rec)[:3] == [RETRACTED, EXTENDING, FAULT]
    assert rec.final["state"] == LOCKED
    assert rec.final["fault_code"] == 0.0


def test_motion_timeout() -> None:
    """A move longer than allowed is tried again and then given up."""
    rec = gear((0.1, "extend"), duration=20.0, values={"control.motion_timeout": 1.5})
    assert rec.final["fault_code"] == MOTION


@pytest.mark.parametrize(
    ("steps", "options", "named"),
    [
        ([(0.1, "retract")], {"start": EXTENDED, "load": ON_WHEELS}, "weight on wheels"),
        ([(0.1, "free_fall")], {"load": ON_WHEELS}, "weight on wheels"),
        ([(0.1, "free_fall")], {"start": EXTENDED}, "down-lock"),
        ([(0.1, "extend")], {"faults": ["sag@supply=0.7"]}, "control.undervoltage (8.4 V)"),
        ([(0.1, "extend")], {"values": {"release.open": "yes"}}, "release"),
    ],
)
def test_a_refused_command_names_its_interlock(
    steps: list[tuple[float, str]], options: dict[str, Any], named: str
) -> None:
    """Nothing moves and the message says which command and why."""
    rec = gear(*steps, duration=0.5, **options)
    assert rec.meta["status"] == "tripped"
    assert named in rec.meta["message"]
    assert steps[0][1] in rec.meta["message"]
    assert rec.final["command_refused"] > 0.0
    assert rec.final["current_line"] == 0.0


def test_a_refused_command_after_a_good_one_changes_nothing() -> None:
    """Free fall of a locked leg is refused; the run stays ok and the signal tells."""
    rec = gear((0.1, "extend"), (8.0, "free_fall"), duration=9.0)
    assert rec.meta["status"] == "ok"
    assert rec.final["state"] == LOCKED
    assert rec.final["command_refused"] == 6.0


def test_a_lock_loaded_beyond_its_strength_ends_the_run() -> None:
    """The watch names the lock."""
    overload = {"user": {"terms": [{"kind": "constant", "value": "80 kN"}]}}
    with pytest.raises(DivergedError, match="lock_force"):
        gear(duration=0.1, start=EXTENDED, load=overload)


def test_an_open_triangle_is_refused_with_its_position() -> None:
    """The first ram position at which it does not close, and the lengths."""
    with pytest.raises(elevon.InputError, match=r"does not close at user_position = [\d.]+ mm"):
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
