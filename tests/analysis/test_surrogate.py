"""Surrogates of a known truth: two fidelities help where the low one tells the shape."""

import numpy as np
import pytest

from elevon import InputError
from elevon.analysis.response import Pairs, Samples
from elevon.analysis.surrogate import CoKriging, Kriging, study


def _high(x):
    """A. Forrester, A. Sobester, A. Keane, Proc. R. Soc. A 463, 2007: their function of one x."""
    u = 0.5 * (x[:, 0] + 1.0)
    return (6.0 * u - 2.0) ** 2 * np.sin(12.0 * u - 4.0)


def _low(x):
    return 0.5 * _high(x) + 10.0 * (0.5 * x[:, 0]) - 5.0


def _pairs(points, low=_low):
    bounds = np.array([[-1.0, 1.0]])
    high = Samples(["x"], points, _high(points), bounds)
    below = Samples(["x"], points, low(points), bounds)
    return Pairs(high, below, np.arange(len(points)), 1.0)


def test_co_kriging_recovers_scale_and_shape():
    low, high = np.linspace(-1, 1, 15)[:, None], np.array([[-1.0], [-0.2], [0.2], [1.0]])
    model = CoKriging.fit(low, _low(low), high, _high(high))
    grid = np.linspace(-1, 1, 101)[:, None]
    alone = Kriging.fit(high, _high(high)).predict(grid)[0]
    both = model.predict(grid)[0]
    assert model.scale == pytest.approx(2.0, rel=0.15)
    assert np.std(both - _high(grid)) < 0.1 * np.std(alone - _high(grid))


@pytest.mark.long
def test_two_fidelities_help_at_equal_cost_where_the_low_one_is_good_and_cheap():
    pairs = _pairs(np.linspace(-1, 1, 40)[:, None])
    result = study(pairs.high, pairs, cost_ratio=10.0, budget=10, splits=3)
    runs = {item.name: (item.high, item.low) for item in result.variants}
    assert runs["kriging"] == (10, 0)
    assert runs["cokriging"][0] * 10 + runs["cokriging"][1] <= 100
    errors = {item.name: item.errors for item in result.variants}
    assert all(2.0 * b < a for a, b in zip(errors["kriging"], errors["cokriging"], strict=True))
    assert result.gain == pytest.approx(np.mean(errors["kriging"]) - np.mean(errors["cokriging"]))


def test_a_held_out_point_is_never_seen_through_its_partner():
    from elevon.analysis.surrogate import _low_runs

    pairs = _pairs(np.linspace(-1, 1, 20)[:, None])
    order = np.random.default_rng(1).permutation(20)
    chosen = _low_runs(pairs, order, 6, 1000, order[6:10])
    assert not set(chosen) & set(order[:6])
    assert list(chosen[:4]) == list(order[6:10])


def test_a_budget_beyond_the_points_is_refused():
    pairs = _pairs(np.linspace(-1, 1, 20)[:, None])
    with pytest.raises(InputError, match="held out"):
        study(pairs.high, budget=18)


PLAN = """
name = "pairs"
actuator = "torino-rotary"
fidelity = "{fidelity}"
record = []
features = "friction@1 kHz"
[scenario]
duration = "0.12 s"
[[scenario.command.terms]]
kind = "sine"
amplitude = "4 deg"
frequency = "8 Hz"
[design]
kind = "latin_hypercube"
count = 16
[[design.factor]]
parameter = "friction.dynamic"
from = "0.2 N m"
to = "0.4 N m"
"""


def test_the_command_pairs_two_campaigns(elevon_cli, tmp_path):
    for fidelity in ("high", "low"):
        (tmp_path / "plan.toml").write_text(PLAN.format(fidelity=fidelity))
        assert elevon_cli("campaign", "run", "plan.toml", "--out", fidelity).code == 0
    command = ("campaign", "surrogate", "high", "--response", "friction_current")
    found = elevon_cli(*command, "--low", "low", "--splits", 2, "--json").json
    assert {item["name"] for item in found["variants"]} == {"mean", "kriging", "cokriging", "low"}
    assert found["cost_ratio"] >= 1.0
    assert found["correlation"] > 0.9
    errors = {item["name"]: item["mean"] for item in found["variants"]}
    assert errors["kriging"] < errors["mean"]
