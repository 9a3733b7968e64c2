"""Free fall of the landing gear with failed switches, cable and brake."""

from __future__ import annotations

from typing import Any

import pytest

from tests.control_unit.situations import (
    BOTH,
    HALL,
    LOCKED,
    RELEASED,
    SUPPLY,
    SWITCHES,
    UNCOMMANDED,
    UNCONFIRMED,
    during,
    false_end,
    stuck,
)
from tests.physics.gear import gear, gear_run, gears, states


@BOTH
def test_three_switches_at_once_are_no_lock(fidelity: str) -> None:
    """25, 75 and 100 % together in a fall: their order says that they are false."""
    times = (1.0, 1.7, 3.0)
    runs = [gear_run((0.1, "free_fall"), duration=8.0,
                     faults=[during("proximity_on", f"sensor.proximity_{switch}", time)
                             for switch in (25, 75, 100)])
            for time in times]  # fmt: skip
    for time, rec in zip(times, gears(runs, fidelity), strict=True):
        assert not false_end(rec), time


def test_one_switch_in_a_fall_is_never_a_false_lock() -> None:
    """Whenever it fails; a good fall is shown unless the lock's own switch fails off."""
    rows = [(state, switch, time) for state in ("on", "off") for switch in SWITCHES
            for time in (0.05, 0.4, 1.5, 2.5, 3.2, 3.5)]  # fmt: skip
    runs = [gear_run((0.1, "free_fall"), duration=11.0,
                     faults=[during(f"proximity_{state}", f"sensor.proximity_{switch}", time)])
            for state, switch, time in rows]  # fmt: skip
    for row, rec in zip(rows, gears(runs), strict=True):
        assert rec.final["locked"] == 1.0, row
        assert not false_end(rec), row
        if row[1] in ("0", "25", "75"):
            assert rec.final["state"] == LOCKED, row


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
