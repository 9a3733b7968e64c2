"""Spread and mismatch learnt from healthy logs, in closed cases and end to end."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import elevon
from elevon import Actuator
from elevon.diagnose.engine.case import LogCase, chance_of
from elevon.diagnose.engine.healthy import healthy
from elevon.diagnose.engine.replay import Replay
from elevon.diagnose.engine.spread import (
    _FACTORS,
    STATED,
    FeatureSpread,
    HeldOutLog,
    LearnedSpread,
    VarianceFactor,
    needed,
    variances,
)
from elevon.diagnose.engine.table import Feature, FeatureVector
from elevon.diagnose.learning.labels import log_table, looked_up
from elevon.diagnose.learning.model import LearnedModel
from elevon.diagnose.learning.spread import TestResiduals, fitted
from elevon.errors import ElevonWarning, FormatError, InputError
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


def known_of(tests):
    """What is known of a feature's variances over the stated ones: of steps, and of offsets."""
    return [v.roots()[:, 0] for v in variances(LearnedSpread(features=fitted(tests)).of(["x"]))]


def test_without_logs_the_stated_spread_stands():
    known = LearnedSpread().of(["x"])
    assert [float(np.sum(part)) for part in known[:-1]] == [STATED, 0.0, 0.0, 0.0, 0.0]
    one = fitted(fleet(1, 1))["x"]
    assert one.days.runs == 0.0  # one day says nothing of days
    assert one.worth == STATED


def test_one_days_logs_say_nothing_of_days():
    assert fitted(fleet(1, 1, logs=50))["x"].days.runs == 0.0


def test_an_offset_counts_by_what_of_it_is_no_step():
    rows = fleet(1, 2)[0]
    alike = TestResiduals(
        ("x",), rows.unit, rows.day, np.full((2, 1), math.sqrt(MISMATCH)), rows.noise,
        np.array([1e-9]), rows.mismatch,
    )  # fmt: skip
    value, runs = fitted([alike])["x"].mismatch
    assert (value, runs) == pytest.approx((1.0, 1.0))
    steps = TestResiduals(**{**vars(alike), "noise": np.full((2, 1), 8.0 * MISMATCH)})
    assert fitted([steps])["x"].mismatch.runs == pytest.approx(0.2**2)


def test_many_days_and_units_are_believed():
    assert known_of(fleet(1, 400, spread=16.0))[0][0] == pytest.approx(4.0, rel=0.1)
    units = known_of(fleet(300, 4, spread=0.25, mismatch=16.0))
    assert 0.4 < units[0][0] < 0.6
    assert units[1][0] == pytest.approx(4.0, rel=0.15)


def test_intervals_hold_the_true_spread():
    """Of spreads drawn from the prior, common factor and own ones, nine tenths of the intervals."""
    rng = np.random.default_rng(8)
    inside, units, features = [0, 0], 25, 8
    for _ in range(units):
        common = rng.choice(_FACTORS, 2)
        true = common[:, None] * STATED / rng.chisquare(STATED, (2, features))
        rows = [fleet(1, 6, spread=v, mismatch=q, rng=rng)[0] for v, q in true.T]
        names = tuple(f"f{k}" for k in range(features))
        found = fitted([TestResiduals(**{**vars(r), "names": (n,)})
                        for r, n in zip(rows, names, strict=True)])  # fmt: skip
        known = variances(LearnedSpread(features=found).of(names))
        for k, variance in enumerate(known):
            _, low, high = variance.roots()
            inside[k] += int(np.sum((low**2 < true[k]) & (true[k] < high**2)))
    # Features of a unit share its common factor: their misses come together.
    assert 0.85 * units * features <= inside[0] <= 0.97 * units * features
    assert 0.85 * units * features <= inside[1] <= 0.99 * units * features


def test_tests_of_one_unit_count_once():
    rng = np.random.default_rng(5)
    four = fitted(fleet(1, 9, tests=4, rng=rng))["x"]
    assert four.days.runs == 8.0
    assert four.mismatch.runs <= 1.0


def test_units_that_scatter_alike_are_worth_more_than_units_that_differ():
    rng = np.random.default_rng(5)
    alike = fitted(fleet(12, 10, rng=rng))["x"]
    rows = fleet(12, 10, rng=rng)[0]
    wide = np.where(rows.unit.astype(int) % 2, 5.0, 0.2)[:, None]
    differ = fitted([TestResiduals(**{**vars(rows), "off": rows.off * wide})])["x"]
    assert differ.days.runs + differ.worth < 6.0 < STATED < alike.days.runs + alike.worth


def even_rows(count, tests=1):
    """Held-out logs of so many days of each test, their chances even."""
    return tuple(
        HeldOutLog(test, day, (day + 0.5) / count, (day + 0.5) / count)
        for test in range(tests)
        for day in range(count)
    )


