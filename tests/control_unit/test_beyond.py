"""The control unit beyond one lasting fault: power-up, intermittent faults, supply."""

from __future__ import annotations

import numpy as np
import pytest

from tests.control_unit.situations import (
    EACH,
    EXTENDING,
    FAULT,
    JAM,
    LOCKED,
    NO_CURRENT,
    OFF,
    RETRACTED,
    RETRACTING,
    STALLED,
    STOPPED,
    SUPPLY,
    SWITCHES,
    UNCONFIRMED,
    WHEELS,
    during,
    false_end,
    flicker,
    hall_supply,
    longest,
    on_wheels,
    stuck,
)
from tests.physics.gear import EXTENDED, gear, gear_run, gears, states

# ------------------------------------------------------------------ 1. power-up


@EACH
def test_a_healthy_end_is_known_within_two_seconds(fidelity: str) -> None:
    """Unconfirmed at power-up; pressing against the stop of the shown end confirms it."""
    ends = [(None, RETRACTED), (EXTENDED, LOCKED)]
    rows = [(start, end, factor) for start, end in ends for factor in (1.0, 3.5)]
    runs = [gear_run(duration=2.0, start=start, values={"load.factor": factor})
            for start, _, factor in rows]  # fmt: skip
    for row, rec in zip(rows, gears(runs, fidelity), strict=True):
        assert states(rec) == [UNCONFIRMED, row[1]], row
        assert rec.meta["status"] == "ok", row
        assert rec.final["brake_released"] == 0.0, row
        assert abs(rec["nut_position"].values - rec["nut_position"].values[0]).max() < 1.5e-3, row


@EACH
def test_a_lock_switch_stuck_at_power_up_is_not_a_lock(fidelity: str) -> None:
    """The press moves the leg: the switch is false, the extension completes, no lock is shown."""
    starts = ["200 mm", "230 mm", "260 mm"]
    runs = [gear_run((3.0, "extend"), duration=8.5, start=start, faults=[stuck("100")])
            for start in starts]  # fmt: skip
    for start, rec in zip(starts, gears(runs, fidelity), strict=True):
        assert LOCKED not in states(rec), start
        assert rec.final["warning_code"] == 5.0, start
        assert rec.final["locked"] == 1.0, start
        assert rec.final["state"] == UNCONFIRMED, start
        assert "the switch on the lock sleeve fails" in rec.meta["message"], start


@EACH
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


@EACH
def test_a_home_switch_stuck_at_power_up_is_not_retracted(fidelity: str) -> None:
    """The press moves the leg by a few millimetres; retracted is never shown."""
    rows = [(start, factor) for start in (5.0, 30.0, 60.0) for factor in (1.0, 3.5)]
    runs = [gear_run(duration=3.0, start=f"{start} mm", faults=[stuck("0")],
                     values={"load.factor": factor}) for start, factor in rows]  # fmt: skip
    for row, rec in zip(rows, gears(runs, fidelity), strict=True):
        assert states(rec) == [UNCONFIRMED, STOPPED], row
        assert rec.final["warning_code"] == 2.0, row
        assert abs(rec["nut_position"].values - 1e-3 * row[0]).max() < 6e-3, row


def test_any_one_switch_failed_at_power_up_completes_an_extension() -> None:
    """The leg ends locked; the lock is shown unless its own switch fails."""
    rows = [(switch, state, start) for switch in SWITCHES for state in ("on", "off")
            for start in (None, "30 mm", "130 mm", "230 mm")]  # fmt: skip
    runs = [gear_run((0.1, "extend"), duration=14.0, start=start, faults=[stuck(switch, state)])
            for switch, state, start in rows]  # fmt: skip
    for row, rec in zip(rows, gears(runs), strict=True):
        assert rec.final["locked"] == 1.0, row
        assert not false_end(rec), row
        assert rec.final["state"] == (UNCONFIRMED if row[0] == "100" else LOCKED), row


@pytest.mark.parametrize("start", [None, "130 mm", EXTENDED])
def test_no_press_upwards_with_weight_on_wheels(start: str | None) -> None:
    """The press of a retracted end waits; that of a lock pushes down."""
    rec = gear(duration=3.0, start=start, load=on_wheels())
    assert rec["motor_speed"].values.min() > -1.0
    assert not false_end(rec)


# ------------------------------------------------------------------ 2. the Hall sensors' supply


@EACH
def test_an_intermittent_hall_supply_ends_locked(fidelity: str) -> None:
    """10 and 12 ms each 0.4 s: neither overspeed nor an unlocked gear; a warning names it."""
    runs = [gear_run((0.1, "extend"), duration=9.0, faults=[hall_supply(0.4, duty, 1.5)])
            for duty in (0.025, 0.03)]  # fmt: skip
    for rec in gears(runs, fidelity):
        assert states(rec) == [UNCONFIRMED, EXTENDING, LOCKED]
        assert rec.meta["status"] == "ok"
        assert rec.final["warning_code"] == 7.0
        assert longest(np.abs(rec["current_line"].values) > 30.0) < 1.0


