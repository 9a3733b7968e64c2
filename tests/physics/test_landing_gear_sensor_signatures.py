"""What the faults of the landing gear's Hall sensors and proximity switches do, against a law."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.physics.gear import gear, value

BOTH = pytest.mark.parametrize("fidelity", ["high", "low"])
HALLS = "hall_a,hall_b,hall_c"
LOCKED, STOPPED, FAULT, UNCONFIRMED = 2, 4, 6, 7
HALL, PROXIMITY = 7, 8


def turning(fidelity: str, fault: dict[str, Any]) -> Any:
    """A retraction in full motion, the fault coming at 1.2 s."""
    profile = {"profile": {"kind": "step", "time": 1.2}}
    return gear((0.0, "retract"), duration=1.4, start="200 mm", fidelity=fidelity,
                faults=[{**profile, **fault}], values={"load.factor": 0.0},
                record=f"{HALLS},state,fault_code,motor_position,speed_meas@10 kHz")  # fmt: skip


@pytest.mark.signature("hall_high", "hall")
@pytest.mark.signature("hall_low", "hall")
@BOTH
@pytest.mark.parametrize(("kind", "level"), [("hall_high", 1.0), ("hall_low", 0.0)])
def test_a_stuck_hall_sensor_makes_one_invalid_code_a_turn(
    kind: str, level: float, fidelity: str
) -> None:
    """High: 111 where the other two are high, low: 000 where they are low, a sixth of a turn each;
    the unit counts the errors to its limit and stops.
    """
    rec = turning(fidelity, {"kind": kind, "place": "sensor.hall_b", "severity": 1.0})
    late = (rec["hall_b"].time > 1.2005) & (rec["hall_b"].time < 1.21)
    assert np.all(rec["hall_b"].values[late] == level)
    same = np.all([rec[name].values[late] == level for name in HALLS.split(",")], axis=0)
    turned = np.diff(rec["motor_position"].values[late], append=np.nan)
    share = np.nansum(turned[same]) / np.nansum(turned)
    # About 2.8 electrical turns in the window: an edge sixth more or less.
    assert share == pytest.approx(1 / 6, abs=1 / 6 / 2.8)
    assert share > 0.0
    assert rec.final["state"] == FAULT
    assert rec.final["fault_code"] == HALL


@pytest.mark.signature("offset", "hall")
@BOTH
@pytest.mark.parametrize("place", ["hall", "hall_b"])
def test_an_early_sensor_switches_early_by_its_angle(place: str, fidelity: str) -> None:
    """The level is [sin(p theta - 2 pi/3 - pi/6 + offset) > 0] for phase b."""
    offset = 0.3
    rec = turning(fidelity, {"kind": "offset", "place": f"sensor.{place}", "severity": offset})
    late = rec["hall_b"].time > 1.21
    angle = value("motor.pole_pairs") * rec["motor_position"].values[late] - 5.0 * np.pi / 6.0
    level = rec["hall_b"].values[late]
    # Away from an edge by more than a low step turns the level is exact.
    clear = np.abs(np.sin(angle + offset)) > 0.05
    assert np.array_equal(level[clear], np.sin(angle[clear] + offset) > 0.0)
    assert np.mean(level != (np.sin(angle) > 0.0)) == pytest.approx(offset / np.pi, rel=0.1)


@pytest.mark.signature("dropout", "hall")
@BOTH
def test_lost_power_of_the_sensors_is_the_code_of_none(fidelity: str) -> None:
    """000 for the duty's share of the time: no commutation, the unit faults for it."""
    fault = {"kind": "dropout", "place": "sensor.hall", "severity": 0.3, "period": "20 ms"}
    rec = turning(fidelity, fault)
    late = rec["hall_a"].time > 1.2
    none = np.all([rec[name].values[late] == 0.0 for name in HALLS.split(",")], axis=0)
    assert none.mean() == pytest.approx(0.3, abs=0.01)
    assert np.all(np.any([rec[name].values[~late] for name in HALLS.split(",")], axis=0)[5000:])
    assert rec.final["fault_code"] == HALL


@pytest.mark.signature("proximity_on", "proximity")
@pytest.mark.signature("proximity_off", "proximity")
@BOTH
@pytest.mark.parametrize(
    ("kind", "switch", "start", "state", "code", "warning"),
    [
        ("proximity_off", "25", "267 mm", LOCKED, 0, 3),
        # The end that was confirmed is not known any more.
        ("proximity_off", "0", "0.8 mm", UNCONFIRMED, PROXIMITY, 2),
        ("proximity_off", "100", "267 mm", UNCONFIRMED, PROXIMITY, 5),
        # Of a pair that no position has, a motion tells which is wrong.
        ("proximity_on", "0", "100 mm", STOPPED, 0, 8),
        ("proximity_on", "75", "20 mm", STOPPED, 0, 8),
        ("proximity_on", "100", "100 mm", STOPPED, 0, 8),
        # What is off reads off.
        ("proximity_off", "75", "100 mm", STOPPED, 0, 0),
    ],
)
def test_a_failed_switch_reads_its_level(
    kind: str, switch: str, start: str, state: int, code: int, warning: int, fidelity: str
) -> None:
    """Whatever the ram does; what the unit makes of it comes after debouncing and the watch."""
    fault = {"kind": kind, "place": f"sensor.proximity_{switch}", "severity": 1.0,
             "profile": {"kind": "step", "time": 2.0}}  # fmt: skip
    rec = gear(duration=2.2, start=start, fidelity=fidelity, faults=[fault])
    contact = rec[f"proximity_{switch}"]
    level = 1.0 if kind == "proximity_on" else 0.0
    assert np.all(contact.values[contact.time > 2.005] == level)
    assert [rec.final[name] for name in ("state", "fault_code", "warning_code")] == [
        state, code, warning
    ]  # fmt: skip
    if warning:
        codes = rec["warning_code"]
        first = codes.time[codes.values == warning][0] - 2.0
        waited = value("control.debounce") + value("control.proximity_time")
        assert first == pytest.approx(waited, abs=0.0035)


@pytest.mark.signature("proximity_on", "weight")
@pytest.mark.signature("proximity_off", "weight")
@BOTH
@pytest.mark.parametrize(("kind", "weight", "refused"), [("on", 0.0, 5.0), ("off", 1.0, 0.0)])
def test_a_failed_wheels_switch_is_taken_for_its_level(
    kind: str, weight: float, refused: float, fidelity: str
) -> None:
    """Stuck on a retraction in flight is refused; stuck off one on the ground is not."""
    load = {"weight_on_wheels": {"terms": [{"kind": "constant", "value": weight}]}}
    rec = gear((1.5, "retract"), duration=2.0, start="267 mm", fidelity=fidelity, load=load,
               faults=[f"proximity_{kind}@sensor.weight_on_wheels=1"])  # fmt: skip
    assert np.all(rec["proximity_wheels"].values == (1.0 if kind == "on" else 0.0))
    assert rec.final["command_refused"] == refused
