"""The benchmark set: what it promises of its parts, and what its scores mean."""

import json

import numpy as np
import pytest

from elevon import InputError
from elevon.campaign.verify import verify
from elevon.report import all_passed
from studies.benchmark_set import make_benchmark, score_benchmark
from studies.benchmark_set.make import ACTUATORS, _resolved, plan_text
from studies.benchmark_set.score import _auc, _interval, _resampled


@pytest.mark.parametrize("name", ACTUATORS)
def test_parts_are_dealt_by_unit_and_both_benches_have_the_same_faults(name):
    first = _resolved(plan_text(name, 20, 5, 3), name)
    other = _resolved(plan_text(name, 7, 5, 8, shifted=True), name)
    parts = {u: set(first.index.split[first.index.unit == u]) for u in np.unique(first.index.unit)}
    assert all(len(part) == 1 for part in parts.values())
    counts = [sum(part == {name} for part in parts.values()) for name in ("train", "test")]
    assert counts == [10, 6]
    assert set(other.index.split) == {"shifted"}
    assert first.fault_names() == other.fault_names()
    assert first.actuator.hash != other.actuator.hash
    drawn = np.column_stack([c.values for c in first.columns if c.kind == "fault"])
    healthy = (drawn == 0.0).all(axis=1)
    assert 0.1 < healthy.mean() < 0.8
    assert (drawn.max(axis=0) > 0.0).all()
    again = _resolved(plan_text(name, 20, 5, 3), name)
    assert all(
        np.array_equal(a.values, b.values)
        for a, b in zip(first.columns, again.columns, strict=True)
    )


def test_the_area_counts_pairs_and_its_interval_draws_units():
    generator = np.random.default_rng(4)
    present = generator.random(60) < 0.4
    chance = np.round(present + generator.normal(0.0, 1.0, 60), 1)
    pairs = chance[present][:, None] - chance[~present][None, :]
    assert _auc(present, chance) == pytest.approx(np.mean((pairs > 0) + 0.5 * (pairs == 0)))
    assert _auc(np.ones(5, dtype=bool), np.arange(5.0)) is None
    draws = _resampled(np.repeat(np.arange(6), 10), generator)
    assert all(len(rows) == 60 for rows in draws)
    low, high = _interval(_auc, (present, chance), draws)
    assert low < _auc(present, chance) < high


def test_too_few_runs_and_another_set_are_refused(tmp_path):
    with pytest.raises(InputError, match="at least 240"):
        make_benchmark(tmp_path / "set", runs=50)
    (tmp_path / "benchmark.json").write_text(json.dumps({"version": "1.0", "seed": 5}))
    with pytest.raises(InputError, match="seed = 5, not 0"):
        make_benchmark(tmp_path)


@pytest.mark.long
def test_the_whole_set_is_made_scored_and_verified(tmp_path):
    made = make_benchmark(tmp_path / "set", runs=240)
    assert not made.failed
    scores = score_benchmark(tmp_path / "set")
    assert {row.part for row in scores} == {"validation", "test", "shifted"}
    assert {row.actuator for row in scores} == set(ACTUATORS)
    for name in ACTUATORS:
        assert all_passed(verify(tmp_path / "set" / name))
    assert score_benchmark(tmp_path / "set") == scores
    other = make_benchmark(tmp_path / "other", runs=240)
    hashes = [[c["data_hash"] for c in m.about["campaigns"]] for m in (made, other)]
    assert hashes[0] == hashes[1]
