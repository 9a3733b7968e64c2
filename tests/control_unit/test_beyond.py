"""The control unit beyond one lasting fault: power-up, intermittent faults, supply, free fall."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from tests.physics.gear import EXTENDED, gear, states

(RETRACTED, EXTENDING, LOCKED, RETRACTING, STOPPED, RELEASED, FAULT, UNCONFIRMED,
 OFF) = range(9)  # fmt: skip
NOT_ENGAGED, STALLED, HALL, PROXIMITY, UNCOMMANDED = 3, 4, 7, 8, 10
SUPPLY, WHEELS, NO_CURRENT, POWER = 11, 12, 13, 14
BOTH = pytest.mark.parametrize("fidelity", ["low", "high"])
JAM = {"kind": "jam", "place": "screw", "severity": 40e3, "position": "130 mm", "width": "20 mm"}


def during(kind: str, place: str, *edges: float, severity: float = 1.0) -> dict[str, Any]:
    """A fault that is on between the first and the second time, the third and the fourth ..."""
    times, values = [0.0], [0.0]
    for number, edge in enumerate(edges):
        times += [edge, edge + 1e-6]
        values += [float(number % 2), float(1 - number % 2)]
    profile = {"kind": "table", "times": [*times, 1e3], "values": [*values, values[-1]]}
    return {"kind": kind, "place": place, "severity": severity, "profile": profile}


def stuck(switch: str, state: str = "on") -> str:
    """A proximity switch that reads the same for ever."""
    place = "weight_on_wheels" if switch == "wheels" else f"proximity_{switch}"
    return f"proximity_{state}@sensor.{place}=1"


def hall_supply(period: float, duty: float, start: float = 0.0) -> dict[str, Any]:
    """An intermittent supply of the Hall sensors."""
    profile = {"kind": "intermittent", "start": start, "period": period, "duty": duty}
    return {"kind": "dropout", "place": "sensor.hall", "severity": 1.0, "profile": profile}


def on_wheels(*edges: float, start: float = 1.0) -> dict[str, Any]:
    """Weight on wheels from the start (or none), changing at each edge."""
    times, values, now = [0.0], [start], start
    for edge in edges:
        times += [edge, edge + 1e-6]
        values += [now, 1.0 - now]
        now = 1.0 - now
    return {
        "weight_on_wheels": {
            "terms": [{"kind": "table", "times": [*times, 1e3], "values": [*values, now]}]
        }
    }


def false_end(rec: Any) -> bool:
    """Locked or retracted displayed for more than 50 ms where the leg is not."""
    locked = rec["locked"].values > 0.5
    home = rec["nut_position"].values < 3e-3
    state = rec["state"].values
    wrong = ((state == LOCKED) & ~locked) | ((state == RETRACTED) & ~home)
    return longest(wrong) > 0.05


def longest(flags: Any) -> float:
    """Longest time of a condition in a recording at 1 kHz, in s."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(int), [0]))))
    return float(np.max(edges[1::2] - edges[::2], initial=0)) * 1e-3


# ------------------------------------------------------------------ 1. power-up


@BOTH
@pytest.mark.parametrize(("start", "end"), [(None, RETRACTED), (EXTENDED, LOCKED)])
@pytest.mark.parametrize("factor", [1.0, 3.5])
def test_a_healthy_end_is_known_within_two_seconds(
    start: str | None, end: int, factor: float, fidelity: str
) -> None:
    """Unconfirmed at power-up; pressing against the stop of the shown end confirms it."""
    rec = gear(duration=2.0, start=start, fidelity=fidelity, values={"load.factor": factor})
    assert states(rec) == [UNCONFIRMED, end]
    assert rec.meta["status"] == "ok"
    assert rec.final["brake_released"] == 0.0
    assert abs(rec["nut_position"].values - rec["nut_position"].values[0]).max() < 1.5e-3


@BOTH
@pytest.mark.parametrize("start", [200.0, 230.0, 260.0])
def test_a_lock_switch_stuck_at_power_up_is_not_a_lock(start: float, fidelity: str) -> None:
    """The press moves the leg: the switch is false, the extension completes, no lock is shown."""
    rec = gear((3.0, "extend"), duration=8.5, start=f"{start} mm", faults=[stuck("100")],
               fidelity=fidelity)  # fmt: skip
    assert LOCKED not in states(rec)
    assert rec.final["warning_code"] == 5.0
    assert rec.final["locked"] == 1.0
    assert rec.final["state"] == UNCONFIRMED
    assert "the switch on the lock sleeve fails" in rec.meta["message"]


