"""A synthetic drive trace with a known truth: servo with backlash, independent of the simulator."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

RATIO = 124.0
GAIN = 1000.0 / 60.0 * RATIO


@dataclass
class Truth:
    """A log's signals (SI) and the numbers behind them."""

    signals: dict
    amplitude: float
    frequency: float
    phase: float
    bias: float
    backlash: float
    trigger: float


def backlash_operator(x, width):
    out, state = np.empty_like(x), x[0]
    for k, value in enumerate(x):
        state = min(max(state, value - width / 2), value + width / 2)
        out[k] = state
    return out


def servo_log(
    *,
    seconds=20.0,
    rate=400.0,
    amplitude=math.radians(7.0),
    bias=math.radians(10.0),
    frequency=0.2,
    phase=0.3,
    backlash=math.radians(0.3656),
    zero=0.0,
    trigger=1.2345,
    noise=1.0,
    seed=0,
):
    """Ideal speed loop inside the published position loop, run at 8 kHz, logged at `rate`.

    The output encoder is quantised to 1/80000 turn and noisy before it is fed back, so the log's
    reconstruction is as imperfect as the real one's.
    """
    rng = np.random.default_rng(seed)
    fine = 8000
    n = int(seconds * fine)
    t = np.arange(n) / fine
    command = bias + amplitude * np.sin(2 * math.pi * frequency * t + phase)
    count = 2 * math.pi / 80000
    jitter = rng.normal(0.0, 0.3 * count * noise, n)
    motor = np.empty(n)
    output = np.empty(n)
    reference = np.empty(n)
    m, u = zero * RATIO, 0.0
    w, limit = 0.0, 500 * math.pi / 30
    measured = u
    for k in range(n):
        if k % 8 == 0:
            measured = round((u + jitter[k]) / count) * count
            w = min(max(GAIN * (command[k] - measured), -limit), limit)
        motor[k], output[k], reference[k] = m, measured, w
        m += w / fine
        u = min(max(u, m / RATIO - backlash / 2), m / RATIO + backlash / 2)
    step = int(fine / rate)
    pick = slice(0, n, step)
    speed = np.gradient(motor, 1 / fine)[pick] + rng.normal(0, 0.05 * noise, len(t[pick]))
    torque = 0.4 * np.sign(speed) + 0.01 * speed
    current = torque / 1.4 + rng.normal(0, 0.02 * noise, len(speed))
    signals = {
        "time": t[pick],
        "encoder_position": output[pick],
        "resolver_position": motor[pick],
        "speed_ref": reference[pick],
        "motor_speed": speed,
        "current_ref": torque / 1.4,
        "current_d_meas": rng.normal(0, 0.02 * noise, len(speed)),
        "current_q_meas": current,
        "voltage_q_ref": 1.4 * speed + 2.75 * current,
        "trigger": (t[pick] >= trigger).astype(float),
    }
    return Truth(signals, amplitude, frequency, phase, bias, backlash, trigger)


@pytest.fixture(scope="session")
def truth():
    return servo_log()
