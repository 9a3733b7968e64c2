"""A backlash that a campaign changes between its logs."""

import math
from dataclasses import replace

import pytest

from elevon import Actuator
from elevon.calibrate import read_logs
from elevon.calibrate.zeros import position_estimates
from tests.calibrate.foreign import NOLOAD, draw, run
from tests.calibrate.foreign_files import Style, write_trial

BACKLASHES = {"first": 0.37, "second": 1.20, "third": 1.70}


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Three logs of one bench, its backlash changed between them."""
    folder = tmp_path_factory.mktemp("backlashes")
    bench, sensors = draw(3)
    paths = []
    for k, (name, backlash) in enumerate(BACKLASHES.items()):
        done = run(
            replace(bench, backlash=math.radians(backlash)), sensors, NOLOAD, k, duration=10.0
        )
        paths.append(write_trial(folder / f"{name}.csv", done, sensors, Style(), k))
    return read_logs(paths)


def test_backlashes_that_differ_are_said(logs):
    estimates, findings = position_estimates(logs, Actuator.load("torino-rotary"))
    paths = {item.path for item in estimates}
    assert "backlash.total" not in paths
    assert "sensor.encoder.offset" in paths
    assert findings[0].startswith("backlashes differ: first.csv 0.37 deg, second.csv 1.20 deg")


def test_each_log_has_its_own_backlash_when_asked(logs):
    estimates, _ = position_estimates(logs, Actuator.load("torino-rotary"), ["backlash.total"])
    each = {item.path: item for item in estimates}
    for name, backlash in BACKLASHES.items():
        item = each[f"backlash.total[{name}.csv]"]
        assert item.value == pytest.approx(math.radians(backlash), abs=2e-4)
        assert item.interval[0] <= math.radians(backlash) <= item.interval[1]


def test_one_backlash_in_all_logs_is_one_estimate(logs):
    estimates, findings = position_estimates(logs[:1], Actuator.load("torino-rotary"))
    assert "backlash.total" in {item.path for item in estimates}
    assert findings == ()
