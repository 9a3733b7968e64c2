"""The carrier drive at steps of 1 to 25 us against the oracle that goes from edge to edge."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

from tests.oracle.carrier import Numbers, Trace, simulate
from tests.physics.rig import FREE_SHAFT, INERTIA, PWM, RATIO, SUPPLY, K, L, P, R, run, term

GAIN, KP, KI, VISCOUS = 16.7 * RATIO, 0.2, 0.667, 2e-3
AMPLITUDE, FREQUENCY, DURATION = math.radians(0.5), 7.0, 2.0 / 7.0
STEPS = (1e-6, 5e-6, 12.5e-6, 25e-6)
NUMBERS = Numbers(
    resistance=R,
    inductance=L,
    k=K,
    pole_pairs=P,
    inertia=INERTIA,
    viscous=VISCOUS,
    ratio=RATIO,
    supply=SUPPLY,
    gain_position=GAIN,
    kp=KP,
    ki=KI,
    kt=1.5 * K,
    frequency=PWM["pwm.frequency"],
    current_gain=PWM["pwm.proportional_gain"],
    current_integral=PWM["pwm.integral_gain"],
)
SETTINGS = (
    FREE_SHAFT
    | PWM
    | {
        "solver.method": "semi_implicit",
        "friction.viscous": VISCOUS,
        "control.position_gain": GAIN,
        "control.speed_gain": KP,
        "control.integral_time": KP / KI,
        "control.sample_time": NUMBERS.sample,
        "control.current_limit": 100.0,
        "control.conditional_integration": "off",
        "control.anti_windup_rest": "off",
        "control.anti_windup_error": "off",
    }
)


@cache
def oracle() -> Trace:
    """Two periods of a small sine."""
    return simulate(NUMBERS, lambda t: AMPLITUDE * math.sin(2 * math.pi * FREQUENCY * t), DURATION)


@cache
def core(step: float) -> Any:
    """The same through the public API, recorded at the samplings."""
    names = "current_a,current_b,current_c,motor_speed,motor_position,voltage_q_ref"
    return run(
        SETTINGS | {"solver.step": step},
        duration=DURATION,
        record=f"{names}@8 kHz",
        command=[term("sine", amplitude=AMPLITUDE, frequency=FREQUENCY)],
    )


def errors(step: float) -> dict[str, float]:
    """RMS of the difference over that of the quantity, RMS current of phase a by itself."""
    rec, trace = core(step), oracle()
    count = len(trace.time)

    def relative(name: str, theirs: np.ndarray) -> float:
        gap = rec[name].values[:count] - theirs
        return float(np.sqrt(np.mean(gap**2) / np.mean(theirs**2)))

    def rms(x: np.ndarray) -> float:
        return float(np.sqrt(np.mean(x[:count] ** 2)))

    return {
        "position": relative("motor_position", trace.motor),
        "speed": relative("motor_speed", trace.speed),
        "current": relative("current_a", trace.currents[:, 0]),
        "voltage": relative("voltage_q_ref", trace.voltage_q),
        "rms": abs(rms(rec["current_a"].values) / rms(trace.currents[:, 0]) - 1.0),
    }


def response(time: np.ndarray, motor: np.ndarray) -> complex:
    """Output over command at the sine's frequency, from the last period."""
    late = time >= DURATION - 1.0 / FREQUENCY - 1e-9
    t = time[late]
    basis = np.stack(
        [np.sin(2 * math.pi * FREQUENCY * t), np.cos(2 * math.pi * FREQUENCY * t), np.ones_like(t)],
        axis=1,
    )
    a, b, _ = np.linalg.lstsq(basis, motor[late] / RATIO, rcond=None)[0]
    return complex(a, b) / AMPLITUDE


@pytest.mark.parametrize("step", STEPS)
def test_every_quantity_follows_the_oracle(step: float) -> None:
    """A thousandth at 12.5 us, and in proportion at other steps: the rotor's position moves with
    the speed of one end of the step, which is of first order.
    """
    found = errors(step)
    assert max(found.values()) < 1e-3 * step / 12.5e-6, found


def test_errors_fall_with_the_step() -> None:
    """From 25 to 5 us at least by three, in each quantity."""
    coarse, fine = errors(25e-6), errors(5e-6)
    for name, value in coarse.items():
        assert fine[name] < value / 3.0, (name, coarse, fine)


@pytest.mark.parametrize("step", STEPS)
def test_small_signal_response(step: float) -> None:
    """Gain and phase at 7 Hz within a thousandth; edges on whole steps lost 4 % of the gain."""
    trace, rec = oracle(), core(step)
    count = len(trace.time)
    theirs = response(trace.time, trace.motor)
    ours = response(trace.time, rec["motor_position"].values[:count])
    assert abs(theirs) < 0.7
    assert abs(ours / theirs - 1.0) < 1e-3
