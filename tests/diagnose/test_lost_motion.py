"""Lost motion of an output that friction carries through its backlash, and of one that is free."""

import numpy as np
import pytest

from elevon.calibrate.positions import through_backlash
from elevon.diagnose.positions.features import features_of
from elevon.logs.log import Log

RATIO, BACKLASH = 124.0, 0.009
TIME = np.arange(0.0, 20.0, 0.0025)


def features_with(output):
    """Features of a sine of 7 deg whose output stands where it is put."""
    motor = RATIO * (0.17 + 0.12 * np.sin(2.0 * np.pi * 0.2 * TIME))
    speed = np.gradient(motor, TIME)
    count = 2.0 * np.pi / 80_000
    position = np.floor(output(motor / RATIO) / count) * count
    channels = {
        "output_position": position, "motor_position": motor, "speed_ref": speed,
        "motor_speed": speed, "current_ref": np.ones_like(TIME), "torque_current": np.sign(speed),
    }  # fmt: skip
    signals = Log("sine", TIME, channels)
    return features_of(signals, ratio=RATIO, pole_pairs=4.0, emf=1.0)


def lost(evident):
    at = evident.names.index("lost_motion")
    return evident.values[at], evident.std[at]


def test_a_carried_output_shows_its_backlash_between_the_directions():
    result = features_with(lambda driver: through_backlash(driver, BACKLASH))
    assert not result.floats
    assert lost(result)[0] == pytest.approx(BACKLASH, rel=0.01)


def test_a_output_that_flies_from_end_to_end_shows_its_backlash_by_the_width():
    """The directions alone would say that there is hardly any backlash."""
    bounce = 0.5 * BACKLASH * np.sign(np.sin(2.0 * np.pi * 7.3 * TIME))
    result = features_with(lambda driver: driver + bounce)
    assert result.floats
    value, std = lost(result)
    assert value == pytest.approx(BACKLASH, rel=0.01)
    assert 0.0 < std < 0.01 * BACKLASH


def test_without_backlash_rounding_does_not_float():
    result = features_with(lambda driver: driver)
    assert not result.floats
    assert abs(lost(result)[0]) < 2e-5
