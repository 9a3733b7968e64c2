"""Training of the surrogate's trees, their calibration, and how they are judged."""

from dataclasses import replace

import numpy as np
import pytest

from elevon.diagnose.learning.trees import Trees
from elevon.diagnose.surrogate import shipped
from elevon.diagnose.surrogate.boosted import (
    Batch,
    Ensemble,
    Opinion,
    _nodes,
    either,
    honest,
    trained,
)
from elevon.diagnose.surrogate.features import NAMES
from elevon.diagnose.surrogate.fit import TrainingPlan, fitted
from elevon.diagnose.surrogate.judge import judged, judged_at
from elevon.diagnose.surrogate.population import FAULTS, drawn_faults, learned
from elevon.diagnose.surrogate.sampling import Rows, sizes
from elevon.diagnose.surrogate.table import SINGLE_FAULTS, TrainingTable

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")


def test_training_learns_a_linear_law():
    """Input = size + noise of deviation 0.2; a second fault is never there, a third always."""

    def draw(rng, n=128):
        there = np.array([0.5, 0.0, 1.0]) > rng.random((n, 3))
        size = np.where(there, rng.standard_normal((n, 3)), 0.0)
        return Batch(size + 0.2 * rng.standard_normal((n, 3)), size)

    ensemble = trained(draw, draws=30, rounds=40, seed=0)
    fresh = draw(np.random.default_rng(9), 4000)
    opinion = ensemble.says(fresh.inputs)
    there = fresh.size[:, 0] != 0.0
    error = (fresh.size - opinion.size)[there, 0]
    assert np.std(error) == pytest.approx(0.2 / np.sqrt(1.04), rel=0.2)
    large = np.abs(fresh.inputs[:, 0]) > 1.0
    assert (opinion.presence[large, 0] > 1.0).all()
    assert np.median(opinion.presence[np.abs(fresh.inputs[:, 0]) < 0.1, 0]) < -1.0
    assert opinion.presence[:, 1].max() < -5.0 < 5.0 < opinion.presence[:, 2].min()
    both = Ensemble.of([ensemble, trained(draw, draws=5, rounds=40, seed=1)])
    np.testing.assert_allclose(both.says(fresh.inputs).each[0], opinion.each[0])


def test_calibrated_logits():
    logit = np.array([[-3.0, 0.0, 2.0]])
    same = np.tile([1.0, 1.0, 0.0], (3, 1))
    np.testing.assert_allclose(honest(same, logit), logit)
    steeper = honest(np.tile([1.0, 2.0, 0.0], (3, 1)), logit)
    assert steeper[0, 2] > 2.0 * logit[0, 2]
    present = 1.0 / (1.0 + np.exp(-logit))
    none = np.prod(1.0 - present)
    assert either(logit)[0] == pytest.approx(np.log((1.0 - none) / none))


def _table(units, rng, unlike=0.1):
    """Units of known law: each fault moves a feature of its own; units and days scatter."""
    severity, values, unit, baseline = [], [], [], []
    for u in range(units):
        centre = 1.0 + unlike * rng.standard_normal(len(NAMES))
        for k in range(10):
            faults = {} if k < 3 else drawn_faults(rng, learned())
            row = np.array([faults.get(key, 0.0) for key in FAULTS])
            shift = np.zeros(len(NAMES))
            shift[: len(FAULTS)] = sizes(row)
            severity.append(row)
            values.append(centre + shift + 0.02 * rng.standard_normal(len(NAMES)))
            unit.append(u)
            baseline.append(k < 3)
    about = np.ones((len(unit), 2))
    return TrainingTable(*map(np.array, (unit, baseline, severity, values)), about)


