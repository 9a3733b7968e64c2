"""The stiffness estimator against truths that are known because they were put in."""

import numpy as np
import pytest

from elevon.errors import InputError
from elevon_cases.torino.compliance import (
    bootstrap_interval,
    deming_stiffness,
    fit_compliance,
    load_on_loss,
    loss_on_load,
)

LOADS = np.repeat(np.linspace(5.0, 50.0, 10), 4)
FIRST = np.tile([1, 0, 0, 0], 10)
WEIGHT = np.repeat(np.arange(10), 4)
TRUE = 110.0


def _loss(seed, scatter=0.05, weight_scatter=0.0):
    random = np.random.default_rng(seed)
    loss = LOADS / TRUE + 0.06 + 0.14 * FIRST + scatter * random.standard_normal(40)
    return loss + weight_scatter * random.standard_normal(10)[WEIGHT]


def test_exact_data_give_the_truth():
    fit = fit_compliance(LOADS, _loss(0, scatter=0.0), FIRST)
    assert fit.stiffness == pytest.approx(TRUE, rel=1e-9)
    assert fit.offset == pytest.approx(0.06, abs=1e-9)
    assert fit.group_offsets == pytest.approx([0.14], abs=1e-9)


def test_one_regression_is_unbiased_and_the_other_short_by_r_squared():
    losses = [_loss(seed, scatter=0.1) for seed in range(400)]
    right = np.mean([1.0 / loss_on_load(LOADS, loss) for loss in losses])
    assert 1.0 / right == pytest.approx(TRUE, rel=0.01)
    wrong = np.mean([load_on_loss(LOADS, loss) for loss in losses])
    r2 = np.mean([np.corrcoef(LOADS, loss)[0, 1] ** 2 for loss in losses])
    assert wrong < 0.8 * TRUE
    assert wrong == pytest.approx(TRUE * r2, rel=0.02)


def test_deming_lies_between_and_reaches_both_ends():
    loss = _loss(1, scatter=0.1)
    low, high = load_on_loss(LOADS, loss), loss_on_load(LOADS, loss)
    assert low < deming_stiffness(LOADS, loss, 5.0, 0.1) < high
    assert deming_stiffness(LOADS, loss, 1e-6, 0.1) == pytest.approx(high, rel=1e-6)
    assert deming_stiffness(LOADS, loss, 5.0, 1e-9) == pytest.approx(low, rel=1e-6)


def test_outliers_hardly_move_the_robust_fit():
    loss = _loss(2)
    clean = fit_compliance(LOADS, loss, FIRST).stiffness
    loss[27] += 0.5
    plain = fit_compliance(LOADS, loss, FIRST, robust=False).stiffness
    robust = fit_compliance(LOADS, loss, FIRST)
    assert abs(robust.stiffness - clean) < 0.4 * abs(plain - clean)
    assert robust.weights[27] == min(robust.weights)


@pytest.mark.long
def test_interval_covers_where_weights_share_an_error():
    """Whole weights are drawn: rows of one weight are not independent."""
    hits = 0
    for seed in range(60):
        loss = _loss(seed, scatter=0.03, weight_scatter=0.03)
        low, high = bootstrap_interval(
            LOADS, loss, FIRST, cluster=WEIGHT, level=0.9, resamples=150, seed=seed
        )
        hits += low <= TRUE <= high
    # 90 % nominal; ten clusters are few, so a bootstrap is known to fall somewhat short.
    assert 0.75 * 60 <= hits <= 59


def test_interval_repeats_with_its_seed():
    options = {"cluster": WEIGHT, "resamples": 50}
    loss = _loss(3)
    first = bootstrap_interval(LOADS, loss, FIRST, seed=1, **options)
    assert first == bootstrap_interval(LOADS, loss, FIRST, seed=1, **options)
    assert first != bootstrap_interval(LOADS, loss, FIRST, seed=2, **options)


@pytest.mark.parametrize(
    ("load", "loss"),
    [([1.0], [1.0]), ([2.0, 2.0, 2.0], [1.0, 2.0, 3.0]), ([1.0, 2.0, np.nan], [1.0, 2.0, 3.0])],
)
def test_undetermined_data_are_refused(load, loss):
    with pytest.raises(InputError, match="compliance"):
        fit_compliance(np.array(load), np.array(loss))


def test_errors_in_both_need_positive_deviations():
    with pytest.raises(InputError, match="positive"):
        deming_stiffness(LOADS, _loss(0), 0.0, 0.1)
