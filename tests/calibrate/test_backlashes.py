"""A backlash that a campaign changes between its logs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from elevon import Actuator
from elevon.calibrate import read_logs
from elevon.calibrate.plant import accept
from elevon.calibrate.positions import (
    _spans,
    _unloaded,
    fit_backlash,
    mean_backlash,
    position_estimates,
)
from elevon.cli import main
from elevon.logs.log import Log
from tests.calibrate.foreign import NOLOAD, draw, run
from tests.calibrate.foreign_files import Style, write_trial

BACKLASHES = {"first": 0.37, "second": 1.20, "third": 1.70}
NEAR = {"a": 0.43, "b": 0.44, "c": 0.46}


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
    known = {item.path: item for item in estimates}
    assert "sensor.encoder.offset" in known
    assert findings[0].startswith("backlashes differ: first.csv 0.37 deg, second.csv 1.20 deg")
    # The mean, with the interval of one log: it holds each of them.
    mean = known["backlash.total"]
    assert mean.value == pytest.approx(math.radians(np.mean(list(BACKLASHES.values()))), rel=0.01)
    assert mean.interval[0] < math.radians(0.37) < math.radians(1.70) < mean.interval[1]
    # So wide an interval is not taken; logs that are nearer to each other give their mean.
    assert accept([mean], None, Actuator.load("torino-rotary")) == []
    one = fit_backlash(logs[:1], 124.0, 1e-4)
    near = {n: replace(one, backlash=(math.radians(x), 1e-5)) for n, x in NEAR.items()}
    width, std = mean_backlash(near).backlash
    assert width == pytest.approx(math.radians(0.4433), rel=1e-3)
    assert std == pytest.approx(math.radians(0.0153), rel=0.02)


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


def test_a_motion_smaller_than_its_lag_shows_no_backlash():
    """The output swings by more than the motor's way: nothing tells when the gap is crossed."""
    time = np.arange(0.0, 10.0, 0.01)
    swing = 0.01 * np.sin(2.0 * np.pi * 0.5 * time)
    channels = {
        "motor_position": 124.0 * swing,
        "motor_speed": 124.0 * np.gradient(swing, time),
        "output_position": -20.0 * np.gradient(swing, time),
    }
    assert fit_backlash([Log("small", time, channels)], 124.0, 1e-4) is None


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 4])
def test_weights_that_deflect_the_transmission_are_no_backlash(tmp_path, seed):
    """A free output under hung weights: the log's whole span is twice the backlash."""
    words = ["bench", "run", "compliance", "--actuator", "torino-rotary", "--seed", seed]
    assert main([str(word) for word in [*words, "--out", tmp_path]]) == 0
    actuator = Actuator.load("torino-rotary")
    estimates, _ = position_estimates(read_logs([tmp_path / "compliance.csv"]), actuator)
    (item,) = [item for item in estimates if item.path == "backlash.total"]
    assert item.interval[0] <= actuator.parameters.value("backlash.total") <= item.interval[1]
    assert "under load" in item.note


def test_the_stretches_that_agree_are_those_without_load():
    """Six stretches cross a gap of 1, four are deflected beyond it, two stand still."""
    rng = np.random.default_rng(2)
    gap = rng.choice([-0.5, 0.5], size=200) + 1e-3 * rng.standard_normal(200)
    loaded = [gap * factor + 0.1 for factor in (1.2, 1.5, 1.9, 2.4)]
    at_rest = [1e-3 * rng.standard_normal(200)] * 2
    unloaded = _unloaded([*[gap] * 6, *loaded, *at_rest], count=0.01)
    inner, outer, middle = _spans(unloaded)
    assert len(unloaded) == 6
    assert inner <= outer == pytest.approx(1.0, abs=0.01)
    assert middle == pytest.approx(0.0, abs=0.01)
    assert _unloaded([*loaded, *at_rest], count=0.01) == []
