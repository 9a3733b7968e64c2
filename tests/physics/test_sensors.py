"""What the sensors do to a signal, each against its definition."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.physics.rig import FREE_SHAFT, HYSTERESIS, LOCKED, constant, run, term, values

SWING = {
    "load": {"shaft": {"terms": [term("sine", amplitude=4.0, frequency=2.0, phase="90 deg")]}},
}
COUNT = 2 * math.pi / 80000  # 5000 pulses, 4 edges, 88 teeth on 22


def swinging(settings: dict[str, object], record: str) -> object:
    """A free shaft swung by a torque, nothing in the loop."""
    return run(FREE_SHAFT | settings, duration=0.5, record=f"{record}@4 kHz", scenario=SWING)


def test_encoder_shows_whole_counts_of_the_output_position() -> None:
    """80000 counts a turn; the shown position is never more than one count from the true one."""
    measured, true = values(
        swinging({}, "encoder_position,output_position"), "encoder_position", "output_position"
    )
    counts = measured / COUNT
    assert counts == pytest.approx(np.round(counts), abs=1e-6)
    assert np.max(np.abs(measured - true)) <= COUNT * (1 + 1e-9)
    assert np.unique(np.round(counts)).size > 100


@pytest.mark.parametrize("lost", [0.05, 0.3])
def test_resolver_mismatch_is_the_angle_of_unequal_channels(lost: float) -> None:
    """Shown angle = atan2(g sin, cos), unwrapped along the true one."""
    rec = swinging({"sensor.resolver.mismatch": lost}, "resolver_position,motor_position")
    measured, true = values(rec, "resolver_position", "motor_position")
    angle = np.arctan2((1 - lost) * np.sin(true), np.cos(true))
    difference = np.angle(np.exp(1j * (measured - angle)))
    assert np.max(np.abs(difference)) < 1e-9
    assert np.max(np.abs(measured - true)) > 0.4 * lost
    assert np.max(np.abs(measured - true)) < math.pi / 2


def test_resolver_offset_shifts_the_measured_angle() -> None:
    """By its value, everywhere."""
    rec = swinging({"sensor.resolver.offset": 0.1}, "resolver_position,motor_position")
    measured, true = values(rec, "resolver_position", "motor_position")
    assert measured - true == pytest.approx(0.1, abs=1e-12)


SENSED = FREE_SHAFT | HYSTERESIS | LOCKED | {"motor.electrical_offset": math.pi / 2}


def sensed(settings: dict[str, object], record: str, duration: float = 0.05) -> object:
    """A locked rotor carrying about 4 A on phase a."""
    return run(
        SENSED | settings, duration=duration, mode="torque", command=[constant(4.4)], record=record
    )


def test_current_sensor_applies_gain_and_offset() -> None:
    """shown = g i + o, per phase."""
    rec = sensed(
        {"sensor.current.gain_a": 1.1, "sensor.current.offset_a": 0.2},
        "current_a,current_a_meas,current_b,current_b_meas@20 kHz",
    )
    i_a, shown_a, i_b, shown_b = values(
        rec, "current_a", "current_a_meas", "current_b", "current_b_meas"
    )
    assert shown_a == pytest.approx(1.1 * i_a + 0.2, abs=1e-12)
    assert shown_b == pytest.approx(i_b, abs=1e-12)


def test_current_sensor_quantises_to_its_bits() -> None:
    """8 bits over +-40 A: steps of 0.3125 A, error at most half of one."""
    step = 80.0 / 2**8
    rec = sensed(
        {"sensor.current.bits": 8, "sensor.current.full_scale": 40.0},
        "current_a,current_a_meas@20 kHz",
    )
    true, measured = values(rec, "current_a", "current_a_meas")
    assert measured / step == pytest.approx(np.round(measured / step), abs=1e-9)
    assert np.max(np.abs(measured - true)) <= step / 2 * (1 + 1e-9)
    assert np.unique(measured).size > 4


def test_current_noise_has_its_deviation() -> None:
    """0.05 A held over 10 us: 5000 draws give the deviation within 5 % and a mean within 3
    sigma.
    """
    rec = sensed(
        {"sensor.current.noise_deviation": 0.05, "sensor.current.noise_sample_time": 1e-5},
        "current_a,current_a_meas@100 kHz",
    )
    true, measured = values(rec, "current_a", "current_a_meas")
    noise = (measured - true)[10:]
    assert np.std(noise) == pytest.approx(0.05, rel=0.05)
    assert abs(np.mean(noise)) < 3 * 0.05 / math.sqrt(noise.size)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.06


def test_resolver_noise_has_its_deviations() -> None:
    """1 mrad and 0.2 rad/s, held over 10 us and independent of each other."""
    rec = sensed(
        {"sensor.resolver.noise_deviation": 1e-3, "sensor.resolver.speed_noise_deviation": 0.2,
         "sensor.resolver.noise_sample_time": 1e-5},
        "motor_position,resolver_position,motor_speed,resolver_speed@100 kHz",
    )  # fmt: skip
    angle, angle_shown, speed, speed_shown = values(
        rec, "motor_position", "resolver_position", "motor_speed", "resolver_speed"
    )
    noise = np.array([angle_shown - angle, speed_shown - speed])[:, 10:]
    assert np.std(noise, axis=1) == pytest.approx([1e-3, 0.2], rel=0.05)
    assert abs(np.corrcoef(noise)[0, 1]) < 0.06
    assert abs(np.corrcoef(noise[0, 1:], noise[0, :-1])[0, 1]) < 0.06


def test_acquisition_filter_is_first_order() -> None:
    """The filtered q current is the true one through 1 / (1 + s / (2 pi f)), done again by hand."""
    cutoff = 100.0
    rec = sensed({"sensor.filter_cutoff": cutoff}, "current_q,current_q_meas@1 MHz", duration=0.02)
    true, measured = values(rec, "current_q", "current_q_meas")
    share = 1 - math.exp(-2 * math.pi * cutoff * 1e-6)
    expected, state = np.zeros_like(true), 0.0
    for k, x in enumerate(true):
        state += share * (x - state)
        expected[k] = state
    assert measured == pytest.approx(expected, abs=2e-3 * np.max(true))


def test_controller_holds_its_output_between_its_ticks() -> None:
    """A sample time of 125 us: the torque reference changes at ticks only."""
    rec = run(
        FREE_SHAFT | HYSTERESIS | {"control.sample_time": 125e-6, "control.derivative_time": 0.0},
        duration=0.02,
        command=[term("sine", amplitude="2 deg", frequency="5 Hz")],
        record="torque_ref@1 MHz",
    )
    torque = rec["torque_ref"].values
    changed = np.flatnonzero(np.diff(torque))
    assert changed.size > 100
    assert np.unique(np.diff(changed)).tolist() == [125]
