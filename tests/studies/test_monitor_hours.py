"""Hours of healthy units made of recorded windows: what is drawn and counted; one small run."""

from types import SimpleNamespace

import numpy as np
import pytest

from elevon.diagnose.monitor.filter import WindowSpread
from elevon.diagnose.monitor.threshold import AlarmThresholds
from studies.monitor_hours import MOTIONS, HealthyDay, MonitorHours, _watched, study_monitor_hours


def watch(level):
    spread = WindowSpread(0.1 * np.eye(3), 0.1 * np.eye(3), np.eye(3), 0.99)
    return SimpleNamespace(
        reference=SimpleNamespace(spread=spread, directions=np.eye(3)), width=5.0,
        thresholds=AlarmThresholds(level, level, False),
    )  # fmt: skip


def test_streams_of_a_quiet_day_are_quiet_and_those_that_deviate_alarm():
    rng = np.random.default_rng(1)
    quiet, far = 0.3 * rng.standard_normal((12, 3)), 8.0 + rng.standard_normal((12, 3))
    day = _watched("x", watch(12.0), quiet, rng, daily=False)
    assert (day.alarms, day.windows) == (0, 12)
    assert day.hours == pytest.approx(400 * 12 * 5.0 / 3600.0)
    assert _watched("x", watch(12.0), far, rng, daily=False).alarms == 400


def test_rates_are_by_day():
    days = [HealthyDay("a", 10, 2.0, alarms) for alarms in (0, 2, 4)] + [
        HealthyDay("b", 10, 1.0, 0)
    ]
    first, second = MonitorHours(tuple(days), 1).rows
    assert first["per_hour"] == pytest.approx(1.0)
    assert first["interval"][0] == 0.0
    assert (first["days_without"], second["alarms"]) == (1, 0)


@pytest.mark.long
def test_three_actuators_are_watched():
    result = study_monitor_hours(seed=3, days=2, processes=1)
    assert {day.actuator for day in result.days} == set(MOTIONS)
    assert all(day.windows >= 4 for day in result.days)