@EACH
def test_a_jam_is_noticed_behind_an_intermittent_hall_supply(fidelity: str) -> None:
    """An invalid code does not renew the edge timer: each try ends within a second."""
    rec = gear((0.1, "extend"), duration=8.0, faults=[hall_supply(0.4, 0.03), JAM],
               fidelity=fidelity)  # fmt: skip
    assert rec.final["fault_code"] == STALLED
    assert longest(rec["current_mean"].values > 30.0) < 1.0


def test_no_sensor_unlocks_a_locked_gear() -> None:
    """At rest and under a renewed extension."""
    faults = [stuck("100", "off"), stuck("75", "off"), stuck("25", "off"), stuck("0"),
              stuck("wheels"), hall_supply(0.4, 0.03), hall_supply(0.1, 0.5),
              "dropout@sensor.hall=1", "hall_high@sensor.hall_a=1"]  # fmt: skip
    steps = (2.5, "extend"), (6.0, "stop"), (6.5, "extend")
    runs = [gear_run(*steps, duration=12.0, start=EXTENDED, faults=[fault]) for fault in faults]
    for fault, rec in zip(faults, gears(runs), strict=True):
        assert rec["locked"].values.min() == 1.0, fault


@EACH
def test_a_flickering_switch_in_mid_stroke_unlocks_nothing(fidelity: str) -> None:
    """From 200 mm its false edges alone would place the nut, short of the lock it stands in."""
    often = (0.1, "extend"), (1.0, "extend"), (4.0, "stop"), (5.0, "extend")
    rows = [(often[:1], 0.1, 0.5), (often, 3.0, 0.1)]
    runs = [gear_run(*steps, duration=8.0, start="200 mm", faults=[flicker(period, duty)],
                     values={"load.factor": 3.5, "inverter.supply_voltage": 32.2})
            for steps, period, duty in rows]  # fmt: skip
    for row, rec in zip(rows, gears(runs, fidelity), strict=True):
        assert np.diff(rec["locked"].values).min() >= 0.0, row
        assert rec.final["locked"] == 1.0, row
        assert not false_end(rec), row
        assert rec.final["state"] == LOCKED, row


# ------------------------------------------------------------------ 3. pulses and weight on wheels


@EACH
def test_a_pulse_of_a_switch_changes_nothing(fidelity: str) -> None:
    """5 ms in mid-retraction: the same states at the same times."""
    pulses = [during("proximity_on", f"sensor.proximity_{name}", 3.0, 3.005) for name in SWITCHES]
    runs = [gear_run((0.1, "retract"), duration=7.5, start=EXTENDED, faults=faults)
            for faults in ([], *([pulse] for pulse in pulses))]  # fmt: skip
    plain, *pulsed = gears(runs, fidelity)
    assert states(plain) == [UNCONFIRMED, RETRACTING, RETRACTED]
    for name, rec in zip(SWITCHES, pulsed, strict=True):
        assert np.array_equal(rec["state"].values, plain["state"].values), name


def test_chatter_is_a_fault_of_the_switch() -> None:
    """30 ms on, 30 ms off: the switch is named, the extension completes on the count."""
    chatter = {**during("proximity_on", "sensor.proximity_75"), "profile": {
        "kind": "intermittent", "start": 1.0, "period": 0.06, "duty": 0.5}}  # fmt: skip
    rec = gear((0.1, "extend"), duration=14.0, faults=[chatter])
    assert rec.final["warning_code"] == 4.0
    assert rec.final["state"] == LOCKED
    assert rec.final["locked"] == 1.0


@EACH
def test_a_dropout_of_the_wheels_switch_does_not_retract_on_the_ground(fidelity: str) -> None:
    """Without weight just when the command comes: refused, nothing moves."""
    lengths = (0.002, 0.02, 0.3)
    runs = [gear_run((2.5, "retract"), duration=4.5, start=EXTENDED,
                     load=on_wheels(2.5 - length / 2, 2.5 + length / 2))
            for length in lengths]  # fmt: skip
    for length, rec in zip(lengths, gears(runs, fidelity), strict=True):
        assert rec.final["command_refused"] == 5.0, length
        assert rec["locked"].values.min() == 1.0, length


@EACH
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


@EACH
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


@EACH
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


# ------------------------------------------------------------------ 6. messages


@EACH
def test_an_open_phase_is_no_current(fidelity: str) -> None:
    """The locked gear stands without a current: neither the lock nor a jam is the cause."""
    runs = [gear_run((0.1, "retract"), duration=7.0, start=EXTENDED,
                     faults=[f"open_phase@motor.phase_{phase}=1"]) for phase in "abc"]  # fmt: skip
    for rec in gears(runs, fidelity):
        if rec.final["state"] == FAULT:
            assert rec.final["fault_code"] == NO_CURRENT
            assert "no current in the motor" in rec.meta["message"]
        else:
            assert rec.final["locked"] == 0.0


def test_a_stall_with_current_stays_a_stall() -> None:
    """The comparison: a jam draws its current."""
    rec = gear((0.1, "extend"), duration=12.0, faults=[JAM])
    assert rec.final["fault_code"] == STALLED
