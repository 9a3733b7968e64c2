"""`python -m studies monitor-delay`: its plan, its table, its rates."""

import json

import pytest
from scipy.stats import chi2

from studies.monitor_delay import HEALTHY, LENGTH, LEVELS, MonitorDelay, Watched, _plan, _rate


def test_the_rate_of_false_alarms_has_an_exact_interval():
    low, high = _rate(3, 36)
    hours = 36 * LENGTH / 3600.0
    assert chi2.sf(2 * low * hours, 6) == pytest.approx(0.975)
    assert chi2.cdf(2 * high * hours, 8) == pytest.approx(0.975)
    assert _rate(0, 36)[0] == 0.0


def test_the_plan_of_streams():
    plan = [item for unit in range(3) for item in _plan(1, unit)]
    assert len({item.trial.seed for item in plan}) == len(plan) == 3 * (HEALTHY + 5 * len(LEVELS))
    watched = tuple(
        Watched(p.trial.name, 0, p.fault.kind if p.fault else "", p.level, 0.0, False,
                4.0 if p.fault and p.level > 0.1 else None, bool(p.fault), False)
        for p in plan
    )  # fmt: skip
    result = MonitorDelay(1, 3, 5.0, watched)
    document = json.loads(json.dumps(result.to_dict()))
    assert document["status"] == "pass"
    assert sum(row["streams"] for row in document["rows"]) + document["healthy_streams"] == len(
        plan
    )
    missed = [row for row in document["rows"] if row["alarms"] == 0]
    assert len(missed) == 5 * sum(level <= 0.1 for level in LEVELS)
