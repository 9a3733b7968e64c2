"""The faults of switches, phases and position sensors: how each shows."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import elevon
from tests.physics.rig import (
    FREE_SHAFT,
    HYSTERESIS,
    INERTIA,
    MOTOR,
    PWM,
    K,
    P,
    actuator,
    constant,
    make_scenario,
    run,
    term,
)
from tests.physics.test_fault_signatures import fault, harmonic, turning

PLACES = ("a", "b", "c")


@pytest.mark.signature("open_phase", "motor")
@pytest.mark.parametrize("phase", PLACES)
def test_open_phase_leaves_one_loop_of_two_phases(phase: str) -> None:
    """Its current is zero, the other two are each other's negative."""
    opened = {
        **fault("open_phase", f"motor.phase_{phase}", 1),
        "profile": {"kind": "step", "time": "0.2 s"},
    }
    rec = run(
        FREE_SHAFT | HYSTERESIS,
        duration=0.6,
        mode="speed",
        command=[constant(40.0)],
        record="current_a,current_b,current_c@8 kHz",
        scenario={
            "initial": {"motor_speed": 40.0},
            "load": {"shaft": {"terms": [constant(1.0)]}},
            "fault": [opened],
        },
    )
    late = rec["current_a"].time > 0.3
    currents = {name: rec[f"current_{name}"].values[late] for name in PLACES}
    assert np.all(currents.pop(phase) == 0.0)
    one, other = currents.values()
    assert np.max(np.abs(one)) > 1.0
    assert one + other == pytest.approx(0.0, abs=1e-9)


@pytest.mark.signature("shorted_switch", "inverter")
@pytest.mark.parametrize("leg", ["a_high", "c_low"])
def test_shorted_switch_trips_the_drive_and_the_status_says_so(leg: str) -> None:
    """No gate fires any more; what still flows through the switch and the diodes only brakes."""
    rec = elevon.simulate(
        actuator(FREE_SHAFT | HYSTERESIS),
        make_scenario(
            duration=0.5,
            mode="speed",
            command=[constant(20.0)],
            extra={
                "load": {"shaft": {"terms": [constant(1.0)]}},
                "fault": [
                    {
                        **fault("shorted_switch", f"inverter.{leg}", 1),
                        "profile": {"kind": "step", "time": "0.1 s"},
                    }
                ],
            },
        ),
        record="motor_torque,motor_speed@20 kHz",
    )
    assert rec.status == "tripped"
    after = rec["motor_torque"].time > 0.2
    power = rec["motor_torque"].values[after] * rec["motor_speed"].values[after]
    assert np.mean(power) < 0.0


@pytest.mark.signature("mismatch", "resolver")
def test_mismatched_resolver_errs_at_twice_the_shaft_frequency() -> None:
    """atan2(g sin, cos) - theta has amplitude (1 - g)/(1 + g) at 2 theta_m."""
    lost = 0.2
    rec = turning(
        [fault("mismatch", "sensor.resolver", lost)],
        record="motor_position,resolver_position",
    )
    late = rec["motor_position"].time > 0.5
    angle = rec["motor_position"].values[late]
    error = np.angle(np.exp(1j * (rec["resolver_position"].values[late] - angle)))
    turns = math.floor((angle[-1] - angle[0]) / (2 * math.pi))
    keep = angle <= angle[0] + 2 * math.pi * turns
    x, y = angle[keep], error[keep]
    weight = np.gradient(x) / (2 * math.pi * turns)
    line = abs(2 * np.sum(weight * y * np.exp(-2j * x)))
    gain = 1 - lost
    assert line == pytest.approx((1 - gain) / (1 + gain), rel=0.02)


@pytest.mark.signature("offset", "resolver")
def test_resolver_offset_costs_torque_by_the_cosine_of_the_electrical_error() -> None:
    """A drive that commutates x off gives 1.5 k cos(p x) per ampere it commands."""
    offset = math.radians(8.0)

    def per_ampere(faults: list[dict[str, Any]]) -> float:
        rec = turning(faults, PWM, record="motor_torque,current_ref")
        late = rec["motor_torque"].time > 0.5
        ratio = rec["motor_torque"].values[late].mean() / rec["current_ref"].values[late].mean()
        return float(ratio)

    healthy = per_ampere([])
    assert healthy == pytest.approx(1.5 * K, rel=0.02)
    wrong = per_ampere([fault("offset", "sensor.resolver", offset)])
    assert wrong / healthy == pytest.approx(math.cos(P * offset), rel=0.02)


