"""Logs of a high rate are thinned to the means of groups."""

from dataclasses import replace

import numpy as np
import pytest

from elevon.logs.brake import Brake
from elevon.logs.drive import group_means, groups_of, thinned
from elevon.logs.log import Log


def _log(rate):
    time = np.arange(0.0, 2.0, 1.0 / rate)
    wave = np.sin(3.0 * time)
    brake = Brake("torque", np.array([0.0, 2.0]), np.array([0.2, 0.4]))
    channels = {
        "speed_ref": wave, "motor_speed": wave, "torque_current": 2.0 * wave + 1.0,
        "current_ref": wave, "motor_position": 124.0 * wave,
    }  # fmt: skip
    return Log("log", time, channels, start=5.0, brake=brake)


def test_a_log_of_the_bench_stays_as_it_is():
    assert groups_of(np.arange(0.0, 1.0, 1.0 / 400.0)) == 1
    log = _log(400.0)
    assert thinned(log) is log


@pytest.mark.parametrize(("rate", "left"), [(2000.0, 1000.0), (20_000.0, 1000.0), (3300.0, 1100.0)])
def test_a_fast_log_keeps_its_instants_and_what_is_linear(rate, left):
    log = thinned(_log(rate))
    assert 1.0 / log.period == pytest.approx(left)
    assert log.time[0] == 0.0
    # Means of a sine at the middle of each group, to the second order of the group's width.
    at = log.time + log.start - 5.0
    np.testing.assert_allclose(log.speed, np.sin(3.0 * at), atol=2e-6)
    np.testing.assert_allclose(log.current, 2.0 * log.speed + 1.0, rtol=1e-12)
    assert log.brake.time[0] == pytest.approx(5.0 - log.start)
    assert not log.has("output_position")


def test_a_group_that_lacks_a_sample_is_not_good():
    log = _log(2000.0)
    log.good[7] = False
    assert np.flatnonzero(~thinned(log).good).tolist() == [3]
    values = np.arange(7.0)
    values[1] = np.nan
    np.testing.assert_array_equal(group_means(values, 3), [np.nan, 4.0])
    assert thinned(replace(log, good=np.ones(len(log.time), dtype=bool))).good.all()
