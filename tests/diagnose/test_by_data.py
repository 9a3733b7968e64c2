"""Detection by a unit's healthy logs alone, where the model does not show them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from elevon import Actuator
from elevon.diagnose.by_model import diagnose
from elevon.diagnose.engine.case import BY_DATA, JoinedLogs, LogCase, chance_of
from elevon.diagnose.engine.diagnosis import answer_of, rank_among_baselines
from elevon.diagnose.engine.healthy import healthy
from elevon.diagnose.engine.spread import STATED
from elevon.diagnose.engine.table import FeatureVector
from tests.diagnose.test_learn_spread import DAILY, model_of
from tests.diagnose.virtual import bench_logs

FEATURES, RATE = 8, 0.05


def case_of_unit(rng, count, moved=0.0):
    """A log and baselines of a unit that is 100 deviations off the model in each feature."""
    model = model_of(FEATURES)
    v = STATED / rng.chisquare(STATED, FEATURES) * DAILY
    days = 100.0 * math.sqrt(DAILY) + rng.normal(0.0, np.sqrt(v), (count + 1, FEATURES))
    days[0, 3] += moved * math.sqrt(DAILY)
    logs = [FeatureVector(model.healthy.names, d, np.zeros(FEATURES)) for d in days]
    unit = healthy(model, model.healthy.names, logs[1:], by_data=True)
    return LogCase("", logs[0], unit, model, baselines=tuple(logs[1:]), explains=False)


@pytest.mark.parametrize("count", [2, 3, 10])
def test_the_models_misfit_widens_nothing(count):
    """Healthy logs alarm at the rate; ten deviations of one feature are seen."""
    rng, units = np.random.default_rng([5, count]), 60
    alarms = sum(chance_of(case_of_unit(rng, count), ()) <= RATE for _ in range(units))
    assert alarms <= RATE * units + 2.5 * math.sqrt(units * RATE * (1.0 - RATE))
    seen = [chance_of(case_of_unit(rng, count, moved=10.0), ()) <= RATE for _ in range(20)]
    assert sum(seen) >= 18


def test_the_answer_names_no_cause_and_says_what_would_be_seen():
    rng = np.random.default_rng(8)
    quiet = answer_of([case_of_unit(rng, 3)], (), RATE)
    assert (quiet.status, quiet.best, quiet.rate) == ("healthy", (), "assumed")
    assert any("a change of one feature would be seen" in text for text in quiet.findings)
    loud = answer_of([case_of_unit(rng, 3, moved=15.0)], (), RATE)
    assert (loud.status, loud.best, loud.reason.feature) == ("unknown_fault", (), "f3")
    assert loud.p_fault == pytest.approx(loud.p_other)
    assert loud.p_other > 0.9


def test_the_rank_among_nineteen_healthy_logs_holds_its_rate():
    """Of twenty exchangeable logs each is the most unlike one as often."""
    rng, units = np.random.default_rng(9), 400
    cases = [case_of_unit(rng, 19) for _ in range(units)]
    alarms = sum(rank_among_baselines(case) <= RATE for case in cases)
    assert alarms == pytest.approx(RATE * units, abs=3.0 * math.sqrt(units * RATE * (1 - RATE)))
    # Whatever the distribution: days that are far off now and then.
    heavy = [replace(c, features=_jumped(c.features, rng), baselines=tuple(
        _jumped(b, rng) for b in c.baselines)) for c in cases[:200]]  # fmt: skip
    assert sum(rank_among_baselines(case) <= RATE for case in heavy) <= 0.1 * len(heavy)
    assert rank_among_baselines(case_of_unit(rng, 19, moved=15.0)) == pytest.approx(1 / 20)
    assert answer_of([cases[0]], (), RATE).rate == "guaranteed"


def _jumped(features, rng):
    return replace(features, values=features.values + rng.standard_t(1.5, FEATURES))


def test_joined_logs_are_explained_only_if_all_are():
    rng = np.random.default_rng(3)
    off = case_of_unit(rng, 2)
    assert not JoinedLogs((off, replace(off, explains=True))).explained


@pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
def test_a_file_of_another_unit_hides_no_fault():
    """Friction five times the file's: three healthy logs, then one with a quarter more."""
    file = Actuator.load("torino-rotary")
    value = file.parameters.value
    names = ("friction.dynamic", "friction.static")
    unit = file.with_values({n: 5.0 * value(n) for n in names})
    worn = file.with_values({n: 6.5 * value(n) for n in names})
    *base, day = bench_logs(unit, [(seed, []) for seed in (1, 2, 3, 4)])
    (log,) = bench_logs(worn, [(5, [])])
    few = ["backlash@transmission", "friction@transmission"]
    healthy_day, faulty = (diagnose([x], file, baselines=base, faults=few) for x in (day, log))
    assert healthy_day.status == "healthy"
    assert any(BY_DATA in text for text in healthy_day.findings)
    assert (faulty.status, faulty.best) == ("unknown_fault", ())
    assert "dry_current" in {m.name for m in faulty.features if m.score > 3.0}