def test_calibration_holds_on_units_never_seen():
    rng = np.random.default_rng(3)
    tables = {"backlash": _table(40, rng)}
    plan = TrainingPlan(folds=2, rounds=10, draws=20)
    result = fitted(tables, {}, plan, {})
    scores = judged(result, {"backlash": _table(40, rng)})["backlash.relative"]
    assert scores["covered"] / scores["severities"] > 0.82
    assert scores["false_alarms"] / scores["healthy"] < 0.12
    assert scores["brier"] < 0.7 * scores["brier_by_rate"]


@pytest.mark.long
def test_units_are_judged_at_the_severities_asked():
    rng = np.random.default_rng(5)
    tables, plan = {"loaded": _table(40, rng, 0.0)}, TrainingPlan(folds=2, rounds=60, draws=60)
    drawn = _table(20, rng, 0.0)
    surrogate = fitted(tables, {}, plan, {})
    severity = np.zeros((100, len(FAULTS)))
    for row, (key, size) in enumerate(list(SINGLE_FAULTS["loaded"].items()) * 20):
        severity[row, FAULTS.index(key)] = size
    unit = np.arange(100) // 5
    values = 1.0 + 0.02 * rng.standard_normal((100, len(NAMES)))
    values[:, : len(FAULTS)] += sizes(severity)
    singles = TrainingTable(unit, np.zeros(100, dtype=bool), severity, values, np.ones((100, 2)))
    opinion = judged_at(surrogate, {"loaded": drawn}, {"loaded": singles})
    assert list(opinion) == [f"loaded.{key}" for key in SINGLE_FAULTS["loaded"]]
    *large, small = opinion.values()  # the gain's size is 0.18, the others' 0.28 and more
    for fault in opinion.values():
        assert fault["runs"] == 20
        assert fault["isolated"] <= min(fault["alarms"], fault["first"])
        assert fault["covered"] >= 15
    for fault in large:
        assert fault["first"] >= 18
        assert fault["median_error"] < small["median_error"]


def test_a_chance_is_a_rank_among_runs_that_the_members_have_not_seen():
    """Two members, the second with logits 10 higher for anything: each has its own healthy runs."""
    values = np.array([-9.0, -2.2, 3.0])
    low, high = np.arange(-4.0, 0.0), np.arange(-4.5, 0.0)
    head = replace(
        shipped().tests["backlash"].heads["relative"],
        scaling=np.tile([1.0, 1.0, 0.0], (2, 1)), healthy=np.concatenate((low, high + 10.0)),
        fold=np.repeat([0.0, 1.0], [len(low), len(high)]),
    )  # fmt: skip
    each = np.stack([values, values + 10.0])[:, :, None]
    opinion = Opinion(each.mean(axis=0), np.zeros((3, 1)), each)
    expected = [(np.sum(np.concatenate((low, high)) >= v) + 1.0) / 10.0 for v in values]
    np.testing.assert_allclose(head.chances(opinion), expected)


@pytest.mark.parametrize("kind", ["Classifier", "Regressor"])
def test_trees_by_histograms_say_what_the_library_says(kind):
    library = pytest.importorskip("sklearn.ensemble")
    rng = np.random.default_rng(2)
    values = rng.standard_normal((300, 4)).astype(np.float32).astype(float)
    truth = values[:, 0] + rng.normal(0.0, 0.3, 300)
    model = getattr(library, f"HistGradientBoosting{kind}")(max_iter=8, max_leaf_nodes=6)
    model.fit(values, truth > 0.0 if kind == "Classifier" else truth)
    nodes, start = _nodes(model)
    trees = Trees.stored(Trees.of_histograms([nodes, nodes[:2]]).arrays())
    says = (model.decision_function if kind == "Classifier" else model.predict)(values)
    np.testing.assert_allclose(start + trees.scores(values)[:, 0], says, atol=1e-5)


def test_references_are_other_days_of_the_same_unit():
    rows = Rows.of(_table(3, np.random.default_rng(4)))
    for row, near in enumerate(rows.others):
        known = near[near >= 0]
        assert row not in known
        assert (rows.table.unit[known] == rows.table.unit[row]).all()
        assert rows.table.baseline[known].all()
