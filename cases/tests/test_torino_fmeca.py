"""What a fault of the failure table does to a log, beside what noise alone does."""

import numpy as np

from elevon.logs.log import Log
from elevon_cases.torino.fmeca import HEALTHY_LOGS, STANDS_OUT, deviation

TIME = np.arange(4000) / 400.0


def log_of(seed, torque=1.0, noise=0.02):
    """Return a log of a torque current beside seven channels of ripple about nothing."""
    ripple = np.random.default_rng(seed).standard_normal((8, TIME.size))
    channels = {"torque_current": torque + noise * ripple[0]}
    names = ("direct_current", "motor_speed", "output_position", "motor_position", "command",
             "speed_ref", "current_ref")  # fmt: skip
    return Log(f"log {seed}", TIME, channels | dict(zip(names, ripple[1:], strict=True)))


def ratio(log, first=0):
    healthy = [log_of(first + seed) for seed in range(HEALTHY_LOGS)]
    largest = max(
        deviation([other for other in healthy if other is not one], one)[0] for one in healthy
    )
    found, channel = deviation(healthy, log)
    return found / largest, channel


def test_healthy_logs_stand_out_as_seldom_as_is_said():
    draws = range(1000, 51_000, 1000)
    standing = [ratio(log_of(first + 500), first)[0] >= STANDS_OUT for first in draws]
    assert sum(standing) <= 3  # one of a hundred: four or more of fifty are one of 600


def test_a_change_of_one_percent_of_what_does_not_ripple_stands_out_in_its_channel():
    value, channel = ratio(log_of(100, torque=1.01))
    assert value > STANDS_OUT
    assert channel == "torque_current"
