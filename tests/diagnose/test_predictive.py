"""What a healthy log of another day may show, in closed cases: coverage, and false alarms."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import t as student

from elevon.diagnose.engine import case as engine
from elevon.diagnose.engine import healthy as healthy_module
from elevon.diagnose.engine.case import LogCase, chance_of
from elevon.diagnose.engine.healthy import healthy
from elevon.diagnose.engine.spread import (
    _FACTORS,
    DEGREES,
    STATED,
    StepVariance,
)
from elevon.diagnose.engine.table import FeatureVector
from tests.diagnose.test_learn_spread import DAILY, MISMATCH, model_of

FEATURES = 8
RATE = 0.05
CANDIDATES = [SimpleNamespace(key=key) for key in "ab"]


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    monkeypatch.setattr(engine, "DRAWS", 800)


def alarms(count, units, factor, seed):
    """False alarms of units whose variances are so many times the stated ones."""
    model = model_of(FEATURES)
    rng = np.random.default_rng([seed, count])
    names, found = model.healthy.names, 0
    for _ in range(units):
        v, q = factor * STATED / rng.chisquare(STATED, (2, FEATURES))
        offset = rng.normal(0.0, np.sqrt(q * MISMATCH))
        days = offset + rng.normal(0.0, np.sqrt(v * DAILY), (count + 1, FEATURES))
        logs = [FeatureVector(names, d, np.zeros(FEATURES)) for d in days]
        unit = healthy(model, names, logs[1:])
        found += chance_of(LogCase("", logs[0], unit, model), CANDIDATES) <= RATE
    return found


@pytest.mark.parametrize("count", [0, 1, 3])
def test_false_alarms_keep_their_rate_without_a_learnt_spread(count):
    units = 80
    most = RATE * units + 2.5 * math.sqrt(units * RATE * (1.0 - RATE))
    assert alarms(count, units, 1.0, 7) <= most


def test_baselines_are_no_worse_than_none_where_all_is_wider_than_stated():
    units = 80
    none, one, three = (alarms(count, units, 9.0, 9) for count in (0, 1, 3))
    assert one <= none
    assert three <= RATE * units + 2.5 * math.sqrt(units * RATE * (1.0 - RATE))


def test_baselines_tell_the_factor_that_features_have_in_common():
    rng = np.random.default_rng(3)
    worth = np.full(12, DEGREES)
    scatter = 9.0 * rng.chisquare(2, 12)
    known = StepVariance.of(worth, scatter, 2, scatter / 2.0)
    middle = 1.0 / float(np.sum(known.common / _FACTORS))
    assert 5.0 < middle < 16.0
    assert known.value == pytest.approx((DEGREES * middle + scatter) / (DEGREES + 2.0))
    stated = StepVariance.of(worth, rng.chisquare(2, 12), 2, rng.chisquare(1, 12))
    assert 1.0 / float(np.sum(stated.common / _FACTORS)) < 1.5


def test_draws_of_the_difference_of_two_days_follow_student(monkeypatch):
    """One baseline, a wide mismatch, no common factor: Student's t."""
    worth = StepVariance(np.full(2, DEGREES), np.zeros(2))
    monkeypatch.setattr(healthy_module, "variances", lambda *_: (worth, worth))
    model = model_of(2)
    zero = FeatureVector(model.healthy.names, np.zeros(2), np.zeros(2))
    unit = healthy(model, model.healthy.names, [zero])
    draws = unit.drawn(20_000, np.zeros(2), 2)[:, 0]
    size = math.sqrt(float(unit.covariance[0, 0]))
    for level in (0.90, 0.95, 0.99):
        inside = np.mean(np.abs(draws) < size * student.ppf(0.5 + 0.5 * level, DEGREES))
        assert inside == pytest.approx(level, abs=0.006)


def same_day_alarms(count, units=60):
    """False alarms against so many baselines of one day, which differ by their noise alone."""
    model = model_of(FEATURES)
    rng = np.random.default_rng(3)
    names, found = model.healthy.names, 0
    for _ in range(units):
        v, q = STATED / rng.chisquare(STATED, (2, FEATURES))
        offset = rng.normal(0.0, np.sqrt(q * MISMATCH))
        log, day = offset + rng.normal(0.0, np.sqrt(v * DAILY), (2, FEATURES))
        again = day + 0.2 * rng.normal(0.0, np.sqrt(v * DAILY), (10, FEATURES))
        base = [FeatureVector(names, d, np.zeros(FEATURES)) for d in again[:count]]
        unit = healthy(model, names, base)
        case = LogCase("", FeatureVector(names, log, np.zeros(FEATURES)), unit, model)
        found += chance_of(case, CANDIDATES) <= RATE
    return found


def test_more_baselines_of_one_day_raise_no_rate():
    """Ten logs of one day are no ten days: what they scatter is not what days do."""
    assert same_day_alarms(10) <= same_day_alarms(1) + 1
