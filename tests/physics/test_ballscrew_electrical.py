"""Seeded shorts, eccentricity and unbalance of the ballscrew actuator's motor."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tests.physics.rig import constant, run

NAME = "nasa-ballscrew"
#: Level, and the resistors of the stand (25, 50, 150 ohm and their series) that make it.
LEVELS = [(0.10, 225.0), (1 / 7, 150.0), (0.25, 75.0), (1 / 3, 50.0), (0.50, 25.0)]
STIFF = {"friction.static": 1e4, "friction.dynamic": 1e4, "thermal.model": "off"}
PHASES = "current_a,current_b,current_c"


def tap(level: float, phase: str = "a") -> dict[str, Any]:
    """A resistor from a terminal to the centre tap."""
    return {"kind": "resistor_short", "place": f"motor.phase_{phase}", "severity": level}


def at_voltage(faults: list[dict[str, Any]], speed: float) -> Any:
    """Turn at a given speed on legs at the rail of their reference's sign: the same at any speed.

    The reference is far from what can flow.
    """
    values = {
        "motor.inertia": 1e9, "control.current_limit": 1e4, "thermal.model": "off",
        "friction.static": 0.0, "friction.dynamic": 0.0, "friction.viscous": 0.0,
        "screw.preload": 0.0, "sensor.current.bandwidth": 0.0, "inverter.supply_voltage": 40.0,
        "stop.upper": 1e3, "stop.lower": -1e3,
    }  # fmt: skip
    return run(
        values,
        duration=0.1 + 0.1 * np.pi,
        mode="torque",
        command=[constant(1e4)],
        record=f"{PHASES},tap_current_a,voltage_a,leg_current_a@20 kHz",
        scenario={"fault": faults, "initial": {"motor_speed": speed}},
        name=NAME,
    )


@pytest.mark.parametrize(("level", "resistance"), LEVELS)
def test_levels_map_to_the_stands_resistors(level: float, resistance: float) -> None:
    """R = 25 (1 - f)/f: the current is v/R at every sample."""
    rec = run(
        {},
        duration=0.05,
        mode="speed",
        command=[constant(20.0)],
        record="tap_current_a,voltage_a,leg_current_a,current_a@20 kHz",
        scenario={"fault": [tap(level)]},
        name=NAME,
    )
    drawn, voltage = rec["tap_current_a"].values[1:], rec["voltage_a"].values[1:]
    assert drawn == pytest.approx(voltage / resistance, rel=1e-12)
    assert np.max(np.abs(drawn)) > 0.5 * 230.0 / 3 / resistance
    leg = rec["leg_current_a"].values - rec["current_a"].values
    assert leg[1:] == pytest.approx(drawn, abs=1e-12)


@pytest.mark.parametrize("level", [0.1, 0.5])
def test_windings_and_resistor_close_at_the_centre(level: float) -> None:
    """sum i_j = - i_tap after every step, whatever the level."""
    rec = run(
        {},
        duration=0.02,
        mode="speed",
        command=[constant(20.0)],
        record=f"{PHASES},tap_current_a@every",
        scenario={"fault": [tap(level)]},
        name=NAME,
    )
    total = sum(rec[name].values for name in PHASES.split(","))
    assert total[1:] == pytest.approx(-rec["tap_current_a"].values[1:], abs=1e-9)


def test_the_centre_closes_again_when_the_resistor_is_taken_away() -> None:
    """The windings' sum is zero one step after the end of the fault."""
    fault = {**tap(0.5), "profile": {"kind": "intermittent", "period": "20 ms", "duty": 0.5}}
    rec = run(
        {},
        duration=0.02,
        mode="speed",
        command=[constant(20.0)],
        record=f"{PHASES}@every",
        scenario={"fault": [fault]},
        name=NAME,
    )
    total = np.abs(sum(rec[name].values for name in PHASES.split(",")))
    time = rec["current_a"].time
    assert np.max(total[(time > 1e-4) & (time < 0.0099)]) > 0.1
    assert np.max(total[time > 0.01 + 3e-6]) < 1e-9


def test_resistor_draws_the_same_at_any_speed_and_a_turn_short_does_not() -> None:
    """At a fixed applied voltage: V/R is the resistor's, V - k w the shorted turns'."""
    change: dict[str, list[float]] = {"resistor": [], "turns": []}
    for speed in (10.0, 40.0):
        healthy = at_voltage([], speed)
        short = {"kind": "short", "place": "motor.phase_a", "severity": 0.2}
        for name, fault in (("resistor", tap(0.25)), ("turns", short)):
            broken = at_voltage([fault], speed)
            extra = broken["leg_current_a"].values - healthy["leg_current_a"].values
            change[name].append(float(np.sqrt(np.mean(extra[2000:] ** 2))))
            if name == "resistor":
                drawn = broken["tap_current_a"].values[2000:]
                voltage = broken["voltage_a"].values[2000:]
                assert drawn == pytest.approx(voltage / 75.0, rel=1e-9)
    assert change["resistor"][0] == pytest.approx(change["resistor"][1], rel=0.01)
    assert change["resistor"][0] > 0.1
    assert change["turns"][1] < change["turns"][0] / 1.5


