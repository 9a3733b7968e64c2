"""The comparison of the two fidelities: its filter, its numbers, its refusals."""

import json

import numpy as np
import pytest

import elevon
from elevon.cli import main
from elevon.compare import RATES, compare, compared_rate, filtered
from elevon.errors import InputError
from elevon.record_plan import period_of
from elevon.simulate import solver_step
from elevon.units import parse_quantity

SHORT = {
    "duration": "3 s",
    "command": {"terms": [{"kind": "sine", "amplitude": "3 deg", "frequency": "0.5 Hz"}]},
    "load": {"brake": {"terms": [{"kind": "constant", "value": "1 N m"}]}},
}


@pytest.fixture(scope="module")
def short():
    actuator = elevon.Actuator.load("torino-rotary")
    return compare(actuator, elevon.Scenario.from_dict(SHORT), start=1.0)


def test_the_low_model_follows(short):
    assert 0.0 < short.position_nrmse < 0.02
    assert 0.0 < short.speed_nrmse < 0.2
    assert 0.0 < short.q_current_nrmse < 0.2
    assert short.speed_up > 10.0


def test_numbers_are_what_their_names_say(short):
    values = short.to_dict()
    error = short.low["current_q"] - short.high["current_q"]
    rms = np.sqrt(np.mean(short.high["current_q"] ** 2))
    assert values["q_current_nrmse"] == pytest.approx(np.sqrt(np.mean(error**2)) / rms)
    assert values["amplitude_rad"] == pytest.approx(np.radians(3.0), rel=0.05)


def test_the_filter_passes_the_slow_stops_the_fast_and_delays_nothing():
    time = np.arange(0.0, 20.0, 1e-3)
    for hertz, gain in ((0.2, 1.0), (10.0, 0.5), (400.0, 0.0)):
        wave = np.sin(2 * np.pi * hertz * time)
        recording = elevon.Recording.build(time, {"x": wave}, {"x": "A"})
        middle = time[(time > 5) & (time < 15)]
        smooth = filtered(recording, "x", middle, 10.0)
        expected = gain * np.sin(2 * np.pi * hertz * middle)
        assert np.abs(smooth - expected).max() < 0.01


@pytest.mark.parametrize("seconds", [None, 1e-6, 3e-6, 7e-6, 1.1e-5])
def test_both_are_recorded_at_whole_steps_no_slower_than_asked(seconds):
    for name in ("torino-rotary", "nasa-ballscrew", "pisa-landing-gear"):
        actuator = elevon.Actuator.load(name)
        actuator = actuator.with_values({"solver.step": seconds} if seconds else {})
        for fidelity, rate in RATES.items():
            step, wanted = solver_step(actuator, fidelity), parse_quantity(rate, "Hz", "rate")
            steps = period_of(compared_rate(actuator, fidelity), step)
            assert steps == 1 or 1.0 / (steps * step) >= 0.999999 * wanted
            assert 1.0 / ((steps + 1) * step) < wanted


def test_refusals():
    actuator = elevon.Actuator.load("torino-rotary")
    scenario = elevon.Scenario.from_dict(SHORT)
    with pytest.raises(InputError, match="lasts 3 s"):
        compare(actuator, scenario)
    with pytest.raises(InputError, match="nothing moves"):
        compare(actuator, elevon.Scenario.from_dict({"duration": "0.2 s"}), start=0.05, cutoff=50.0)


def test_command(tmp_path, capsys):
    scenario = tmp_path / "short.toml"
    scenario.write_text(
        'duration = "3 s"\n[[command.terms]]\nkind = "sine"\namplitude = "3 deg"\n'
        'frequency = "0.5 Hz"\n'
    )
    words = ["compare", "torino-rotary", "--scenario", str(scenario), "--after", "1", "--json"]
    assert main([*words, "--fault", "friction@transmission=0.5", "--out", str(tmp_path)]) == 0
    values = json.loads(capsys.readouterr().out)
    assert {"position_nrmse", "speed_nrmse", "q_current_nrmse", "speed_up"} <= values.keys()
    assert values["faults"] == ["friction@transmission=0.5"]
    assert (tmp_path / "report.html").is_file()
    assert main([*words, "--fault", "frition@transmission=0.5"]) == 2
    assert "friction" in capsys.readouterr().err


@pytest.mark.long
def test_default_scenario_keeps_the_promised_limits():
    found = compare(elevon.Actuator.load("torino-rotary"))
    assert found.position_nrmse <= 0.005
    assert found.q_current_nrmse <= 0.05


def test_every_line_of_the_catalogue_is_in_the_default_table():
    from elevon.fault_sensitivity import ROTARY_FAULTS
    from elevon.faults import Fault, catalogue, find_record

    faults = [Fault.parse(text) for text in ROTARY_FAULTS]
    records = [find_record(fault.kind, fault.place, "rotary") for fault in faults]
    assert {(record.kind, record.places) for record in records} == {
        (record.kind, record.places) for record in catalogue("rotary")
    }


def test_the_default_table_leaves_out_what_changes_nothing():
    from elevon.fault_sensitivity import ROTARY_FAULTS, _default

    chosen = _default(elevon.Actuator.load("torino-rotary"), None)
    assert set(ROTARY_FAULTS) - set(chosen) == {"connector_open@supply=1"}


def test_every_shipped_actuator_says_what_it_is_compared_on():
    from elevon.compare import compared_signals, default_scenario, default_start, load_size
    from elevon.parameters.load import set_names

    for name in set_names():
        actuator = elevon.Actuator.load(name)
        scenario = default_scenario(actuator)
        assert default_start(actuator, scenario, default=True) < scenario.seconds
        assert load_size(actuator) > 0.0
        signals = compared_signals(actuator.wiring)
        assert list(signals) == ["position", "speed", "q_current"]


def test_a_set_of_ones_own_is_compared_on_its_own_scenario():
    from dataclasses import replace

    from elevon.compare import default_scenario, default_start

    without = replace(elevon.Actuator.load("torino-rotary"), compare=None)
    scenario = default_scenario(without)
    assert scenario.seconds == 10.0
    assert default_start(without, scenario, default=True) == pytest.approx(10.0 / 3.0)
    assert default_start(without, scenario, default=False) == 10.0
    bare = replace(without, default_scenario=None)
    assert default_scenario(bare).text == "loaded campaign, 1 N m of brake"


def test_the_load_opposes_and_aids_motion_of_either_direction():
    from elevon.compare import compare_loads

    actuator = elevon.Actuator.load("torino-rotary")
    results = compare_loads(actuator, elevon.Scenario.from_dict(SHORT), load="60 N m", start=1.0)
    assert list(results) == ["as given", "opposing", "aiding"]
    power = {}
    for name, result in results.items():
        current, speed = result.low["current_q"], result.low["motor_speed"]
        power[name] = float(np.mean(current * speed))
    assert power["aiding"] < power["as given"] < power["opposing"]
    with pytest.raises(InputError, match="above 0"):
        compare_loads(actuator, elevon.Scenario.from_dict(SHORT), load="-60 N m", start=1.0)
