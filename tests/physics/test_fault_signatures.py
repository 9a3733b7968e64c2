"""The physics by which each fault of the rotary actuator shows."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tests.physics.rig import FREE_SHAFT, HYSTERESIS, MOTOR, PWM, K, P, constant, run, term, values


def turning(
    faults: list[dict[str, Any]], drive: dict[str, Any] = PWM, load: float = 2.0, record: str = ""
) -> Any:
    """Constant speed, 40 rad/s, against a constant shaft torque."""
    names = record or "motor_torque,current_q,current_d,motor_speed,motor_position,voltage_q_ref"
    return run(
        FREE_SHAFT | drive,
        duration=1.5,
        mode="speed",
        command=[constant(40.0)],
        record=f"{names}@8 kHz",
        scenario={"load": {"shaft": {"terms": [constant(load)]}}, "fault": faults},
    )


def harmonic(rec: Any, name: str, order: float, whole: int = 1) -> float:
    """Amplitude at `order` times the electrical angle in the last second, over a multiple of
    `whole` electrical turns.
    """
    angle = P * rec["motor_position"].values
    late = rec["motor_position"].time > 0.5
    angle, signal = angle[late], rec[name].values[late]
    turns = whole * math.floor((angle[-1] - angle[0]) / (2 * math.pi * whole))
    keep = angle <= angle[0] + 2 * math.pi * turns
    x, y = angle[keep], signal[keep]
    weight = np.gradient(x) / (2 * math.pi * turns)
    return float(abs(2 * np.sum(weight * y * np.exp(-1j * order * x))))


def fault(kind: str, place: str, severity: float, **attributes: Any) -> dict[str, Any]:
    """One fault as a scenario spells it."""
    return {"kind": kind, "place": place, "severity": severity, **attributes}


@pytest.mark.signature("short", "motor")
@pytest.mark.parametrize("name", ["motor_torque", "current_q", "voltage_q_ref"])
def test_short_ripples_at_twice_the_electrical_frequency(name: str) -> None:
    """The ripple at 2 theta_e grows with the severity and is absent when healthy."""
    ripple = [
        harmonic(turning([fault("short", "motor.phase_a", s)] if s else []), name, 2)
        for s in (0.0, 0.1, 0.2)
    ]
    assert ripple[1] > 3 * ripple[0]
    assert ripple[2] > 1.5 * ripple[1]


def test_shorted_torque_follows_the_coefficient_law() -> None:
    """T = sum k_j i_j with k_a scaled by the healthy turns, at every sample."""
    rec = turning(
        [fault("short", "motor.phase_a", 0.2)],
        HYSTERESIS,
        record="motor_torque,motor_position,current_a,current_b,current_c",
    )
    angle = P * rec["motor_position"].values
    currents = np.stack(values(rec, "current_a", "current_b", "current_c"))
    shape = np.sin(angle - 2 * math.pi / 3 * np.arange(3)[:, None]) * np.array(
        [[0.8], [1.0], [1.0]]
    )
    torque = K * (shape * currents).sum(axis=0)
    assert rec["motor_torque"].values == pytest.approx(torque, abs=1e-6 * np.max(np.abs(torque)))


@pytest.mark.signature("eccentricity_static", "motor")
@pytest.mark.parametrize("name", ["motor_torque", "voltage_q_ref"])
def test_static_eccentricity_shows_at_the_electrical_frequency(name: str) -> None:
    """Printed law with sinusoidal currents: -0.75 k zeta i_q cos(theta_e + phi): first order,
    twice as large for twice the amplitude, next to nothing when healthy."""
    ripple = [
        harmonic(turning([fault("eccentricity_static", "motor", z)] if z else []), name, 1)
        for z in (0.0, 0.1, 0.2)
    ]
    assert ripple[1] > 3 * ripple[0]
    assert ripple[2] > 1.6 * ripple[1]


@pytest.mark.signature("eccentricity_dynamic", "motor")
def test_dynamic_eccentricity_turns_with_the_shaft() -> None:
    """k_j (1 + zeta cos(theta_m - 2 pi (j-1)/3)) gives T = 1.5 k i_q - 0.75 k zeta i_q cos(2
    theta_e + theta_m): order 2 + 1/p of the electrical angle, where nothing healthy has a line.
    """
    order = 2 + 1 / P
    rec = turning([fault("eccentricity_dynamic", "motor", 0.1)])
    late = rec["current_q"].time > 0.5
    expected = 0.75 * K * 0.1 * np.mean(rec["current_q"].values[late])
    found = harmonic(rec, "motor_torque", order, whole=P)
    assert found == pytest.approx(expected, rel=0.5)
    assert found > 5 * harmonic(turning([]), "motor_torque", order, whole=P)


@pytest.mark.signature("demagnetisation", "motor")
def test_demagnetisation_needs_more_current_for_the_same_torque() -> None:
    """Flux down by 20 %: i_q up by 1/0.8."""
    healthy, weak = turning([]), turning([fault("demagnetisation", "motor", 0.2)])
    late = healthy["current_q"].time > 0.5
    ratio = np.mean(weak["current_q"].values[late]) / np.mean(healthy["current_q"].values[late])
    assert ratio == pytest.approx(1 / 0.8, rel=0.01)


def friction_current(faults: list[dict[str, Any]], settings: dict[str, Any]) -> float:
    """Mean moving current of the PWM drive at constant speed without load."""
    rec = run(
        FREE_SHAFT | PWM | settings,
        duration=1.0,
        mode="speed",
        command=[constant(30.0)],
        record="current_q@4 kHz",
        scenario={"fault": faults},
    )
    return float(np.mean(rec["current_q"].values[rec["current_q"].time > 0.5]))


@pytest.mark.signature("friction", "transmission")
def test_friction_raises_the_moving_current_by_the_torque_balance() -> None:
    """+25 % of the dry friction: current up by 0.25 FDJ / kt."""
    dry = 0.4
    settings = {"friction.static": 2 * dry, "friction.dynamic": dry}
    extra = friction_current(
        [fault("friction", "transmission", 0.25)], settings
    ) - friction_current([], settings)
    assert extra == pytest.approx(0.25 * dry / (1.5 * K), rel=0.02)


@pytest.mark.signature("lubrication", "transmission")
def test_lubrication_raises_the_moving_current_in_proportion_to_speed() -> None:
    """+50 % of the viscous coefficient at 30 rad/s."""
    viscous = 0.01
    settings = {"friction.viscous": viscous}
    extra = friction_current(
        [fault("lubrication", "transmission", 0.5)], settings
    ) - friction_current([], settings)
    assert extra == pytest.approx(0.5 * viscous * 30.0 / (1.5 * K), rel=0.02)


@pytest.mark.signature("backlash", "transmission")
@pytest.mark.parametrize("extra", [0.13, 0.4])
def test_backlash_widens_the_lost_motion_by_its_severity(extra: float) -> None:
    """Motor minus output over a reversal: the healthy total plus the extra one."""

    def lost(faults: list[dict[str, Any]]) -> float:
        rec = run(
            MOTOR | HYSTERESIS,
            duration=1.0,
            command=[term("sine", amplitude="7 deg", frequency="1 Hz")],
            record="motor_position,output_position@2 kHz",
            scenario={"fault": faults},
        )
        gap = rec["motor_position"].values / 124 - rec["output_position"].values
        return float(np.ptp(gap))

    more = lost([fault("backlash", "transmission", f"{extra} deg")]) - lost([])
    assert math.degrees(more) == pytest.approx(extra, rel=1e-6)


@pytest.mark.signature("jam", "transmission")
def test_jam_stops_the_output_at_its_place() -> None:
    """A seizure torque far above the motor's at 3 deg: the output goes no further than the backlash
    allows.
    """
    rec = run(
        MOTOR | HYSTERESIS,
        duration=1.0,
        command=[term("ramp", slope="10 deg/s")],
        record="output_position@1 kHz",
        scenario={"fault": [fault("jam", "transmission", 100.0, position="3 deg")]},
    )
    assert math.degrees(rec.final["output_position"]) == pytest.approx(3.0, abs=0.5)


@pytest.mark.signature("gain_drift", "control")
@pytest.mark.parametrize(
    ("place", "signal"), [("control.position", "speed_ref"), ("control.speed", "torque_ref")]
)
def test_gain_drift_scales_the_loop_it_names(place: str, signal: str) -> None:
    """The first sample after a small step, before anything has moved: reference x (1 +
    severity).
    """

    def first(faults: list[dict[str, Any]]) -> float:
        rec = run(
            MOTOR | HYSTERESIS | {"control.derivative_time": 0.0},
            duration=1e-3,
            command=[constant("0.05 deg")],
            record=f"{signal}@1 MHz",
            scenario={"fault": faults},
        )
        return float(rec[signal].values[1])

    assert first([fault("gain_drift", place, -0.2)]) == pytest.approx(0.8 * first([]), rel=1e-3)


@pytest.mark.signature("dropout", "resolver")
def test_lost_resolver_makes_the_position_jump_and_recover() -> None:
    """Power lost with a duty cycle: the output strays from the healthy run, then the loop brings
    it back.
    """
    command = [term("sine", amplitude="7 deg", frequency="0.5 Hz")]
    record = "output_position,motor_speed,resolver_position@1 kHz"
    healthy = run(MOTOR | HYSTERESIS, duration=2.0, command=command, record=record)
    gap = {"kind": "intermittent", "start": "0.3 s", "period": "10 s", "duty": 0.05}
    dropout = {**fault("dropout", "sensor.resolver", 0.5, period="0.05 s"), "profile": gap}
    lost = run(
        MOTOR | HYSTERESIS,
        duration=2.0,
        command=command,
        record=record,
        scenario={"fault": [dropout]},
    )
    strayed = np.abs(lost["output_position"].values - healthy["output_position"].values)
    assert np.degrees(strayed.max()) > 0.01
    assert np.max(np.abs(np.diff(lost["resolver_position"].values))) > 3 * np.max(
        np.abs(np.diff(healthy["resolver_position"].values))
    )
    assert strayed[-50:].mean() < 0.5 * strayed.max()


@pytest.mark.signature("gain", "current")
def test_current_sensor_gain_changes_what_the_drive_delivers() -> None:
    """A gain error of +g on every phase makes the true current 1/(1+g) of the reference: read on
    one phase as a ripple at twice the electrical frequency, as a short's, with the sum of true
    currents still zero.
    """
    rec = turning([fault("gain", "sensor.current_a", 0.2)])
    assert harmonic(rec, "current_q", 2) > 3 * harmonic(turning([]), "current_q", 2)


@pytest.mark.signature("offset", "current")
def test_current_sensor_offset_ripples_at_the_electrical_frequency() -> None:
    """A constant in one phase is a rotating vector in dq."""
    rec = turning([fault("offset", "sensor.current_a", 0.3)])
    assert harmonic(rec, "current_q", 1) > 3 * harmonic(turning([]), "current_q", 1)


@pytest.mark.signature("sag", "supply")
def test_supply_sag_lowers_the_speed_that_can_be_reached() -> None:
    """Half the link at the voltage limit: about half the speed."""

    def top(faults: list[dict[str, Any]]) -> float:
        rec = run(
            FREE_SHAFT | HYSTERESIS | {"inverter.supply_voltage": 60.0},
            duration=1.0,
            mode="torque",
            command=[constant(15.0)],
            record="motor_speed@1 kHz",
            scenario={"fault": faults},
        )
        return float(np.mean(rec["motor_speed"].values[-100:]))

    assert top([fault("sag", "supply", 0.5)]) == pytest.approx(0.5 * top([]), rel=0.05)


@pytest.mark.signature("missing_counts", "encoder")
def test_missing_counts_make_the_encoder_read_short() -> None:
    """A fraction of counts lost: the encoder's travel is short by it, so the loop carries the
    output too far.
    """
    rec = run(
        MOTOR | HYSTERESIS,
        duration=1.0,
        command=[term("ramp", slope="10 deg/s")],
        record="output_position,encoder_position@1 kHz",
        scenario={"fault": [fault("missing_counts", "sensor.encoder", 0.1)]},
    )
    assert rec.final["encoder_position"] == pytest.approx(
        0.9 * rec.final["output_position"], rel=0.02
    )


@pytest.mark.signature("open_switch", "inverter")
@pytest.mark.parametrize(("leg", "sign"), [("a_high", -1), ("b_low", 1)])
def test_open_switch_takes_one_half_wave_of_its_phase(leg: str, sign: int) -> None:
    """Without its upper switch a leg cannot drive current out of the bridge; diodes leave a rest.

    Opened at speed: at rest the motor may stall where the missing half wave was needed.
    """
    opened = {
        **fault("open_switch", f"inverter.{leg}", 1),
        "profile": {"kind": "step", "time": "0.3 s"},
    }
    name = f"current_{leg[0]}"
    rec = run(
        FREE_SHAFT | HYSTERESIS,
        duration=1.5,
        mode="speed",
        command=[constant(40.0)],
        record=f"{name}@8 kHz",
        scenario={
            "initial": {"motor_speed": 40.0},
            "load": {"shaft": {"terms": [constant(1.0)]}},
            "fault": [opened],
        },
    )
    time, current = rec[name].time, sign * rec[name].values
    before, after = current[(time > 0.1) & (time < 0.3)], current[time > 0.5]
    assert -np.min(before) > 1.0
    assert -np.min(after) < 0.25
    assert np.max(after) > 1.0
    assert np.mean(after) > 0.2
