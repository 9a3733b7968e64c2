"""Population searches, and the misfit they make small."""

import json

import numpy as np
import pytest

from elevon import Actuator
from elevon.bench.procedure import load_procedure
from elevon.bench.rig import setups
from elevon.bench.traces import first_trace, recorded, traced
from elevon.errors import UnknownNameError
from elevon.scenario.compile import signal_records
from elevon.simulate import Run, simulate_batch
from elevon.worklog import finished
from studies import main
from studies.optimisers import CAUSES, METHODS, MonitoringModel, search
from studies.optimisers.cost import limits
from studies.optimisers.study import SearchOutcome

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
FRICTION, BACKLASH, SHORT, ROUND, GAIN = CAUSES


@pytest.mark.parametrize("method", METHODS)
def test_a_search_finds_the_bottom_of_a_bowl(method):
    bottom = np.array([0.3, 0.7, 0.5])
    calls = []

    def costs(x):
        calls.append(len(x))
        return np.sum((x - bottom) ** 2, axis=1)

    best = search(method, costs, 3, budget=2000, seed=1)
    np.testing.assert_allclose(best.vector, bottom, atol=0.03)
    assert best.cost == pytest.approx(float(np.sum((best.vector - bottom) ** 2)))
    assert sum(calls) <= 2040
    again = search(method, costs, 3, budget=2000, seed=1)
    np.testing.assert_array_equal(best.vector, again.vector)


def test_no_such_search():
    with pytest.raises(UnknownNameError):
        search("gentic", lambda x: x[:, 0], 2, budget=40, seed=0)


@pytest.fixture(scope="module")
def monitor():
    unit = Actuator.load("torino-rotary").with_values({"drive.kind": "pwm"})
    faults = ["friction@transmission=0.5", "short@motor.phase_b=0.3"]
    setup = setups(first_trace(load_procedure("backlash")), unit, faults=faults, seed=4)[0]
    record = recorded(list(signal_records(unit.wiring, "low")))
    run = Run(setup.actuator, setup.scenario, setup.conditions.seed)
    recording = simulate_batch([run], fidelity="low", record=record)[0]
    return MonitoringModel(setup, traced(setup, recording))


def _vector(**values):
    """Friction, backlash, three phases, eccentricity and its phase, gain: 0 to 1 over the range."""
    low, high = limits()[GAIN]
    start = {"friction": 0.0, "short_b": 0.0, "gain": -low / (high - low)} | values
    return np.array([start["friction"], 0.0, 0.0, start["short_b"], 0.0, 0.0, 0.0, start["gain"]])


def test_the_misfit_is_least_at_the_truth(monitor):
    truth = _vector(friction=0.25, short_b=0.5)
    others = [_vector(), _vector(friction=0.25), _vector(short_b=0.5), truth + 0.05]
    before = monitor.evaluations
    cost = monitor.costs(np.array([truth, *others]))
    assert monitor.evaluations == before + 5
    assert cost[0] < 1e-4
    assert (cost[1:] > 20 * cost[0]).all()
    assert monitor.severities(truth) == pytest.approx(
        {FRICTION: 0.5, BACKLASH: 0.0, SHORT: 0.3, ROUND: 0.0, GAIN: 0.0}, abs=1e-12
    )


def test_an_outcome_survives_its_file():
    for reached in (1.5, float("nan")):
        one = SearchOutcome("backlash", "genetic", 0.1, 2000, 1.4, reached)
        again = SearchOutcome.from_dict(json.loads(json.dumps(one.to_dict(), allow_nan=False)))
        assert again.to_dict() == one.to_dict()


def test_finished_work_is_known_again_by_its_name(tmp_path):
    with finished(None, "work") as log:
        assert log is None
    for name, known in (("work 1", []), ("work 1", ["a"]), ("work 2", [])):
        with finished(tmp_path, name) as log:
            assert list(log.items) == known
            log.note("a", [], rows=[1.0])


@pytest.mark.long
def test_the_table(capsys, tmp_path):
    arguments = ("diagnosis-optimisers", "--seeds", "2", "--budget", "400",
             "--runs", str(tmp_path), "--json")  # fmt: skip
    main(arguments)
    out = capsys.readouterr().out
    document = json.loads(out)
    assert {row["method"] for row in document["rows"]} >= set(METHODS)
    assert all({"name", "value", "limit", "unit", "passed"} <= set(c) for c in document["checks"])
    main(arguments)
    assert capsys.readouterr().out == out  # seconds and all: from the finished logs