def test_a_conformal_threshold_needs_its_days():
    assert (needed(0.05), needed(0.01), needed(0.5)) == (19, 99, 1)
    few, enough = (LearnedSpread(units=1, days=n, held_out=even_rows(n)) for n in (18, 19))
    assert few.rank(0.001, 1, 0.05) == 0.0  # it raises no threshold
    assert enough.rank(0.001, 1, 0.05) == pytest.approx(0.05)
    assert enough.rank(0.5 / 19, 0, 0.05) == pytest.approx(0.10)
    assert "by draws" in few.threshold_text(0.05)
    assert "18 healthy days of each test" in few.threshold_text(0.05)
    assert "conformal one at 5 % needs 19" in few.threshold_text(0.05)
    assert "an alarm passes both" in enough.threshold_text(0.05)
    assert "an alarm passes both" not in enough.threshold_text(0.01)
    assert "an alarm passes both" not in enough.threshold_text(0.05, logs=2)


def test_days_of_several_tests_are_no_days_of_each():
    """Seven days of three tests are 21 logs and no conformal threshold."""
    assert not LearnedSpread(units=1, days=21, held_out=even_rows(7, 3)).enough(0.05)
    assert LearnedSpread(units=1, days=57, held_out=even_rows(19, 3)).enough(0.05)


def test_of_a_fleet_units_are_ranked_and_not_days():
    rows = tuple(HeldOutLog(0, unit, 0.5, 0.5) for unit in range(4) for _ in range(30))
    fleet_of = LearnedSpread(units=4, days=120, held_out=rows)
    assert not fleet_of.enough(0.05)
    assert "4 healthy units of each test" in fleet_of.threshold_text(0.05)
    assert fleet_of.rank(0.6, 0, 0.2) == 1.0
    half = (*rows[:15], *(row._replace(alone=0.01) for row in rows[15:30]), *rows[30:])
    assert LearnedSpread(units=4, days=120, held_out=half).rank(0.1, 0, 0.2) == 0.3


def test_the_spread_comes_back_from_its_file(tmp_path):
    learnt = LearnedSpread(
        "unit",
        3,
        1,
        3,
        {"a: b": FeatureSpread(VarianceFactor(2.5, 12.0), VarianceFactor(0.3, 1.5), 11.0)},
        (HeldOutLog(0, 1, 0.1, 0.2),),
    )
    model = LearnedModel(learnt)
    assert model.holds == ["spread"]
    assert LearnedModel.load(model.save(tmp_path / "s.npz")).spread == learnt
    wrong = replace(learnt, features={"x": FeatureSpread(VarianceFactor(-2.5, 12.0))})
    with pytest.raises(FormatError, match="nought or more"):
        LearnedModel.load(LearnedModel(wrong).save(tmp_path / "bad.npz"))


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
@pytest.mark.parametrize("factor", [1.0, 9.0])
@pytest.mark.parametrize("count", [0, 1, 3, 10])
def test_false_alarms_keep_their_rate_with_a_learnt_spread(count, factor):
    """Ten days learnt of each unit; both variances as stated, and nine times that."""
    features, units, learnt = 6, 200, 10
    model = model_of(features)
    names = model.healthy.names
    rng = np.random.default_rng([4, count, int(factor)])
    candidates = [SimpleNamespace(key=key) for key in "ab"]
    stated = (np.full(features, DAILY), np.full(features, MISMATCH))
    alarms = 0
    for _ in range(units):
        v, q = factor * STATED / rng.chisquare(STATED, (2, features))
        offset = rng.normal(0.0, np.sqrt(q * MISMATCH))
        days = offset + rng.normal(0.0, np.sqrt(v * DAILY), (count + 1 + learnt, features))
        logs = [FeatureVector(names, d, np.zeros(features)) for d in days]
        others = days[count + 1 :]
        day = np.arange(learnt).astype(str)
        rows = TestResiduals(names, np.full(learnt, "u"), day, others, 0.0 * others, *stated)
        spread = LearnedSpread(features=fitted([rows]))
        unit = healthy(model, names, logs[1 : count + 1], spread_known=spread)
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
    learnt = elevon.learn(days, actuator=actuator)
    assert learnt.holds == ["spread"]
    assert learnt.spread.deviations()["speed_gain"][0] > 2.0
    answer = elevon.diagnose(
        log, actuator, baselines=days[:1], model=learnt.save(tmp_path / "spread.npz")
    )
    assert stated.chance < 0.05 < answer.chance
    assert not answer.alarm
    assert any("conformal one at 5 % needs 19" in text for text in answer.findings)


@pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
def test_one_recording_is_no_two_days():
    actuator = Actuator.load("torino-rotary")
    log = bench_logs(actuator, [(210, [])])[0]
    with pytest.raises(InputError, match="same recording as"):
        elevon.learn([log, replace(log, name="again")], actuator=actuator)


@pytest.mark.long
def test_a_faulty_log_among_the_learnt_is_told_of():
    actuator = Actuator.load("torino-rotary")
    cases = [(220 + k, []) for k in range(4)] + [(224, ["backlash@transmission=0.13 deg"])]
    logs = [replace(x, name=f"day {k}") for k, x in enumerate(bench_logs(actuator, cases))]
    with pytest.warns(ElevonWarning, match="looks faulty itself") as caught:
        elevon.learn(logs, actuator=actuator)
    names = [str(w.message).split(" looks")[0] for w in caught if "looks faulty" in str(w.message)]
    assert names == ["day 4"]
