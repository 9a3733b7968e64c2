"""Forty drops of a weight as a calibration."""

import json
from importlib.resources import files

import numpy as np
import pytest

from elevon import Actuator
from elevon.calibrate.drops import calibrate_compliance
from elevon.cli.runner import run
from elevon.errors import InputError, RangeError


def drops(rng, stiffness=600.0, dead=2e-3, scatter=5e-4):
    weight = np.repeat(np.arange(10), 4)
    torque = 0.8 * (weight + 1)
    shared = rng.normal(0.0, scatter, 10)[weight]
    loss = dead + torque / stiffness + shared + rng.normal(0.0, scatter, 40)
    return torque, loss, weight


def test_stiffness_and_dead_zone_with_intervals_that_cover():
    rng = np.random.default_rng(7)
    hits = 0
    for _ in range(150):
        torque, loss, weight = drops(rng)
        result = calibrate_compliance(torque, loss, weight=weight)
        stiffness, dead = result.estimates
        assert stiffness.value == pytest.approx(600.0, rel=0.25)
        hits += stiffness.interval[0] <= 600.0 <= stiffness.interval[1]
        hits += dead.interval[0] <= 2e-3 <= dead.interval[1]
    assert 0.8 <= hits / 300 <= 0.97


def test_an_outlier_is_named_and_moves_little():
    torque, loss, weight = drops(np.random.default_rng(1), scatter=2e-4)
    clean = calibrate_compliance(torque, loss, weight=weight).estimates[0].value
    loss[17] += 0.02
    result = calibrate_compliance(torque, loss, weight=weight)
    assert 17 in result.outliers
    assert result.estimates[0].value == pytest.approx(clean, rel=0.05)


def test_the_forty_rows(tmp_path, capsys):
    table = files("elevon.data") / "torino_compliance.csv"
    out = tmp_path / "stiff.toml"
    arguments = ["calibrate", str(table), "--actuator", "torino-rotary", "--out", str(out)]
    assert run([*arguments, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["rows"] == 40
    assert {slip["row"] for slip in document["slips"]} >= {1, 3, 10, 14, 28, 29}
    found = document["parameters"]["backlash.stiffness"]
    # Loss on load over the repaired rows gives 113.4 N/deg without offsets or weights.
    assert 100.0 < document["stiffness_n_per_deg"] < 135.0
    assert found["low"] < found["value"] < found["high"]
    dead = document["parameters"]["derived.dead_zone"]
    assert dead["low"] < dead["value"] < dead["high"]
    loaded = Actuator.load(out).parameters["backlash.stiffness"]
    assert loaded.value == pytest.approx(found["value"])
    assert loaded.confidence == "calibrated"


def test_refusals(tmp_path):
    torque, loss, weight = drops(np.random.default_rng(1))
    with pytest.raises(InputError, match="weights"):
        calibrate_compliance(torque[:8], loss[:8], weight=weight[:8])
    with pytest.raises(RangeError, match="does not grow"):
        calibrate_compliance(torque, -loss, weight=weight)
    with pytest.raises(RangeError, match="finite"):
        calibrate_compliance(torque, loss * np.nan, weight=weight)
    with pytest.raises(InputError, match="losses"):
        calibrate_compliance(torque, loss[:5], weight=weight)
    bad = tmp_path / "bad.csv"
    bad.write_text("load_n,motor_deg,encoder_deg,loss_deg\n1,2,x,3\n")
    assert run(["calibrate", str(bad), "--actuator", "torino-rotary"]) == 2
