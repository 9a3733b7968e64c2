"""A unit that has failed is a fact of the plan; a unit whose tail is near gets its visit."""

import numpy as np
import pytest

from elevon.prognose.fleet import Costs, plan_fleet
from tests.prognose.test_refused import lives


def test_a_failed_unit_does_not_draw_the_others_to_now():
    """Of three units one has failed; the others' visits are those of the two alone."""
    rng = np.random.default_rng(4)
    near = lives(*np.sort(rng.normal(150.0, 20.0, 500)).tolist())
    far = lives(*np.sort(rng.normal(1900.0, 100.0, 500)).tolist())
    costs = Costs(1.0, 10_000.0, 500.0)
    alone = plan_fleet({"near": near, "far": far}, costs)
    plan = plan_fleet({"near": near, "far": far, "gone": lives(*[0.0] * 500)}, costs)
    assert plan.visit_of("gone") == 0.0
    assert plan.visit_of("far") == pytest.approx(alone.visit_of("far"), rel=0.02)
    assert plan.visit_of("far") > 1500.0
    # A visit is made now in any case: joining it saves 500 and throws some 150 away.
    assert plan.visit_of("near") == 0.0
    assert plan.cost == pytest.approx(500.0 + 150.0 + alone.cost - _of(near, costs), rel=0.05)


def _of(unit, costs):
    return plan_fleet({"near": unit}, costs).cost


def test_all_units_failed_need_one_visit():
    plan = plan_fleet({name: lives(*[0.0] * 20) for name in "ab"}, Costs(1.0, 1e4, 500.0))
    assert [(v.use, v.units) for v in plan.visits] == [(0.0, ("a", "b"))]
    assert plan.cost == 500.0


def test_a_unit_without_an_end_in_most_futures_is_visited_before_its_tail():
    unit = lives(*[np.inf] * 15, *[4e5] * 5)
    plan = plan_fleet({"b": unit}, Costs(0.01, 10_000.0, 500.0), horizon=5e5)
    assert plan.visit_of("b") == pytest.approx(4e5, rel=0.01)
    assert plan_fleet({"b": unit}, Costs(0.01, 1000.0, 500.0)).visit_of("b") is None


def test_the_stated_risk_is_not_exceeded():
    """Failures cost nothing: by cost parts are used up; the risk brings the visit forward."""
    unit = lives(*np.linspace(1000.0, 2000.0, 1001))
    free = Costs(1.0, 600.0, 1.0)
    assert plan_fleet({"a": unit}, free).visit_of("a") > 1200.0
    plan = plan_fleet({"a": unit}, free, risk=0.05)
    assert 1.0 - unit.survives(plan.visit_of("a")) <= 0.05
    assert plan.visit_of("a") == pytest.approx(1050.0, abs=10.0)