def order(rec: Any, wanted: float, name: str = "current_ref") -> float:
    """Amplitude of a line per motor turn over whole turns of the last part."""
    late = rec[name].time > 0.4
    angle, values = rec["motor_position"].values[late], rec[name].values[late]
    window = np.hanning(angle.size)
    line = np.sum(window * (values - values.mean()) * np.exp(-1j * wanted * angle))
    return float(2 * abs(line) / window.sum())


def steady(faults: list[dict[str, Any]], **values: Any) -> Any:
    """Constant speed against 4500 N."""
    return run(
        values,
        duration=1.4,
        mode="speed",
        command=[constant(37.7)],
        record=f"current_ref,motor_position,motor_speed,motor_torque,{PHASES}@10 kHz",
        scenario={"fault": faults, "load": {"output": {"terms": [constant(4500.0)]}}},
        name=NAME,
    )


@pytest.mark.parametrize(
    ("fault", "line"),
    [
        ({"kind": "short", "place": "motor.phase_a", "severity": 0.2}, 8.0),
        ({"kind": "eccentricity_dynamic", "place": "motor", "severity": 0.1}, 9.0),
        ({"kind": "unbalance", "place": "motor.rotor", "severity": "7.27 kg cm2"}, 1.0),
        ({"kind": "spall", "place": "screw.nut", "severity": "3 mm"}, 6.448),
        ({"kind": "mismatch", "place": "sensor.resolver", "severity": 0.05}, 2.0),
    ],
    ids=lambda x: x["kind"] if isinstance(x, dict) else "",
)
def test_each_fault_has_its_line(fault: dict[str, Any], line: float) -> None:
    """The line of the current reference stands five times above that of the healthy run; figures
    18 (order 2p + 1) and 19 (order 2p) among them."""
    assert order(steady([fault]), line) > 5 * order(steady([]), line)


def test_eccentricity_and_short_obey_their_coefficient_laws() -> None:
    """T = sum k_j i_j with k_j scaled by turns and gap, at every sample."""
    short = {"kind": "short", "place": "motor.phase_a", "severity": 0.2}
    rotor = {"kind": "eccentricity_dynamic", "place": "motor", "severity": 0.1}
    rec = steady([short, rotor], **{"thermal.model": "off"})
    angle = rec["motor_position"].values
    shift = 2 * math.pi / 3 * np.arange(3)[:, None]
    k = 1.1 * np.sin(4 * angle - shift) * (1 + 0.1 * np.cos(angle - shift))
    k[0] *= 0.8
    currents = np.stack([rec[name].values for name in PHASES.split(",")])
    torque = (k * currents).sum(axis=0)
    assert rec["motor_torque"].values == pytest.approx(torque, abs=1e-9 * np.max(np.abs(torque)))


def test_unbalance_weighs_as_its_half_ring() -> None:
    """m e g = 22.94 1/m * J_x * g: 0.164 N m at 7.27 kg cm2, once a turn."""
    fault = {"kind": "unbalance", "place": "motor.rotor", "severity": "7.27 kg cm2"}
    rec = run(
        {},
        duration=0.5,
        mode="speed",
        command=[constant(37.7)],
        record="unbalance_torque,motor_position@10 kHz",
        scenario={"fault": [fault]},
        name=NAME,
    )
    expected = -22.94 * 7.27e-4 * 9.80665 * np.cos(rec["motor_position"].values)
    assert rec["unbalance_torque"].values == pytest.approx(expected, abs=1e-12)
    assert np.max(expected) == pytest.approx(0.164, abs=0.001)


def test_a_resistor_at_an_open_phase_carries_what_the_other_phases_bring() -> None:
    """Phase b interrupted: its terminal floats, and legs a and c carry one current through winding
    and resistor.
    """
    rec = run(
        {},
        duration=0.1,
        mode="speed",
        command=[constant(40.0)],
        record="current_a,current_b,current_c,tap_current_a,leg_current_a,leg_current_c@100 kHz",
        scenario={
            "fault": [tap(0.25), "open_phase@motor.phase_b=1"],
            "initial": {"motor_speed": 40.0},
        },
        name=NAME,
    )
    late = rec["current_a"].time > 0.02
    names = (
        "current_a",
        "current_b",
        "current_c",
        "tap_current_a",
        "leg_current_a",
        "leg_current_c",
    )
    a, b, c, drawn, leg, back = (rec[name].values[late] for name in names)
    assert np.max(np.abs(b)) < 1e-9
    assert np.max(np.abs(leg)) > 1.0
    assert np.max(np.abs(leg - (a + drawn))) < 1e-12 * np.max(np.abs(leg))
    assert np.max(np.abs(leg + back)) < 1e-9 * np.max(np.abs(leg))
    assert np.max(np.abs(c - back)) == 0.0
