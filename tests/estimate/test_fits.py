"""One regression, one fit of residuals, one batched solver, one hold-out: against closed forms."""

import math

import numpy as np
import pytest
from scipy.optimize import least_squares

from elevon.errors import InputError, Interrupted
from elevon.estimate import LEVEL, Estimate, Free
from elevon.estimate.held_out import folds, held_out
from elevon.estimate.lanes import LaneChannel, Lanes
from elevon.estimate.regression import huber, regressed
from elevon.estimate.residual import fit_balance, fit_residual, robust_weights

TIME = np.arange(0.0, 20.0, 0.01)
TRUE = np.array([2.0, -0.5])


def line(seed, outliers=0):
    """Columns, data with noise of 0.1, and strokes that are white."""
    rng = np.random.default_rng(seed)
    design = np.column_stack((np.cos(TIME), np.ones_like(TIME)))
    data = design @ TRUE + 0.1 * rng.normal(size=len(TIME))
    data[rng.integers(0, len(TIME), outliers)] += 50.0
    return design, data, [(TIME, np.cos(TIME), 0.01)]


def test_huber_is_scipys_at_the_spread_of_the_residuals():
    design, data, _ = line(1, outliers=40)
    value, residual, weight = huber(design, data)
    bound = 1.345 * 1.4826 * np.median(np.abs(residual))
    best = least_squares(lambda b: data - design @ b, [0.0, 0.0], loss="huber", f_scale=bound)
    assert value == pytest.approx(best.x, rel=1e-5)
    assert np.all(weight[np.abs(residual) <= bound] == 1.0)
    assert value == pytest.approx(TRUE, abs=0.02)


def test_intervals_of_a_regression_cover_a_linear_model():
    """The share of intervals that hold the truth is that of `LEVEL`, within three deviations."""
    hits, count = 0, 120
    for seed in range(count):
        design, data, strokes = line(seed)
        fit = regressed(("slope", "offset"), [design], [data], strokes)
        for name, true in zip(fit.names, TRUE, strict=True):
            low, high = fit.estimate(name).interval
            hits += low <= true <= high
    share, std = hits / (2 * count), math.sqrt(LEVEL * (1.0 - LEVEL) / (2 * count))
    assert abs(share - LEVEL) < 3.0 * std


def test_a_function_of_the_coefficients_has_the_deviation_of_its_slope():
    design, data, strokes = line(3)
    fit = regressed(("slope", "offset"), [design], [data], strokes)
    ratio = fit.of(lambda b: b[0] / b[1])
    gradient = np.array([1.0 / fit["offset"], -fit["slope"] / fit["offset"] ** 2])
    assert ratio.std == pytest.approx(math.sqrt(gradient @ fit.covariance @ gradient), rel=1e-4)
    assert ratio.inverted().std == pytest.approx(ratio.std / ratio.value**2)


@pytest.mark.parametrize("loss", ["linear", "soft_l1", "huber"])
def test_a_residual_fit_is_scipys_and_a_belief_one_row_more(loss):
    design, data, _ = line(5, outliers=20)

    def residual(x):
        return (data - design @ x) / 0.1

    fit = fit_residual(residual, [1.0, 0.0], loss=loss, soft=2.0, tolerance=1e-12)
    best = least_squares(residual, [1.0, 0.0], loss=loss, f_scale=2.0, xtol=1e-12, ftol=1e-12)
    assert fit.x == pytest.approx(best.x, rel=1e-6)
    weight, _ = robust_weights(fit.residual, loss, 2.0)
    assert design.T @ (weight * fit.residual) == pytest.approx([0.0, 0.0], abs=1e-3)
    assert fit.jacobian == pytest.approx(-design / 0.1, abs=1e-4), "the residual's, not weighted"
    believed = fit_residual(
        residual, [1.0, 0.0], loss=loss, soft=2.0, belief=np.array([7.0, 0.0]), tolerance=1e-12
    )
    weight = believed.weight
    slope = design.T @ (weight * believed.residual) / 0.1 - (believed.x - [7.0, 0.0])
    _, curvature = robust_weights(believed.residual, loss, 2.0)
    normal = (design * curvature[:, None]).T @ design / 0.1**2 + np.eye(2)
    # What a Newton step would still change: the slope itself scales with the data.
    assert np.linalg.solve(normal, slope) == pytest.approx([0.0, 0.0], abs=1e-6)


def test_a_balance_says_what_it_determines():
    design, data, strokes = line(6, outliers=20)
    free = [Free.about("slope", 1.5, 1.0), Free.about("offset", 1.0, 1.0, signed=True),
            Free.about("unseen", 3.0, 0.5)]  # fmt: skip
    fit = fit_balance(free, data, lambda v: design @ v[:2], strokes, scale=1.0)
    levels, reasons = fit.judged(lambda path: f"{path} is not seen")
    assert list(reasons) == ["unseen"]
    assert fit.values[2] == pytest.approx(3.0)
    for path, true in zip(("slope", "offset"), TRUE, strict=True):
        assert abs(levels[path].value - true) < 4.0 * levels[path].std


def test_lanes_find_the_minimum_from_several_starts():
    """Two exponentials by a batch: the best start wins; deviations are those of the noise."""
    rng = np.random.default_rng(7)
    true = {"rate": 0.7, "size": 3.0}
    data = true["size"] * np.exp(-true["rate"] * TIME) + 0.02 * rng.normal(size=len(TIME))
    free = [
        Free("rate", 2.0, 1.0, 1e-3, 1e3, log_scale=True),
        Free("size", 1.0, 5.0, -100.0, 100.0),
    ]
    calls = []

    def runs(points):
        calls.append(len(points))
        return [[p["size"] * np.exp(-p["rate"] * TIME)] for p in points]

    channel = LaneChannel(0, "decay", TIME, data, 0.01, float(np.std(data)), 0.1)
    lanes = Lanes(free, runs, [channel], belief=0.0)
    starts = np.array([[math.log(30.0), 0.1], [math.log(2.0), 0.2]])
    point = lanes.solve(starts, rounds=20)[0]
    lanes.refresh(point.x)
    point = lanes.solve(point.x[None, :], rounds=20, central=True)[0]
    assert math.exp(point.x[0]) == pytest.approx(true["rate"], rel=0.01)
    assert 5.0 * point.x[1] == pytest.approx(true["size"], rel=0.01)
    assert lanes.scales[0] == pytest.approx(0.02, rel=0.1)
    assert max(calls) >= 2 * 2
    assert len(np.unique(lanes.blocks(point.residual))) >= 8


def test_each_item_is_left_out_once():
    assert folds("abc") == [(["b", "c"], ["a"]), (["a", "c"], ["b"]), (["a", "b"], ["c"])]

    def fit(kept):
        if "b" not in kept:
            raise InputError("too little")
        return "".join(kept)

    rows = list(held_out("abc", fit, lambda item, model, _share: item + model))
    assert rows == [("a", "abc"), ("b", None), ("c", "cab")]
    with pytest.raises(Interrupted):
        list(held_out("abc", fit, lambda *_: "", lambda _fraction: False))


def test_an_estimate_is_read_back_equal():
    item = Estimate(2.0, 0.1, 12.0, path="motor.inertia", unit="kg m2", old=1.0, given=("a",))
    assert Estimate.from_dict(item.to_dict()) == item
    assert item.within(low=1.95).interval[0] == 1.95
    assert item.scaled(-2.0).std == pytest.approx(0.2)
