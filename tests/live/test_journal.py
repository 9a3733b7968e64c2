"""What was done to a bench is done again: by its steps to the bit, by its scenario file too."""

import numpy as np
import pytest

import elevon
from elevon import Actuator, Scenario
from elevon.errors import InputError
from elevon.live.bench import LiveBench
from elevon.live.unit import LiveUnit

SEED, END = 3, 0.4  # s
SIGNALS = ("output_position", "motor_speed")
SINE = {"kind": "sine", "amplitude": "6 deg", "bias": "10 deg", "frequency": "2 Hz"}
#: Command, then load, fault, another load, another severity; each at its instant.
ROTARY = (
    (0.05, {"command": {"terms": [SINE]}}),
    (0.1, {"set": {"output": "5 N m"}}),
    (0.15, {"fault": {"backlash@transmission": "0.5 deg"}}),
    (0.2, {"set": {"output": "-7 N m", "ambient": "40 degC"}}),
    (0.3, {"fault": {"backlash@transmission": "0.3 deg"}}),
)
GEAR = (
    (0.05, {"command": {"mode": "gear", "steps": [{"time": 0.1, "action": "extend"}]}}),
    (0.1, {"set": {"output": "500 N"}}),
    (0.2, {"set": {"output": "-300 N"}, "fault": {"friction_growth@screw": "100 N"}}),
    (0.3, {"fault": {"friction_growth@screw": "50 N"}}),
)


def _bench(name, **options):
    return LiveBench(LiveUnit(Actuator.load(name), fidelity="low", seed=SEED), **options)


def _run(bench, acts=()):
    """Samples of a run from now on, shape (n, signals)."""
    due, begin, rows = list(acts), bench.unit.time, []
    while bench.unit.time < begin + END - 1e-6:
        while due and due[0][0] <= bench.unit.time - begin + 1e-6:
            bench.act(due.pop(0)[1])
        bench.loop.sample()
        rows.append(bench.loop.ring.latest())
    return np.asarray(rows)


@pytest.mark.parametrize(("name", "acts"), [("torino-rotary", ROTARY), ("pisa-landing-gear", GEAR)])
def test_steps_are_done_again_to_the_bit(name, acts):
    bench = _bench(name)
    first = _run(bench, acts)
    steps = bench.act({"save": True})["steps"]
    assert len(steps) == len(acts) + 1
    other = _bench(name)
    other.act({"fault": {next(iter(acts[-1][1]["fault"])): 1e-3}})
    _run(other)
    other.act({"repeat": steps})
    np.testing.assert_array_equal(_run(other), first)
    assert other.script.to_dict() == {"left": 0, "error": ""}
    assert other.act({"save": True})["steps"] == steps


@pytest.mark.parametrize(("name", "acts"), [("torino-rotary", ROTARY), ("pisa-landing-gear", GEAR)])
def test_a_scenario_gives_the_run_to_the_bit(name, acts, tmp_path):
    bench = _bench(name)
    first = _run(bench, acts)
    path = tmp_path / "done.toml"
    path.write_text(bench.act({"save": True})["scenario"])
    rate = f"{1.0 / bench.unit.period!r} Hz"
    again = elevon.simulate(
        name, Scenario.load(path), fidelity="low", seed=SEED, record=f"{','.join(SIGNALS)}@{rate}"
    )
    for signal in SIGNALS:
        values = again[signal].values[1:]
        assert len(values) == len(first)
        np.testing.assert_array_equal(values, first[:, bench.unit.names.index(signal)])


def test_what_stood_before_a_restart_is_in_the_scenario(tmp_path):
    bench = _bench("torino-rotary")
    bench.act(
        {
            "set": {"output": "4 N m", "supply": "250 V"},
            "fault": {"friction@transmission": 0.5, "backlash@transmission": "0.2 deg"},
        }
    )
    bench.act({"restart": True})
    path = tmp_path / "done.toml"
    path.write_text(bench.act({"save": True})["scenario"])
    scenario = Scenario.load(path)
    assert {fault.kind for fault in scenario.fault} == {"friction", "backlash"}
    assert scenario.loads.output.terms[0].arguments["final"] == "4.0 N m"
    assert scenario.supply.terms[0].arguments["final"] == "250.0 V"


@pytest.mark.parametrize(
    ("steps", "part"),
    [
        ({}, "list"),
        ([{"time": "1 s"}], "rise"),
        ([{"time": 1.0}, {"time": 0.5}], "rise"),
        ([{"time": 0.0, "comand": {}}], "command"),
        ([{"time": 0.0, "repeat": []}], "repeat"),
        ([{"time": 0.0, "mode": "speeed"}], "speed"),
    ],
)
def test_steps_that_cannot_be_are_refused(steps, part):
    with pytest.raises(InputError, match=part):
        _bench("torino-rotary").act({"repeat": steps})


def test_a_step_that_is_refused_ends_the_repetition():
    bench = _bench("torino-rotary")
    bench.act({"repeat": [{"time": 0.01, "fault": {"backlsh@transmission": 1}}, {"time": 0.02}]})
    _run(bench)
    assert bench.script.to_dict()["left"] == 0
    assert "backlash" in bench.script.error


def test_hidden_faults_are_told_by_no_save():
    bench = _bench("torino-rotary", hide_truth=True)
    bench.act({"fault": {"backlash@transmission": "0.5 deg"}})
    assert bench.state()["injected"] is None
    with pytest.raises(InputError, match="hidden"):
        bench.act({"save": True})