@BOTH
@pytest.mark.parametrize("time", [0.3, 3.0])
def test_free_fall_is_not_refused_on_the_word_of_the_lock_switch(
    time: float, fidelity: str
) -> None:
    """Before and after the press, with the lock's switch stuck at 230 mm."""
    rec = gear((time, "free_fall"), duration=time + 5.0, start="230 mm", faults=[stuck("100")],
               fidelity=fidelity)  # fmt: skip
    assert rec.final["command_refused"] == 0.0
    assert rec.final["released"] == 1.0
    assert rec.final["locked"] == 1.0
    assert not false_end(rec)


@BOTH
@pytest.mark.parametrize("start", [5.0, 30.0, 60.0])
@pytest.mark.parametrize("factor", [1.0, 3.5])
def test_a_home_switch_stuck_at_power_up_is_not_retracted(
    start: float, factor: float, fidelity: str
) -> None:
    """The press moves the leg by a few millimetres; retracted is never shown."""
    rec = gear(duration=3.0, start=f"{start} mm", faults=[stuck("0")], fidelity=fidelity,
               values={"load.factor": factor})  # fmt: skip
    assert states(rec) == [UNCONFIRMED, STOPPED]
    assert rec.final["warning_code"] == 2.0
    assert abs(rec["nut_position"].values - 1e-3 * start).max() < 6e-3


@pytest.mark.parametrize("switch", ["0", "25", "75", "100"])
@pytest.mark.parametrize("state", ["on", "off"])
@pytest.mark.parametrize("start", [None, "30 mm", "130 mm", "230 mm"])
def test_any_one_switch_failed_at_power_up_completes_an_extension(
    switch: str, state: str, start: str | None
) -> None:
    """The leg ends locked; the lock is shown unless its own switch fails."""
    rec = gear((0.1, "extend"), duration=14.0, start=start, faults=[stuck(switch, state)])
    assert rec.final["locked"] == 1.0
    assert not false_end(rec)
    assert rec.final["state"] == (UNCONFIRMED if switch == "100" else LOCKED)


@pytest.mark.parametrize("start", [None, "130 mm", EXTENDED])
def test_no_press_upwards_with_weight_on_wheels(start: str | None) -> None:
    """The press of a retracted end waits; that of a lock pushes down."""
    rec = gear(duration=3.0, start=start, load=on_wheels())
    assert rec["motor_speed"].values.min() > -1.0
    assert not false_end(rec)


# ------------------------------------------------------------------ 2. the Hall sensors' supply


@BOTH
@pytest.mark.parametrize("duty", [0.025, 0.03])
def test_an_intermittent_hall_supply_ends_locked(duty: float, fidelity: str) -> None:
    """10 and 12 ms each 0.4 s: neither overspeed nor an unlocked gear; a warning names it."""
    rec = gear((0.1, "extend"), duration=9.0, faults=[hall_supply(0.4, duty, 1.5)],
               fidelity=fidelity)  # fmt: skip
    assert states(rec) == [UNCONFIRMED, EXTENDING, LOCKED]
    assert rec.meta["status"] == "ok"
    assert rec.final["warning_code"] == 7.0
    assert longest(np.abs(rec["current_line"].values) > 30.0) < 1.0


@BOTH
def test_a_jam_is_noticed_behind_an_intermittent_hall_supply(fidelity: str) -> None:
    """An invalid code does not renew the edge timer: each try ends within a second."""
    rec = gear((0.1, "extend"), duration=8.0, faults=[hall_supply(0.4, 0.03), JAM],
               fidelity=fidelity)  # fmt: skip
    assert rec.final["fault_code"] == STALLED
    assert longest(rec["current_mean"].values > 30.0) < 1.0


