"""Runs that would take hours are refused before they start, with what they would take."""

import json
import random
import time
from dataclasses import replace

import pytest

import elevon
from elevon.cli import main
from elevon.errors import BudgetError, InputError
from elevon.simulate.batch import BUDGET, PILOT_STEPS, SLOWEST_STEP, pilot_seconds
from elevon.simulate.prepare import changed, prepare

SLOW = 'name = "slow"\nbase = "torino-rotary"\n[low]\nstep = "2e-11 s"\n'


@pytest.fixture
def slow(tmp_path):
    path = tmp_path / "slow.toml"
    path.write_text(SLOW)
    return path


def test_a_step_that_would_take_days_is_refused_at_once(slow, capsys):
    """1.5e11 steps, legal in the actuator file, once started without a word."""
    begin = time.process_time()
    words = ["simulate", str(slow), "--fidelity", "low", "--duration", "3 s"]
    assert main([*words, "--json"]) == 2
    streams = capsys.readouterr()
    refused = json.loads(streams.out)
    assert (refused["status"], refused["option"]) == ("refused", "--budget")
    assert refused["estimate_s"] > BUDGET
    assert refused["bytes"] > 0
    assert "low.step" in streams.err
    assert main(words) == 2
    assert capsys.readouterr().out == ""
    assert time.process_time() - begin < 10.0


def test_an_answer_is_refused_as_well(slow, tmp_path, capsys):
    log = tmp_path / "log.csv"
    elevon.simulate("torino-rotary", duration=5.0, fidelity="low").save(log)
    assert main(["diagnose", str(log), "--actuator", str(slow), "--baseline", str(log)]) == 2
    assert "solver steps of 2e-11 s" in capsys.readouterr().err


def test_what_is_allowed_runs_and_what_is_not_is_refused():
    short = {"duration": 0.002, "fidelity": "low"}
    assert elevon.simulate("torino-rotary", **short, budget="2 min").status == "ok"
    with pytest.raises(BudgetError, match="budget=") as caught:
        elevon.simulate("torino-rotary", **short, budget=1e-9)
    assert caught.value.estimate_s > 1e-9
    runs = [elevon.Run("torino-rotary", {"duration": seconds}) for seconds in (0.001, 0.002)]
    with pytest.raises(BudgetError):
        elevon.simulate_batch(runs, fidelity="low", budget=1e-9)


@pytest.mark.parametrize("budget", [0, -1.0, "2 V", "soon", float("nan")])
def test_budgets_that_are_none(budget):
    with pytest.raises(InputError, match="budget"):
        elevon.simulate("torino-rotary", duration=0.002, fidelity="low", budget=budget)


@pytest.mark.parametrize(
    "count", [6, pytest.param(50, marks=pytest.mark.long)], ids=["short", "whole"]
)
def test_the_estimate_is_within_a_factor_of_two(count):
    """Drawn actuators, fidelities, steps, faults: the pilot's time against that of the run."""
    draw = random.Random(50)
    missed = []
    for number in range(count):
        name = draw.choice(["torino-rotary", "nasa-ballscrew", "pisa-landing-gear"])
        fidelity = draw.choice(["high", "low"])
        actuator = elevon.Actuator.load(name)
        low = fidelity == "low" and "low.step" in actuator.parameters
        path = "low.step" if low else "solver.step"
        step = actuator.parameters.value(path) * draw.choice([1.0, 0.5, 0.2])
        kinds = [[], ["short@motor.phase_a=10 %"], ["friction@transmission=0.5"]]
        faults = draw.choice(kinds[:1] if name == "pisa-landing-gear" else kinds)
        run = elevon.Run(actuator.with_values({path: step}), None, number)
        run = replace(run, scenario=changed(run.scenario, step * 6 * PILOT_STEPS, faults))
        ready = prepare(run, fidelity, None)
        expected = 6 * PILOT_STEPS * pilot_seconds(ready, fidelity)
        begin = time.process_time()
        elevon.simulate(run.actuator, run.scenario, fidelity=fidelity, seed=number)
        took = time.process_time() - begin
        assert took / (6 * PILOT_STEPS) < SLOWEST_STEP
        if not 0.5 < took / expected < 2.0:
            missed.append((name, fidelity, step, faults, took / expected))
    assert missed == []
