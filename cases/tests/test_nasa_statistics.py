"""Statistics of the ballscrew's experiments: intervals, winners, known effects, population."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import elevon
from elevon.errors import Interrupted, OutputExistsError
from elevon_cases.nasa.baseline_rows import (
    TwoLevelFactor,
    coverage,
    fit_effects,
    model_matrix,
    shuffled_blocks,
)
from elevon_cases.nasa.features import FEATURES, GAP, compared
from elevon_cases.nasa.population import SPREADS, CellStore, draw_units
from elevon_cases.nasa.separation import FAULTS, reproduce_separation
from elevon_cases.nasa.separation_rows import (
    POWER,
    Effect,
    EffectScale,
    compare_profiles,
    null_p,
)

FACTORS = (TwoLevelFactor("load", "low", "high"), TwoLevelFactor("rate", "slow", "fast"))


def binomial(share: float, count: int) -> float:
    """Four deviations of a share."""
    return 4.0 * float(np.sqrt(share * (1.0 - share) / count))


@pytest.mark.parametrize("truth", [0.0, 3.0, 40.0])
def test_intervals_hold_the_true_effect_at_their_level(truth: float) -> None:
    """Normal groups of 40 and 12, the faulty one twice as wide: 90 % of the intervals hold."""
    rng = np.random.default_rng(1)
    scale = EffectScale(40, 12, 0.9, pivots=10_000)
    found = [
        scale.effect(rng.normal(5.0, 0.2, 40), rng.normal(5.0 + 0.2 * truth, 0.4, 12))
        for _ in range(400)
    ]
    coverage = np.mean([e.low <= truth <= e.high for e in found])
    assert abs(coverage - 0.9) < binomial(0.9, 400)
    assert np.mean([e.size for e in found]) == pytest.approx(truth, rel=0.03, abs=0.1)


def test_a_feature_that_does_not_vary_has_no_effect() -> None:
    """No scale, no number; nothing is shown."""
    effect = EffectScale(8, 4, 0.9).effect(np.ones(8), np.full(4, 2.0))
    assert np.isnan(effect.size)
    assert not effect.significant


def test_a_winner_needs_an_interval_above_all_others() -> None:
    """Overlap names none and says how many draws; a fault that is not shown has no winner."""
    clear = compare_profiles([Effect(10, 8, 12), Effect(-20, -23, -17), Effect(1, -1, 3)], 0.95)
    assert clear.winner == 1
    assert clear.power > 0.5
    near = compare_profiles([Effect(10, 8, 12), Effect(11, 9, 13)], 0.95)
    assert near.winner is None
    assert near.power < 0.5
    # Halves of 2 and 2 and the 95 % quantile of their spread, against a gap of 1.
    spread = np.hypot(2.0, 2.0) / 1.95996
    assert near.factor == pytest.approx((4.0 + 1.64485 * spread) ** 2, rel=1e-4)
    assert compare_profiles([Effect(0.5, -1, 2), Effect(0.1, -0.1, 0.3)], 0.95).winner is None


def test_a_winner_is_one_that_another_experiment_would_name() -> None:
    """Intervals that part by less than the spread of their ends name none: a new draw may differ.

    Halves of 2 and 2 at 95 %, spread 1.443: a gap of 4.1 parts them, one of 6.4 has 95.2 % power.
    """
    for gap, winner in ((4.1, None), (6.3, None), (6.4, 1)):
        best = compare_profiles([Effect(10, 8, 12), Effect(10 + gap, 8 + gap, 12 + gap)], 0.95)
        assert best.winner == winner
        assert (best.power >= POWER) == (winner is not None)
        assert (best.factor <= 1.0) == (winner is not None)


def test_healthy_against_healthy_passes_the_threshold_as_rarely_as_stated() -> None:
    """Rayleigh amplitudes in their root's scale, groups as of the command: at most 1 % below 0.01.

    A fault of a deviation and a half is not missed for it.
    """
    rng = np.random.default_rng(2)
    raw = np.zeros((2000, 240, len(FEATURES)))
    raw[..., 1] = rng.rayleigh(size=(2000, 240))
    scaled = np.moveaxis(compared(raw)[..., 1], 0, 1)
    above = np.mean(null_p(scaled[16:], scaled[:16]) < 0.01)
    assert above < 0.01 + binomial(0.01, 2000)
    moved = scaled[:16] + 1.5 * np.std(scaled[16:], axis=0)
    assert np.mean(null_p(scaled[16:], moved) < 0.01) > 0.95


def test_a_small_group_that_misses_the_tail_passes_the_threshold_no_more_often() -> None:
    """One unit in eight far off, as of a joint that opens in some units only."""
    rng = np.random.default_rng(3)
    values = rng.normal(0.0, 0.2, (240, 4000)) + 5.0 * (rng.random((240, 4000)) < 0.125)
    assert np.mean(null_p(values[16:], values[:16]) < 2e-4) < 2e-4 + binomial(2e-4, 4000)


def test_known_effects_are_recovered_with_their_coverage() -> None:
    """Two factors, their product, four blocks: 95 % hold; exact without scatter."""
    levels = np.array([[a, b] for a in (-1.0, 1.0) for b in (-1.0, 1.0) for _ in range(4)])
    block = np.tile(np.arange(4), 4)
    truth = {"effects": [3.0, -1.0, 0.5], "block": 2.0, "scatter": 0.3}
    share, bias = coverage(FACTORS, levels, block, truth, campaigns=500)
    assert 0.85 <= share <= 0.97
    assert bias < 4.0 / np.sqrt(500)
    exact = model_matrix(FACTORS, levels, block) @ np.array([1.0, 2.0, 3.0, 4.0, 1.5, -0.5, 0.25])
    found = fit_effects(FACTORS, levels, block, exact)
    assert [e.term for e in found] == ["load", "rate", "load x rate"]
    assert [e.effect for e in found] == pytest.approx([3.0, -1.0, 0.5])


def test_every_block_has_an_order_of_its_own() -> None:
    """Permutations, different from block to block, the same for the same seed."""
    orders = shuffled_blocks(20, 3, seed=4)
    assert all(sorted(order) == list(range(20)) for order in orders.tolist())
    assert len({tuple(order) for order in orders.tolist()}) == 3
    assert np.array_equal(orders, shuffled_blocks(20, 3, seed=4))


def test_healthy_units_differ_as_stated() -> None:
    """Dry friction by 10 %, both parts together; other groups are other units; all are valid."""
    nominal = elevon.Actuator.load("nasa-ballscrew")
    units = draw_units(nominal, "healthy", 200, seed=0)
    static = np.array([u.parameters.value("friction.static") for u in units]) / 0.45
    dynamic = np.array([u.parameters.value("friction.dynamic") for u in units]) / 0.3
    assert np.allclose(static, dynamic)
    assert np.std(static) == pytest.approx(0.1, rel=0.2)
    eta = np.array([u.parameters.value("screw.efficiency") for u in units])
    assert 0.88 < eta.min() < 0.9 < eta.max() < 0.92
    paths = {path for spread in SPREADS for path in spread.paths}
    again = draw_units(nominal, "healthy", 2, seed=0)
    other = draw_units(nominal, "other", 2, seed=0)
    for path in paths:
        assert again[1].parameters.value(path) == units[1].parameters.value(path)
        assert other[1].parameters.value(path) != units[1].parameters.value(path)


def test_finished_cells_are_found_again_by_the_same_work_only(tmp_path: Path) -> None:
    """Written at once; another key sees nothing; a damaged file is named."""
    CellStore(tmp_path, "a").put("cell", np.array([[1.0, 2.5]]))
    found = CellStore(tmp_path, "a").get("cell")
    assert found is not None
    assert found.tolist() == [[1.0, 2.5]]
    assert CellStore(tmp_path, "b").get("cell") is None
    (tmp_path / "runs.json").write_text("{")
    with pytest.raises(OutputExistsError, match=r"runs\.json"):
        CellStore(tmp_path, "a")


@pytest.mark.long
def test_winners_agree_over_five_seeds() -> None:
    """The gap under load, every profile: other units, other noise, the same best profile."""
    results = [
        reproduce_separation(
            faults=FAULTS[-1:], loads=(4500.0,), healthy=48, reassemblies=6, seed=seed
        )
        for seed in range(5)
    ]
    assert [result.winners() for result in results] == [{(GAP, 4500.0): "trapezoidal"}] * 5
    assert all(row.power >= POWER for result in results for row in result.rows)
    halves = [row.half.size / row.effect.size for r in results for row in r.rows if row.half]
    assert len(halves) == 30
    assert max(map(abs, halves)) < 1.0


@pytest.mark.long
def test_the_gap_shows_in_the_trapezoid_under_load(tmp_path: Path) -> None:
    """One fault, two profiles, one load: winner, half below whole, going on after a stop."""

    def stop(fraction: float) -> bool:
        return fraction < 0.6

    arguments = {"faults": FAULTS[-1:], "shapes": ("trapezoidal", "sinusoidal"),
                 "loads": (4500.0,), "reassemblies": 8, "healthy": 24}  # fmt: skip
    with pytest.raises(Interrupted):
        reproduce_separation(folder=tmp_path, progress=stop, **arguments)  # type: ignore[arg-type]
    result = reproduce_separation(folder=tmp_path, **arguments)  # type: ignore[arg-type]
    rows = result.to_dict()["rows"]
    assert [(row["profile"], row["winner"]) for row in rows] == [
        ("trapezoidal", True), ("sinusoidal", False),
    ]  # fmt: skip
    assert all(abs(row["half_severity"]) < abs(row["effect_size"]) for row in rows)
    assert result.to_dict() == reproduce_separation(**arguments).to_dict()  # type: ignore[arg-type]


def test_healthy_pairs_are_held_to_their_own_level_and_tables_to_the_familys():
    """Of 200 comparisons a table, 5 % of tables: 0.025 % of pairs; ten times that is a fault."""
    from elevon_cases.nasa.separation import null_checks

    level = 1.0 - 0.05 / 200.0
    assert all(check.passed for check in null_checks(2.5e-4, 0.05, level))
    pairs, tables = null_checks(2.5e-3, 0.05, level)
    assert (pairs.passed, tables.passed) == (False, True)
    assert not null_checks(2.5e-4, 0.10, level)[1].passed