@pytest.mark.parametrize(
    "fault",
    [stuck("100", "off"), stuck("75", "off"), stuck("25", "off"), stuck("0"), stuck("wheels"),
     hall_supply(0.4, 0.03), hall_supply(0.1, 0.5), "dropout@sensor.hall=1",
     "hall_high@sensor.hall_a=1"],
)  # fmt: skip
def test_no_sensor_unlocks_a_locked_gear(fault: Any) -> None:
    """At rest and under a renewed extension."""
    rec = gear((2.5, "extend"), (6.0, "stop"), (6.5, "extend"), duration=12.0, start=EXTENDED,
               faults=[fault])  # fmt: skip
    assert rec["locked"].values.min() == 1.0


@BOTH
@pytest.mark.parametrize(
    ("steps", "period", "duty"),
    [
        (((0.1, "extend"),), 0.1, 0.5),
        (((0.1, "extend"), (1.0, "extend"), (4.0, "stop"), (5.0, "extend")), 3.0, 0.1),
    ],
)
def test_a_flickering_switch_in_mid_stroke_unlocks_nothing(
    steps: tuple[tuple[float, str], ...], period: float, duty: float, fidelity: str
) -> None:
    """From 200 mm its false edges alone would place the nut, short of the lock it stands in."""
    flicker = {**during("proximity_off", "sensor.proximity_75"), "profile": {
        "kind": "intermittent", "start": 0.05, "period": period, "duty": duty}}  # fmt: skip
    rec = gear(*steps, duration=8.0, start="200 mm", faults=[flicker], fidelity=fidelity,
               values={"load.factor": 3.5, "inverter.supply_voltage": 32.2})  # fmt: skip
    assert np.diff(rec["locked"].values).min() >= 0.0
    assert rec.final["locked"] == 1.0
    assert not false_end(rec)
    assert rec.final["state"] == LOCKED


# ------------------------------------------------------------------ 3. pulses and weight on wheels


@cache
def retraction(fidelity: str, pulsed: str = "") -> Any:
    """A whole retraction, with a pulse of a switch if one is named."""
    pulse = during("proximity_on", f"sensor.proximity_{pulsed}", 3.0, 3.005)
    return gear((0.1, "retract"), duration=7.5, start=EXTENDED, fidelity=fidelity,
                faults=[pulse] if pulsed else [], record="state@1 kHz")  # fmt: skip


@BOTH
@pytest.mark.parametrize("switch", ["0", "25", "75", "100"])
def test_a_pulse_of_a_switch_changes_nothing(switch: str, fidelity: str) -> None:
    """5 ms in mid-retraction: the same states at the same times."""
    plain = retraction(fidelity)
    rec = retraction(fidelity, switch)
    assert np.array_equal(rec["state"].values, plain["state"].values)
    assert states(rec) == [UNCONFIRMED, RETRACTING, RETRACTED]


def test_chatter_is_a_fault_of_the_switch() -> None:
    """30 ms on, 30 ms off: the switch is named, the extension completes on the count."""
    chatter = {**during("proximity_on", "sensor.proximity_75"), "profile": {
        "kind": "intermittent", "start": 1.0, "period": 0.06, "duty": 0.5}}  # fmt: skip
    rec = gear((0.1, "extend"), duration=14.0, faults=[chatter])
    assert rec.final["warning_code"] == 4.0
    assert rec.final["state"] == LOCKED
    assert rec.final["locked"] == 1.0


@BOTH
@pytest.mark.parametrize("length", [0.002, 0.02, 0.3])
def test_a_dropout_of_the_wheels_switch_does_not_retract_on_the_ground(
    length: float, fidelity: str
) -> None:
    """Without weight just when the command comes: refused, nothing moves."""
    rec = gear((2.5, "retract"), duration=4.5, start=EXTENDED, fidelity=fidelity,
               load=on_wheels(2.5 - length / 2, 2.5 + length / 2))  # fmt: skip
    assert rec.final["command_refused"] == 5.0
    assert rec["locked"].values.min() == 1.0


@BOTH
def test_weight_on_wheels_ends_a_retraction(fidelity: str) -> None:
    """Watched through the motion: the leg stops within 20 ms and says why."""
    rec = gear((0.1, "retract"), duration=3.0, start=EXTENDED, fidelity=fidelity,
               load=on_wheels(2.0, start=0.0))  # fmt: skip
    assert rec.final["fault_code"] == WHEELS
    assert "weight on wheels" in rec.meta["message"]
    state = rec["state"]
    assert state.time[state.values == FAULT][0] == pytest.approx(2.012, abs=0.004)


