"""The closed loop against logs: what agrees passes, what does not fails, with its numbers."""

from dataclasses import replace

import numpy as np
import pytest

import elevon
from elevon import Actuator
from elevon.calibrate import calibrate, read_logs, validate
from elevon.calibrate.door import held_out_agreement
from elevon.calibrate.report import calibration_report, validation_report
from elevon.calibrate.validation import SIGNALS, SignalError, Validation
from elevon.calibrate.write import outliers, thresholds, write_calibration
from elevon.errors import InputError, UnknownNameError
from tests.calibrate.bench import write_logs


@pytest.fixture(scope="module")
def checked(logs, result):
    return validate(logs, result.actuator)


def test_errors_are_those_of_the_definition(checked):
    assert len(checked.errors) == 9
    trace = checked.traces[0]
    assert trace.time[trace.used][0] >= 10.0
    for error in checked.errors[:3]:
        data, model = (d[error.signal][trace.used] for d in (trace.measured, trace.simulated))
        assert error.rms == pytest.approx(np.sqrt(np.mean((model - data) ** 2)))
        assert error.largest == pytest.approx(np.abs(model - data).max())
        assert error.of_range == pytest.approx(100 * error.rms / np.ptp(data))
        assert error.of_rms == pytest.approx(100 * error.rms / data.std())


def test_calibration_improves_every_signal_of_every_log(logs, before, checked):
    old = {(e.log, e.signal): e.rms for e in validate(logs, before).errors}
    for error in checked.errors:
        assert error.rms < old[error.log, error.signal], (error.log, error.signal)


def test_without_thresholds_there_is_no_verdict(checked):
    assert checked.status == "measured"
    assert all(error.passed is None for error in checked.errors)


def test_a_written_set_carries_thresholds_and_reads_back(tmp_path, logs, result, checked, before):
    path = write_calibration(tmp_path / "bench-7.toml", result, validation=checked)
    loaded = Actuator.load(path)
    assert loaded.name == "bench-7"
    for name, value in loaded.parameters.items():
        expected = result.actuator.parameters[name].value
        assert value.value == (
            pytest.approx(expected, rel=1e-12) if isinstance(expected, float) else expected
        )
    entry = loaded.parameters["friction.dynamic"]
    assert entry.confidence == "calibrated"
    assert entry.source == "calibrated from noload.csv, loaded.csv, chirp.csv"
    assert entry.old == before.parameters.value("friction.dynamic")
    assert entry.interval == pytest.approx(result["friction.dynamic"].interval)
    assert loaded.validation is not None
    assert loaded.validation["limits"] == thresholds(checked)
    assert validate(logs, loaded).status == "pass"
    slower = loaded.with_values({"friction.static": 1.0, "friction.dynamic": 1.0})
    assert validate(logs, slower).status == "fail"


def test_a_threshold_for_an_unknown_signal_is_refused(tmp_path, logs):
    path = tmp_path / "odd.toml"
    path.write_text('name = "odd"\nbase = "torino-rotary"\n[validation.limits]\nmotor_sped = 1.0\n')
    with pytest.raises(UnknownNameError, match="motor_speed"):
        validate(logs, Actuator.load(path))
    path.write_text('name = "odd"\nbase = "torino-rotary"\n[validation]\nlimit = 1.0\n')
    with pytest.raises(InputError, match="limit"):
        Actuator.load(path)


def test_a_transient_longer_than_the_log_is_refused(logs, before):
    with pytest.raises(InputError, match="lasts"):
        validate(logs, before, transient=25.0)
    with pytest.raises(InputError, match="lasts"):
        calibrate(logs, before, transient=25.0)


@pytest.mark.long
def test_reports_hold_what_was_found(logs, result, checked, before, truth, tmp_path):
    judged = replace(result, validation_before=validate(logs, before), validation=checked)
    html = calibration_report(judged, truth=truth.values).html()
    for item in result.estimates:
        assert item.path in html
    assert "<script src" not in html
    for signal in ("encoder", "motor speed", "torque current"):
        assert signal in html
    assert len(SIGNALS) == 3
    assert validation_report(checked).status is None
    back = elevon.load(judged.save(tmp_path / "result.json"))
    assert back == judged
    assert back.report().html().count("<svg") == judged.report().html().count("<svg")
    assert back.actuator.parameters == result.actuator.parameters


def test_names_of_logs_are_escaped(truth, tmp_path, before):
    (path,) = write_logs(truth, tmp_path, names=["noload"])
    evil = tmp_path / "<img src=x onerror=alert(1)>.csv"
    path.rename(evil)
    data = read_logs([evil])
    html = validation_report(validate(data, before)).html()
    assert "<img" not in html
    assert "&lt;img" in html


def judged(errors):
    """A validation of logs a, b, c with these errors of the speed, in percent of its range."""
    rows = tuple(
        SignalError(name, "motor_speed", "rad/s", 1.0, 1.0, 1.0, error, 1.0, None)
        for name, error in zip("abc", errors, strict=False)
    )
    return Validation("set", "low", 1.0, rows, {}, ())


def test_a_log_that_fits_badly_does_not_widen_the_thresholds():
    assert thresholds(judged([0.5, 0.6, 3.9])) == {"motor_speed": 1.2}
    assert outliers(judged([0.5, 0.6, 3.9])) == ["c"]
    assert outliers(judged([0.5, 3.9])) == []
    assert outliers(judged([0.01, 0.02, 0.3])) == []
    assert thresholds(judged([0.5, 1.0, 1.2])) == {"motor_speed": 2.4}


@pytest.mark.long
def test_thresholds_come_from_logs_held_out(logs, result, before):
    after = validate(logs, result.actuator)
    validated = held_out_agreement(logs, before, None, after)
    assert {row.log for row in validated.errors} <= {log.name for log in logs}
    pairs = {(row.log, row.signal): row.of_range for row in after.errors}
    worse = [row.of_range >= 0.9 * pairs[row.log, row.signal] for row in validated.errors]
    assert np.mean(worse) > 0.7
