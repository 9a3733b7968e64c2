"""The fit of the reduced-order model's own numbers: recovers the known, keeps the undetermined."""

import json

import numpy as np
import pytest

import elevon
from elevon.calibrate.low_fit import FitCase, fit_low, named_cases
from elevon.cli import main
from elevon.errors import InputError

MOVING = {
    "duration": "6 s",
    "command": {"terms": [{"kind": "sine", "amplitude": "5 deg", "frequency": "0.5 Hz"}]},
    "load": {"brake": {"terms": [{"kind": "constant", "value": "1 N m"}]}},
}


def moving():
    return elevon.Scenario.from_dict(MOVING)


def test_a_bad_number_is_fitted_and_the_errors_fall():
    actuator = elevon.Actuator.load("torino-rotary").with_values({"low.band_ratio": 0.95})
    fit = fit_low(actuator, [FitCase("moving", moving())])
    (number,) = fit.fitted
    assert (number.path, number.old) == ("low.band_ratio", 0.95)
    assert number.new < 0.8
    assert "low.voltage_ratio" in dict(fit.unchanged)
    before, after = (
        sum(value**2 for errors in rows for value in errors.values())
        for rows in ([case.before for case in fit.cases], [case.after for case in fit.cases])
    )
    assert after < 0.9 * before
    assert np.isnan(number.deviation)


def test_the_pwm_drive_has_no_band():
    actuator = elevon.Actuator.load("torino-rotary").with_values({"drive.kind": "pwm"})
    fit = fit_low(actuator, [FitCase("moving", moving())])
    assert not fit.fitted
    assert dict(fit.unchanged)["low.band_ratio"] == "no case depends on it with this drive"


def test_refusals():
    rotary = elevon.Actuator.load("torino-rotary")
    with pytest.raises(InputError, match="no case"):
        fit_low(rotary, [])
    short = elevon.Scenario.from_dict({"duration": "1 s"})
    with pytest.raises(InputError, match="lasts 1 s"):
        fit_low(rotary, [FitCase("short", short)])
    with pytest.raises(InputError, match="nothing to fit"):
        fit_low(elevon.Actuator.load("pisa-landing-gear"), [FitCase("moving", moving())])


def test_named_cases_are_healthy_and_each_fault_alone():
    names = [case.name for case in named_cases([("m", moving())], ["friction@transmission=0.25"])]
    assert names == ["m, as given", "m, friction@transmission=0.25"]


def test_command_writes_a_set_with_its_provenance(tmp_path, capsys):
    scenario = tmp_path / "moving.toml"
    scenario.write_text(
        'duration = "6 s"\n[[command.terms]]\nkind = "sine"\namplitude = "5 deg"\n'
        'frequency = "0.5 Hz"\n[[load.brake.terms]]\nkind = "constant"\nvalue = "1 N m"\n'
    )
    out, report = tmp_path / "fitted.toml", tmp_path / "fit.html"
    words = ["fit-low", "torino-rotary", "--scenario", str(scenario), "--json"]
    words += ["--set", "low.band_ratio=0.9", "--fault", "friction@transmission=0.25"]
    assert main([*words, "--out", str(out), "--report", str(report)]) == 0
    values = json.loads(capsys.readouterr().out)
    entry = elevon.Actuator.load(str(out)).parameters["low.band_ratio"]
    assert entry.value == pytest.approx(values["fitted"][0]["new"], rel=1e-3)
    assert entry.old == 0.9
    assert entry.source.startswith("fitted to the switching model over 2 cases")
    assert report.is_file()
    assert main([*words, "--out", str(out)]) == 2
    assert main(["fit-low", "torino-rotary", "--fault", "friction@transmission=0.25"]) == 2