def test_a_retraction_is_accepted_a_second_after_lift_off() -> None:
    """Refused at 0.5 s, accepted at 1.5 s."""
    for wait, refused in ((0.5, 5.0), (1.5, 0.0)):
        rec = gear((1.0 + wait, "retract"), duration=4.0, start=EXTENDED, load=on_wheels(1.0))
        assert rec.final["command_refused"] == refused


# ------------------------------------------------------------------ 4. supply


@BOTH
@pytest.mark.parametrize(("action", "start"), [("extend", None), ("retract", EXTENDED)])
def test_a_lost_supply_sets_the_brake(action: str, start: str | None, fidelity: str) -> None:
    """1 % of 28 V is left: the brake falls in below its drop-out voltage, nothing creeps."""
    rec = gear((0.1, action), duration=6.0, start=start, fidelity=fidelity,
               faults=[during("sag", "supply", 3.0, severity=0.99)],
               values={"load.factor": 3.5})  # fmt: skip
    assert rec.final["state"] == OFF
    assert rec.final["brake_released"] == 0.0
    nut, time = rec["nut_position"].values, rec["nut_position"].time
    assert abs(nut[-1] - nut[time > 3.3][0]) < 1e-6
    assert abs(nut[-1] - nut[time > 3.0][0]) < 4e-3
    assert "lost its power" in rec.meta["message"]


@BOTH
def test_a_power_cycle_in_mid_travel(fidelity: str) -> None:
    """Off, started, stopped where it is; the next command completes, the standing one does not."""
    cut = during("sag", "supply", 2.0, 3.0, severity=0.99)
    rec = gear((0.1, "extend"), (5.0, "extend"), duration=12.0, faults=[cut], fidelity=fidelity)
    assert states(rec) == [UNCONFIRMED, EXTENDING, OFF, STOPPED, EXTENDING, LOCKED]
    state = rec["state"]
    assert state.time[state.values == STOPPED][0] == pytest.approx(3.2, abs=0.02)
    unpowered = (state.time > 2.5) & (state.time < 5.0)
    assert np.ptp(rec["nut_position"].values[unpowered]) < 1e-6


def test_an_interruption_within_the_hold_up_does_not_end_a_motion() -> None:
    """50 ms without supply: the motion goes on by itself."""
    cut = during("sag", "supply", 3.0, 3.05, severity=0.99)
    rec = gear((0.1, "extend"), duration=9.0, faults=[cut])
    assert states(rec) == [UNCONFIRMED, EXTENDING, LOCKED]
    assert rec.meta["status"] == "ok"


@pytest.mark.parametrize("severity", [0.643, 0.58])
def test_a_supply_below_its_limit_ends_the_motion(severity: float) -> None:
    """10 and 11.8 V for good: fault, with the reason; 12.3 V goes on."""
    rec = gear((0.1, "extend"), duration=4.0,
               faults=[during("sag", "supply", 2.0, severity=severity)])  # fmt: skip
    assert rec.final["fault_code"] == SUPPLY
    assert "supply" in rec.meta["message"]
    going = gear((0.1, "extend"), duration=3.0,
                 faults=[during("sag", "supply", 2.0, severity=0.56)])  # fmt: skip
    assert going.final["state"] == EXTENDING


# ------------------------------------------------------------------ 5. free fall


@BOTH
@pytest.mark.parametrize("time", [1.0, 1.7, 3.0])
def test_three_switches_at_once_are_no_lock(time: float, fidelity: str) -> None:
    """25, 75 and 100 % together in a fall: their order says that they are false."""
    faults = [during("proximity_on", f"sensor.proximity_{switch}", time)
              for switch in (25, 75, 100)]  # fmt: skip
    rec = gear((0.1, "free_fall"), duration=8.0, faults=faults, fidelity=fidelity)
    assert not false_end(rec)


