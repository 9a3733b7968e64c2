"""The Cranfield case's own: strokes, features, healthy baselines, scores."""

import numpy as np
import pytest

from elevon.errors import FormatError, InputError, RangeError, UnknownNameError
from elevon.recording import Recording
from elevon_cases.cranfield.data import FULL, feature_table, find_strokes
from elevon_cases.cranfield.judge import HealthyBaseline
from elevon_cases.cranfield.result import accuracy, confusion, macro_f1, resamples
from tests.diagnose.cycles import recording


def _random(seed=0):
    return np.random.default_rng(seed)


def test_strokes_are_those_of_the_reference():
    strokes = find_strokes(recording(_random(), cycles=2))
    assert [(s.start, s.stop, s.end, s.direction) for s in strokes] == [
        (0, 125, 200, 1),
        (200, 324, 324, -1),
        (324, 449, 524, 1),
        (524, 648, 648, -1),
    ]


def _plain(position, current=None):
    time = 0.04 * np.arange(len(position))
    current = np.ones(len(position)) if current is None else current
    return Recording.build(
        time,
        {"position_ref": position, "position": position, "current": current},
        {"position_ref": "m", "position": "m", "current": "A"},
        clock="drive",
        rate=25.0,
        meta={"status": "measured"},
    )


@pytest.mark.parametrize(
    "position",
    [
        np.zeros(500),
        np.sin(2.0 * np.pi * 0.05 * 0.04 * np.arange(1500)),
        np.linspace(0.0, 1.0, 500),
        np.zeros(4),
    ],
    ids=["standstill", "sinusoid", "one way", "too short"],
)
def test_motion_without_a_stroke_each_way_is_refused(position):
    with pytest.raises(FormatError, match="stroke"):
        feature_table([_plain(position)])


def test_a_mirrored_load_gives_the_same_features():
    # Up against the load, or down against it: the opposed stroke is the same to the features.
    made = recording(_random(), load=20.0, ripple=0.2)
    values = {n: np.array(made[n].values) for n in ("position_ref", "position", "current")}
    clock = made.clock()
    mirrored = Recording.build(
        clock.time,
        {"position_ref": -values["position_ref"], "position": -values["position"],
         "current": values["current"]},
        {"position_ref": "m", "position": "m", "current": "A"},
        clock="drive", rate=25.0, gaps=list(clock.gaps), meta={"status": "measured"},
    )  # fmt: skip
    a, b = feature_table([made]), feature_table([mirrored])
    np.testing.assert_allclose(a.select(FULL), b.select(FULL), rtol=1e-9, atol=1e-12)
    assert a.load == pytest.approx(196.0)
    assert b.load == pytest.approx(0.0)


def test_features_see_what_was_put_in():
    cases = [(0.05, 0.0, 0.1), (0.1, 0.0, 0.1), (0.05, 0.3, 0.1), (0.05, 0.0, 0.3)]
    table = feature_table(
        [recording(_random(k), noise=n, ripple=r, peak=p) for k, (n, r, p) in enumerate(cases)]
    )
    noise, ripple, start, level = table.select(
        ("hold_noise", "tracking_slow", "breakaway_assisted", "current_opposed")
    ).T
    assert noise[1] - noise[0] == pytest.approx(np.log(2.0), abs=0.1)
    assert ripple[2] - ripple[0] > 3.0
    # The bump of a height of 0.1 A more, averaged over where the start's current is looked at.
    time = 0.04 * np.arange(3, 7)
    bump = np.exp(-(((time - 0.2) / 0.15) ** 2)).mean()
    assert start[3] - start[0] == pytest.approx(0.2 * bump, abs=0.02)
    assert level[0] == pytest.approx(0.5 + 0.004 * 20.0, abs=0.01)


def test_stretches_that_are_not_numbers_cost_their_stroke_only():
    made = recording(_random(), cycles=3)
    values = {n: np.array(made[n].values) for n in made.names}
    values["current"][10:60] = np.nan
    clock = made.clock()
    units = {"position_ref": "m", "position": "m", "current": "A", "load_force": "N"}
    options = {"clock": "drive", "rate": 25.0, "gaps": list(clock.gaps), "meta": made.meta}
    table = feature_table([Recording.build(clock.time, values, units, **options)])
    assert np.isfinite(table.values).all()
    values["current"][:] = np.nan
    with pytest.raises(FormatError, match="not numbers"):
        feature_table([Recording.build(clock.time, values, units, **options)])


def test_missing_channel_and_other_rates_are_named():
    made = recording(_random())
    with pytest.raises(FormatError, match="current"):
        feature_table([made.select(["position_ref", "position"])])
    with pytest.raises(InputError, match="no recording"):
        feature_table([])
    with pytest.raises(UnknownNameError, match="hold_noise"):
        feature_table([made]).select(["hold_nois"])


def test_baseline_keeps_its_false_alarms_and_sees_a_fault():
    random = _random(3)
    names = tuple("abcdef")
    load = np.repeat([20.0, 40.0], 6)
    offset = (load / 10.0)[:, None]
    alarms, seen = [], []
    for _ in range(150):
        baseline = HealthyBaseline.fit(names, offset + random.standard_normal((12, 6)), load)
        tested = 2.0 + random.standard_normal((4, 6))
        alarms += baseline.is_faulty(tested, np.full(4, 20.0)).tolist()
        seen += baseline.is_faulty(tested + 12.0, np.full(4, 20.0)).tolist()
    # 600 answers share 150 baselines: three deviations of a share of 5 % with that dependence.
    assert 0.0 < np.mean(alarms) < 0.05 + 3.0 * np.sqrt(0.05 * 0.95 / 150)
    assert np.mean(seen) > 0.95
    with pytest.raises(InputError, match="30"):
        baseline.p_values(np.zeros((1, 6)), [30.0])
    with pytest.raises(RangeError):
        baseline.is_faulty(np.zeros((1, 6)), [20.0], false_alarm=1.0)
    with pytest.raises(InputError, match="two"):
        HealthyBaseline.fit(names, np.zeros((2, 6)), [1.0, 2.0])


def test_macro_f1_by_hand():
    truth, predicted = list("aaabbc"), list("aabbbb")
    # a: 2 2/(3+2) = 0.8, b: 2 2/(2+4) = 2/3, c: 0.
    assert macro_f1(truth, predicted) == pytest.approx((0.8 + 2.0 / 3.0) / 3.0)
    assert accuracy(truth, predicted) == pytest.approx(4.0 / 6.0)
    assert confusion(truth, predicted, ["a", "b", "c"]) == [[2, 1, 0], [0, 2, 0], [0, 1, 0]]


def test_resamples_keep_the_strata():
    strata = np.array(list("abacba"))
    drawn = list(resamples(strata, draws=300, seed=1))
    for index in drawn:
        assert sorted(strata[index]) == sorted(strata)
    counts = np.bincount(np.concatenate(drawn), minlength=6) / 300.0
    # Each is drawn once on average; the share of a draw of 3 has a deviation of 0.047 here.
    assert counts == pytest.approx(np.ones(6), abs=0.25)
