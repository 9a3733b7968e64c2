"""Spread and mismatch learnt from healthy logs, in closed cases and end to end."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import elevon
from elevon import Actuator
from elevon.diagnose.engine.case import LogCase, chance_of
from elevon.diagnose.engine.healthy import healthy
from elevon.diagnose.engine.replay import Replay
from elevon.diagnose.engine.spread import (
    DEGREES,
    FeatureSpread,
    LearnedSpread,
    VarianceFactor,
    needed,
)
from elevon.diagnose.engine.table import Feature, FeatureVector
from elevon.diagnose.learning.log_table import log_table, looked_up
from elevon.diagnose.learning.spread import TestResiduals, fitted
from elevon.errors import FormatError, InputError
from tests.diagnose.virtual import bench_logs

DAILY, MISMATCH = 2.0, 9.0  # stated variances


def fleet(units, days, *, spread=1.0, mismatch=1.0, logs=1, tests=1, rng=None):
    """Residuals of one feature whose variances are so many times the stated ones."""
    rng = rng or np.random.default_rng(3)
    offsets = rng.normal(0.0, math.sqrt(mismatch * MISMATCH), units)
    out = []
    for _ in range(tests):
        steps = rng.normal(0.0, math.sqrt(spread * DAILY), (units, days, logs))
        unit, day, _ = (a.ravel() for a in np.indices(steps.shape))
        off = (offsets[:, None, None] + steps).ravel()[:, None]
        out.append(
            TestResiduals(
                ("x",), unit.astype(str), day.astype(str), off, np.zeros_like(off),
                np.array([DAILY]), np.array([MISMATCH]),
            )
        )  # fmt: skip
    return out


def test_without_logs_the_stated_spread_stands():
    assert LearnedSpread().of(["x"]) == pytest.approx((1.0, DEGREES, 1.0, DEGREES))
    one = fitted(fleet(1, 1))["x"]
    assert one.days == VarianceFactor(1.0, DEGREES)  # one day says nothing of days


def test_one_days_logs_say_nothing_of_days():
    assert fitted(fleet(1, 1, logs=50))["x"].days == VarianceFactor(1.0, DEGREES)


def test_the_prior_of_the_mismatch_is_kept_where_the_log_says_nothing():
    """A unit whose offset has the stated size leaves its middle where it was."""
    rows = fleet(1, 2)[0]
    alike = TestResiduals(
        ("x",), rows.unit, rows.day, np.full((2, 1), math.sqrt(MISMATCH)), rows.noise,
        np.array([1e-9]), rows.mismatch,
    )  # fmt: skip
    value, degrees = fitted([alike])["x"].mismatch
    assert value == pytest.approx(1.0, rel=0.02)
    assert degrees == pytest.approx(DEGREES + 1.0, rel=0.02)


def test_many_days_and_units_are_believed():
    learnt = fitted(fleet(1, 400, spread=16.0))["x"].days
    assert learnt.root()[0] == pytest.approx(4.0, rel=0.1)
    units = fitted(fleet(300, 4, spread=0.25, mismatch=16.0))["x"]
    assert units.days.root()[0] == pytest.approx(0.5, rel=0.05)
    assert units.mismatch.root()[0] == pytest.approx(4.0, rel=0.1)


def test_intervals_hold_the_true_spread():
    """Of a spread drawn from the prior, nine tenths of the 90 % intervals hold it."""
    rng = np.random.default_rng(8)
    inside = [0, 0]
    for _ in range(200):
        v, q = (DEGREES / rng.chisquare(DEGREES) for _ in range(2))
        row = fitted(fleet(1, 6, spread=v, mismatch=q, rng=rng))["x"]
        for k, (factor, true) in enumerate(((row.days, v), (row.mismatch, q))):
            low, high = factor.interval()
            inside[k] += low < true < high
    assert 170 <= inside[0] <= 191  # 180 +- 2.5 deviations of a count
    assert 170 <= inside[1] <= 191


def test_tests_of_one_unit_count_once():
    rng = np.random.default_rng(5)
    four = fitted(fleet(1, 9, tests=4, rng=rng))["x"]
    assert four.days.degrees == DEGREES + 8.0
    assert four.mismatch.degrees < DEGREES + 3.0


def test_units_that_scatter_alike_are_worth_more_than_units_that_differ():
    rng = np.random.default_rng(5)
    alike = fitted(fleet(12, 10, rng=rng))["x"].days
    rows = fleet(12, 10, rng=rng)[0]
    wide = np.where(rows.unit.astype(int) % 2, 5.0, 0.2)[:, None]
    differ = fitted([TestResiduals(**{**vars(rows), "off": rows.off * wide})])["x"].days
    assert differ.degrees < 4.0 < DEGREES < alike.degrees


def test_a_conformal_threshold_needs_its_days():
    assert (needed(0.05), needed(0.01), needed(0.5)) == (19, 99, 1)
    scores = tuple((k + 0.5) / 19 for k in range(19))
    few, enough = (LearnedSpread(days=n, alone=scores[:n], based=scores[:n]) for n in (18, 19))
    assert few.chance(0.001, 1, 0.05) == 0.001
    assert enough.chance(0.001, 1, 0.05) == pytest.approx(0.05)
    assert enough.chance(scores[0], 0, 0.05) == pytest.approx(0.10)
    assert "conformal one at 5 % needs 19" in few.threshold_text(0.05)


def test_the_file_comes_back(tmp_path):
    learnt = LearnedSpread(
        "unit",
        3,
        1,
        3,
        {"a: b": FeatureSpread(VarianceFactor(2.5, 12.0), VarianceFactor(0.3, 11.5))},
        (0.1, 0.2),
    )
    assert LearnedSpread.load(learnt.save(tmp_path / "s.toml")) == learnt
    text = (tmp_path / "s.toml").read_text()
    (tmp_path / "bad.toml").write_text(text.replace("2.5", "-2.5"))
    with pytest.raises(FormatError, match="above zero"):
        LearnedSpread.load(tmp_path / "bad.toml")
    (tmp_path / "other.toml").write_text("x = 1\n")
    with pytest.raises(FormatError, match="learn-spread"):
        LearnedSpread.load(tmp_path / "other.toml")


def test_a_table_names_each_log_once(tmp_path):
    path = tmp_path / "units.csv"
    path.write_text("log, unit, day\na/x.csv, A, 1\nb/x.csv, A, 2\n")
    table = log_table(path, ("unit", "day"))
    rows = looked_up(table, ["/data/b/x.csv", "a/x.csv"], path)
    assert [row["day"] for row in rows] == ["2", "1"]
    with pytest.raises(InputError, match="no line for"):
        looked_up(table, ["c/x.csv", "a/x.csv", "b/x.csv"], path)
    with pytest.raises(InputError, match=r"b/x\.csv is not among"):
        looked_up(table, ["a/x.csv"], path)
    path.write_text("log,unit,dya\n")
    with pytest.raises(FormatError, match="'day'"):
        log_table(path, ("unit", "day"))
    path.write_text("log,unit,day\na,A,1\na,A,2\n")
    with pytest.raises(FormatError, match="already"):
        log_table(path, ("unit", "day"))


def model_of(features):
    """A model that shows nought, its features as those of `fleet`; faults of one feature each."""
    names = tuple(f"f{k}" for k in range(features))
    table = {
        n: Feature(n, "", repeats=(0.0, math.sqrt(DAILY)), mismatch=(0.0, math.sqrt(MISMATCH)))
        for n in names
    }
    zero = FeatureVector(names, np.zeros(features), np.zeros(features))
    steps = np.array([0.0, 20.0])
    return Replay(
        zero, {"a": steps, "b": steps},
        {"a": np.outer(steps, np.eye(features)[0]), "b": np.outer(steps, np.eye(features)[1])},
        table, np.zeros(features), np.zeros((features, features)), 10.0,
    )  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("count", [0, 1, 3, 10])
def test_false_alarms_keep_their_rate_with_and_without_baselines(count):
    """Spread and mismatch of 400 units from the prior: one baseline is not worse than none."""
    model, features, units = model_of(6), 6, 400
    rng = np.random.default_rng([4, count, 0])
    candidates = [SimpleNamespace(key=key) for key in "ab"]
    alarms = 0
    for _ in range(units):
        v, q = DEGREES / rng.chisquare(DEGREES, (2, features))
        offset = rng.normal(0.0, np.sqrt(q * MISMATCH))
        days = offset + rng.normal(0.0, np.sqrt(v * DAILY), (count + 1, features))
        logs = [FeatureVector(model.healthy.names, d, np.zeros(features)) for d in days]
        unit = healthy(model, model.healthy.names, logs[1:], spread_known=LearnedSpread())
        alarms += chance_of(LogCase("", logs[0], unit, model), candidates) <= 0.05
    assert alarms <= 0.05 * units + 2.5 * math.sqrt(units * 0.05 * 0.95), alarms


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
def test_days_that_scatter_more_are_learnt_and_no_longer_called_faulty(tmp_path):
    """A speed loop that is set anew each day: a fault by the stated spread, a day by the learnt."""
    actuator = Actuator.load("torino-rotary")
    gain = actuator.parameters.value("control.speed_gain")
    logs = []
    for k, share in enumerate((0.8, 1.2, 0.9, 1.1, 1.0)):
        day = actuator.with_values({"control.speed_gain": gain * share})
        logs += bench_logs(day, [(200 + k, [])])
    *days, log = logs
    stated = elevon.diagnose(log, actuator, baselines=days[:1])
    learnt = elevon.learn_spread(days, actuator)
    assert learnt.features["speed_gain"].days.root()[0] > 2.0
    answer = elevon.diagnose(
        log, actuator, baselines=days[:1], spread=learnt.save(tmp_path / "spread.toml")
    )
    assert stated.chance < 0.05 < answer.chance
    assert not answer.alarm
    assert any("conformal one at 5 % needs 19" in text for text in answer.findings)