@pytest.mark.parametrize("time", [0.05, 0.4, 1.5, 2.5, 3.2, 3.5])
@pytest.mark.parametrize("switch", ["0", "25", "75", "100"])
@pytest.mark.parametrize("state", ["on", "off"])
def test_one_switch_in_a_fall_is_never_a_false_lock(switch: str, state: str, time: float) -> None:
    """Whenever it fails; a good fall is shown unless the lock's own switch fails off."""
    fault = during(f"proximity_{state}", f"sensor.proximity_{switch}", time)
    rec = gear((0.1, "free_fall"), duration=11.0, faults=[fault])
    assert rec.final["locked"] == 1.0
    assert not false_end(rec)
    if switch in ("0", "25", "75"):
        assert rec.final["state"] == LOCKED


def test_a_stuck_home_switch_does_not_bar_the_lock_at_high() -> None:
    """The switching model, as the rows above."""
    rec = gear((0.1, "free_fall"), duration=8.0, faults=[stuck("0")], fidelity="high")
    assert rec.final["locked"] == 1.0
    assert rec.final["state"] == LOCKED


def test_the_slowest_healthy_fall_is_shown_and_never_early() -> None:
    """At -40 C and at 1 g; the light comes after the longest healthy last quarter."""
    for values in ({}, {"lubricant.temperature": "-40 degC"}, {"load.factor": 3.5}):
        rec = gear((0.1, "free_fall"), duration=9.0, values=values)
        assert states(rec) == [UNCONFIRMED, RELEASED, LOCKED]
        assert not false_end(rec)


@BOTH
def test_a_failed_cable_does_not_bar_the_motor(fidelity: str) -> None:
    """Nothing has moved in the longest fall: the motor may extend."""
    rec = gear((0.1, "free_fall"), (10.5, "extend"), duration=18.5, fidelity=fidelity,
               faults=["release_cable_failed@release=1"])  # fmt: skip
    assert rec.final["state"] == LOCKED
    assert rec.final["locked"] == 1.0


@BOTH
@pytest.mark.parametrize(
    ("cause", "code"),
    [
        (during("hall_high", "sensor.hall_a", 2.0, 3.0), HALL),
        (during("sag", "supply", 2.0, 3.0, severity=0.643), SUPPLY),
    ],
)
def test_a_slipping_brake_is_caught_in_any_fault_state(
    cause: dict[str, Any], code: int, fidelity: str
) -> None:
    """The windings are shorted as after an uncommanded motion, within half a millimetre."""
    slip = during("brake_slipping", "brake", 4.0)
    rec = gear((0.1, "extend"), duration=6.0, faults=[cause, slip], fidelity=fidelity,
               values={"load.factor": 2.0})  # fmt: skip
    codes = rec["fault_code"]
    assert codes.values[codes.time > 3.5][0] == code
    assert rec.final["fault_code"] == UNCOMMANDED
    assert rec.final["software_brake"] == 1.0
    nut = rec["nut_position"].values
    begun = nut[codes.time >= 4.0][0]
    caught = nut[codes.values == UNCOMMANDED][0] - begun
    assert caught == pytest.approx(5e-4, abs=1e-4)


@pytest.mark.parametrize("start", [None, "200 mm", "250 mm", "265.5 mm"])
def test_the_wheels_switch_never_bars_a_fall(start: str | None) -> None:
    """One switch alone, wherever the leg is: its place says nothing of the ground."""
    rec = gear((0.3, "free_fall"), duration=8.0, start=start, faults=[stuck("wheels")])
    assert rec.final["command_refused"] == 0.0
    assert rec.final["released"] == 1.0
    assert rec.final["locked"] == 1.0


# ------------------------------------------------------------------ 6. messages


@BOTH
@pytest.mark.parametrize("phase", ["a", "b", "c"])
def test_an_open_phase_is_no_current(phase: str, fidelity: str) -> None:
    """The locked gear stands without a current: neither the lock nor a jam is the cause."""
    rec = gear((0.1, "retract"), duration=7.0, start=EXTENDED, fidelity=fidelity,
               faults=[f"open_phase@motor.phase_{phase}=1"])  # fmt: skip
    if rec.final["state"] == FAULT:
        assert rec.final["fault_code"] == NO_CURRENT
        assert "no current in the motor" in rec.meta["message"]
    else:
        assert rec.final["locked"] == 0.0


def test_a_stall_with_current_stays_a_stall() -> None:
    """The comparison: a jam draws its current."""
    rec = gear((0.1, "extend"), duration=12.0, faults=[JAM])
    assert rec.final["fault_code"] == STALLED
