"""Legs high, low and off: diodes, dead time, floating phases, the carrier-PWM drive."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.physics.rig import (
    FREE_SHAFT,
    HYSTERESIS,
    LOCKED,
    MOTOR,
    PWM,
    SUPPLY,
    K,
    L,
    P,
    R,
    constant,
    run,
    term,
    values,
)

CURRENTS = ("current_a", "current_b", "current_c")
VOLTAGES = ("voltage_a", "voltage_b", "voltage_c")

# Every switch open: what is left of the bridge is its six diodes.
OPEN = {f"inverter.open_{leg}_{side}": 1.0 for leg in "abc" for side in ("high", "low")}


def emf(position: np.ndarray, speed: np.ndarray | float, offset: float = 0.0) -> np.ndarray:
    """The three phase EMFs of a healthy motor."""
    return K * np.sin(P * position + offset - 2 * math.pi / 3 * np.arange(3)[:, None]) * speed


def spin(speed: float, duration: float = 0.05, **extra: object) -> object:
    """A heavy rotor turning with every leg off."""
    settings = FREE_SHAFT | HYSTERESIS | OPEN | {"motor.inertia": 10.0} | extra
    names = ",".join((*CURRENTS, *VOLTAGES, "motor_speed", "motor_position"))
    return run(
        settings,
        duration=duration,
        record=f"{names}@20 kHz",
        scenario={"initial": {"motor_speed": speed}},
    )


def test_below_the_rails_every_phase_floats_without_current() -> None:
    """Line EMF just under the link: no diode conducts and the line voltages are the EMFs."""
    speed = 0.99 * SUPPLY / (math.sqrt(3) * K)
    rec = spin(speed)
    assert np.all(np.stack(values(rec, *CURRENTS)) == 0.0)
    volts = np.stack(values(rec, *VOLTAGES))[:, 1:]
    position, w = (x[1:] for x in values(rec, "motor_position", "motor_speed"))
    expected = emf(position, w)
    for one, other in ((0, 1), (1, 2), (2, 0)):
        line = expected[one] - expected[other]
        assert volts[one] - volts[other] == pytest.approx(line, abs=2e-3 * SUPPLY)


def test_above_the_rails_the_diodes_rectify_and_brake() -> None:
    """Line EMF 10 % above the link: current flows against the EMF, so the rotor loses energy to
    the supply.
    """
    rec = spin(1.1 * SUPPLY / (math.sqrt(3) * K))
    currents = np.stack(values(rec, *CURRENTS))
    position, w = values(rec, "motor_position", "motor_speed")
    assert np.max(np.abs(currents)) > 0.1
    assert np.max(np.abs(currents.sum(axis=0))) < 1e-9
    assert np.mean((currents * emf(position, w)).sum(axis=0)) < 0.0


def test_open_phase_carries_nothing_and_leaves_the_neutral_to_the_others() -> None:
    """Phase a open: i_a = 0, i_b = -i_c, and v_n is the mean of the two connected phases only."""
    rec = run(
        MOTOR | HYSTERESIS,
        duration=0.05,
        record="@every",
        command=[term("sine", amplitude="7 deg", frequency="5 Hz")],
        scenario={"fault": [{"kind": "open_phase", "place": "motor.phase_a", "severity": 1}]},
    )
    i_a, i_b, i_c = values(rec, *CURRENTS)
    assert np.all(i_a == 0.0)
    assert np.max(np.abs(i_b)) > 0.5
    assert np.max(np.abs(i_b + i_c)) < 1e-9
    position, speed = values(rec, "motor_position", "motor_speed")
    e = emf(position, speed)
    _, v_b, v_c = values(rec, *VOLTAGES)
    voltage = (v_b - R * i_b - e[1]) + (v_c - R * i_c - e[2])
    assert np.max(np.abs(voltage)) < 1e-6 * SUPPLY + 1e-3 * np.max(np.abs(e))


def locked_pwm(command: float, rate: str = "40 kHz", **extra: object) -> object:
    """PWM drive on a locked rotor at theta_e = 90 deg (a carries I, b and c -I/2), torque
    command.
    """
    settings = FREE_SHAFT | PWM | LOCKED | {"motor.electrical_offset": math.pi / 2} | extra
    names = "current_q,current_d,voltage_q_ref,voltage_a,current_a,current_ref"
    return run(
        settings,
        duration=0.1,
        mode="torque",
        command=[constant(command)],
        record=f"{names}@{rate}",
    )


def test_current_loop_has_its_bandwidth() -> None:
    """A small step of current reaches 63 % one time constant after it, give or take two carrier
    periods.
    """
    bandwidth = 2 * math.pi * 200.0
    rec = locked_pwm(
        2.0, **{"pwm.proportional_gain": L * bandwidth, "pwm.integral_gain": R * bandwidth}
    )
    time, current = rec["current_q"].time, rec["current_q"].values
    target = 2.0 / (1.5 * K)
    rise = time[np.argmax(current > (1 - math.exp(-1)) * target)]
    assert rise == pytest.approx(1 / bandwidth, abs=2 / 4000.0)
    assert np.max(current) < 1.25 * target


def test_decoupling_keeps_the_direct_current_at_zero() -> None:
    """A torque step at speed: the cross term P w L i_q disturbs i_d unless it is fed forward."""

    def disturbance(on: bool) -> float:
        rec = run(
            FREE_SHAFT | PWM | ({} if on else {"pwm.inductance": 0.0}),
            duration=0.3,
            mode="speed",
            command=[constant(50.0)],
            record="current_d@4 kHz",
            scenario={"load": {"shaft": {"terms": [term("step", final=4.0, time="0.2 s")]}}},
        )
        late = rec["current_d"].time > 0.2
        return float(np.max(np.abs(rec["current_d"].values[late])))

    assert disturbance(True) < 0.6 * disturbance(False)


@pytest.mark.parametrize(
    "fault",
    [
        {"kind": "offset", "place": "sensor.resolver", "severity": "0.3 rad"},
        {"kind": "dropout", "place": "sensor.resolver", "severity": 0.5, "period": "20 ms"},
    ],
)
def test_a_track_of_its_own_keeps_the_carrier_drives_field(fault: dict) -> None:
    """Torque mode under load at 4 A, resolver wrong: with the field's own track torque and direct
    current are the healthy ones; with the resolver's angle they are not.
    """

    def quiet(source: str, faults: list[dict]) -> tuple[float, float]:
        rec = run(
            MOTOR | PWM | {"drive.commutation_source": source},
            duration=0.12,
            mode="torque",
            command=[constant(4.0)],
            record="motor_torque,current_d@4 kHz",
            scenario={"fault": faults, "load": {"brake": {"terms": [constant(3.0)]}}},
        )
        late = rec["motor_torque"].time > 0.06
        return (
            float(np.mean(rec["motor_torque"].values[late])),
            float(np.max(np.abs(rec["current_d"].values[late]))),
        )

    healthy, separate = quiet("resolver", []), quiet("separate", [fault])
    assert separate == healthy
    lost = quiet("resolver", [fault])
    assert lost[0] < 0.97 * healthy[0]
    assert lost[1] > 5 * healthy[1]


def test_computation_delay_moves_the_first_pulse() -> None:
    """Locked, a step of the reference at the start, which the sampling at 125 us sees first. With
    the reference m of half the link in one phase and -m in the others, legs differ where the
    carrier, one way in each half period, lies between: 62.5 us (1 - m) after its begin. Half a
    sample late is the middle of it.
    """

    def first(delay: float) -> float:
        rec = locked_pwm(2.0, rate="1 MHz", **{"pwm.computation_delay": delay})
        return float(rec["current_q"].time[np.argmax(rec["current_q"].values > 0.0)])

    height = PWM["pwm.proportional_gain"] * 2.0 / (1.5 * K) / (SUPPLY / 2) * 0.75
    early = 62.5e-6 * (1 - height)
    assert first(0.0) == pytest.approx(125e-6 + early, abs=3e-6)
    assert first(0.5) == pytest.approx(187.5e-6, abs=3e-6)
    assert first(1.0) == pytest.approx(250e-6 + early, abs=3e-6)


def test_on_resistance_adds_to_the_winding() -> None:
    """Locked and fully driven, two switches of R_on in the loop: i_a = (2/3 V) / (R + R_on)."""
    extra = {
        "inverter.supply_voltage": 30.0,
        "inverter.on_resistance": 0.5,
        "motor.electrical_offset": math.pi / 2,
    }
    rec = run(
        FREE_SHAFT | HYSTERESIS | LOCKED | extra,
        duration=0.15,
        mode="torque",
        command=[constant(20.0)],
        record="current_a@2 kHz",
    )
    assert rec.final["current_a"] == pytest.approx(20.0 / (R + 0.5), rel=1e-3)