@pytest.mark.signature("offset", "encoder")
@pytest.mark.signature("gain", "encoder")
@pytest.mark.parametrize(("kind", "severity"), [("offset", 0.01), ("gain", 0.05)])
def test_encoder_error_moves_the_output_the_other_way(kind: str, severity: float) -> None:
    """The loop brings the reading to the command: command - offset, or command / (1 + gain)."""
    command = 0.2
    rec = run(
        MOTOR | HYSTERESIS | {"control.position_feedback": "encoder"},
        duration=3.0,
        command=[constant(command)],
        record="output_position,encoder_position@1 kHz",
        scenario={"fault": [fault(kind, "sensor.encoder", severity)]},
    )
    expected = command - severity if kind == "offset" else command / (1 + severity)
    assert rec.final["output_position"] == pytest.approx(expected, abs=2e-3)
    measured = rec.final["encoder_position"]
    true = rec.final["output_position"]
    count = 2 * math.pi / 80000
    wanted = true + severity if kind == "offset" else true * (1 + severity)
    assert measured == pytest.approx(wanted, abs=1.01 * count)


@pytest.mark.signature("gain", "resolver")
def test_resolver_gain_shows_a_speed_off_by_it() -> None:
    """The speed loop holds the reading: the shaft turns at reference / (1 + gain)."""
    rec = run(
        FREE_SHAFT | PWM,
        duration=2.0,
        mode="speed",
        command=[constant(40.0)],
        record="motor_speed@1 kHz",
        scenario={"fault": [fault("gain", "sensor.resolver", 0.1)]},
    )
    assert rec.final["motor_speed"] == pytest.approx(40.0 / 1.1, rel=0.01)


def test_missing_turns_show_in_each_phase_alike() -> None:
    """The ripple of a short at 2 theta_e has the same size whichever phase is shorted."""
    sizes = [
        harmonic(turning([fault("short", f"motor.phase_{name}", 0.1)]), "voltage_q_ref", 2)
        for name in PLACES
    ]
    assert sizes[1:] == pytest.approx(sizes[:1] * 2, rel=0.1)


def test_growing_backlash_only_ever_widens() -> None:
    """A ramp of extra backlash: the lost motion of each later cycle is larger."""
    rec = run(
        MOTOR | HYSTERESIS,
        duration=3.0,
        command=[term("sine", amplitude="7 deg", frequency="1 Hz")],
        record="motor_position,output_position@2 kHz",
        scenario={
            "fault": [
                {
                    **fault("backlash", "transmission", "0.5 deg"),
                    "profile": {"kind": "ramp", "start": "0 s", "end": "3 s"},
                }
            ]
        },
    )
    gap = rec["motor_position"].values / 124 - rec["output_position"].values
    cycles = [np.ptp(part) for part in np.array_split(gap, 3)]
    assert cycles[0] < cycles[1] < cycles[2]


@pytest.mark.signature("unbalance", "motor")
def test_unbalance_swings_the_speed_once_a_turn() -> None:
    """Coasting at w: the weight m e g of J_x * 22.94 1/m swings the speed by m e g / (J w)."""
    excess, speed = 5e-4, 100.0
    rec = run(
        FREE_SHAFT,
        duration=0.5,
        mode="speed",
        command=[],
        record="motor_speed@10 kHz",
        scenario={
            "initial": {"motor_speed": speed},
            "fault": [fault("unbalance", "motor.rotor", excess, phase=0.0)],
        },
    )
    weight = excess * 22.94 * 9.80665
    swing = np.ptp(rec["motor_speed"].values) / 2
    mean = float(np.mean(rec["motor_speed"].values))
    assert swing == pytest.approx(weight / ((INERTIA + excess) * mean), rel=0.01)


@pytest.mark.signature("resistor_short", "motor")
def test_resistor_draws_the_phase_voltage_over_its_resistance() -> None:
    """The windings no longer sum to zero: the rest is voltage_a / R, R = 25 ohm at one half."""
    rec = turning(
        [fault("resistor_short", "motor.phase_a", 0.25)],
        record="current_a,current_b,current_c,voltage_a",
    )
    total = sum(rec[f"current_{name}"].values for name in PLACES)
    voltage = rec["voltage_a"].values
    slope = np.sum(total * voltage) / np.sum(voltage**2)
    assert abs(slope) == pytest.approx(0.25 / (25.0 * 0.75), rel=0.02)
    assert np.max(np.abs(total - slope * voltage)) < 0.05 * np.max(np.abs(total))
