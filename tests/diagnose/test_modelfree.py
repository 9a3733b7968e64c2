"""The model-free path: strokes, features, classifier, baseline, model file."""

import io

import numpy as np
import pytest

from elevon.diagnose.modelfree import (
    FULL,
    TRANSFER,
    Discriminant,
    HealthyBaseline,
    ModelFree,
    feature_table,
    find_strokes,
)
from elevon.errors import FormatError, InputError, OutputExistsError, RangeError, UnknownNameError
from elevon.recording import Recording
from tests.diagnose.cycles import CLASSES, recording


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


def test_discriminant_knows_its_classes_and_its_doubts():
    random = _random(1)
    labels = np.repeat(["a", "b", "c"], 40)
    centres = {"a": (0.0, 0.0), "b": (4.0, 0.0), "c": (0.0, 4.0)}
    x = np.array([centres[name] for name in labels]) + random.standard_normal((120, 2))
    groups = np.tile(np.arange(8), 15)
    fitted = Discriminant.fit(x, labels.tolist(), groups)
    p = fitted.predict_proba(x)
    np.testing.assert_allclose(p.sum(axis=1), 1.0)
    right = np.array(fitted.predict(x)) == labels
    # Overlap of 4 deviations between centres: an error of Phi(-2) = 2.3 % to each side.
    assert right.mean() > 0.9
    assert p.max(axis=1).mean() == pytest.approx(right.mean(), abs=0.06)
    middle = fitted.predict_proba([[2.0, 0.0]])[0]
    assert middle[2] < 0.1
    assert middle[0] == pytest.approx(0.5, abs=0.3)
    assert fitted.outside([[50.0, 0.0]]).tolist() == [[True, False]]


def test_scatter_is_friedmans_of_unequal_classes_and_a_feature_that_stands():
    random = _random(5)
    labels = np.repeat(["a", "b", "c"], [9, 4, 20])
    x = random.standard_normal((33, 4)) @ np.diag([1.0, 50.0, 1e-3, 0.0]) + 2.0
    x[:, 1] += x[:, 0]
    fitted = Discriminant.fit(x, labels.tolist(), np.arange(33) % 3, shrinkage=0.3)
    means = {name: x[labels == name].mean(axis=0) for name in "abc"}
    residual = np.array([row - means[name] for row, name in zip(x, labels, strict=True)])
    scale = np.array([*np.sqrt((residual[:, :3] ** 2).sum(axis=0) / 30.0), 2.0])
    unit = residual / scale
    scatter = 0.7 * unit.T @ unit / 30.0 + 0.3 * np.eye(4)
    np.testing.assert_allclose(fitted.scale, scale, rtol=1e-12)
    np.testing.assert_allclose(fitted.precision, np.linalg.inv(scatter), rtol=1e-9, atol=1e-12)


def test_groups_that_shift_make_the_probabilities_humble():
    random = _random(2)
    labels = np.tile(np.repeat(["a", "b"], 20), 4)
    groups = np.repeat(np.arange(4), 40)
    x = (labels == "b")[:, None] * 3.0 + random.standard_normal((160, 1))
    steady = Discriminant.fit(x, labels.tolist(), groups, shrinkage=0.2)
    shifted = Discriminant.fit(
        x + np.array([0.0, 3.0, -3.0, 0.0])[groups][:, None], labels.tolist(), groups, shrinkage=0.2
    )
    assert shifted.temperature > 2.0 * steady.temperature


@pytest.mark.parametrize(
    ("x", "labels", "message"),
    [
        ([[0.0], [1.0]], ["a"], "labels"),
        ([[0.0], [np.nan]], ["a", "b"], "finite"),
        ([[0.0], [1.0]], ["a", "a"], "two classes"),
    ],
)
def test_discriminant_refuses(x, labels, message):
    with pytest.raises(InputError, match=message):
        Discriminant.fit(x, labels, np.arange(len(x)))


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


@pytest.fixture(scope="module")
def trained():
    random = _random(4)
    made = [
        (name, recording(random, cycles=1, load=load, **options))
        for name, options in CLASSES.items()
        for load in (20.0, 40.0)
        for _ in range(3)
    ]
    return ModelFree.fit([r for _, r in made], [n for n, _ in made])


def test_model_answers_at_a_load_that_was_not_trained(trained):
    random = _random(5)
    tested = [recording(random, load=-40.0, **options) for options in CLASSES.values()]
    p = trained.predict_proba(tested)
    assert [trained.classes[k] for k in p.argmax(axis=1)] == list(CLASSES)
    with pytest.raises(InputError, match="no healthy recording"):
        trained.p_healthy(tested)
    here = [recording(random, load=20.0, **options) for options in CLASSES.values()]
    assert trained.p_healthy(here)[2] < 0.001
    assert trained.outside([recording(random, peak=3.0)])[0]


def test_model_file_gives_the_same_answers(trained, tmp_path):
    path = trained.save(tmp_path / "model.npz")
    again = ModelFree.load(path)
    tested = [recording(_random(6))]
    np.testing.assert_array_equal(again.predict_proba(tested), trained.predict_proba(tested))
    np.testing.assert_array_equal(again.p_healthy(tested), trained.p_healthy(tested))
    assert (again.view, again.classes) == (trained.view, trained.classes)
    with pytest.raises(OutputExistsError):
        trained.save(path)


def _archive(**arrays):
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


@pytest.mark.parametrize(
    "content",
    [b"", b"not an archive", _archive(a=np.zeros(2)), _archive(about=np.array('{"format": "x"}')),
     _archive(about=np.array([{"a": 1}], dtype=object))],
    ids=["empty", "text", "another", "another format", "objects"],
)  # fmt: skip
def test_model_file_that_is_none(content, tmp_path):
    path = tmp_path / "model.npz"
    path.write_bytes(content)
    with pytest.raises(FormatError, match="not a model-free diagnosis"):
        ModelFree.load(path)


def test_damaged_model_file(trained, tmp_path):
    path = trained.save(tmp_path / "model.npz")
    with np.load(path) as archive:
        data = {name: archive[name] for name in archive.files}
    for name, value in (("scale", data["scale"][:-1]), ("means", data["means"] * np.nan)):
        path.write_bytes(_archive(**{**data, name: value}))
        with pytest.raises(FormatError, match=name):
            ModelFree.load(path)


def test_model_refuses_what_it_was_not_trained_for(trained):
    made = recording(_random())
    with pytest.raises(UnknownNameError, match="transfer"):
        ModelFree.fit([made], ["normal"], view="transfr")
    with pytest.raises(InputError, match="labels"):
        ModelFree.fit([made], [])
    with pytest.raises(UnknownNameError, match="healthy"):
        ModelFree.fit([made, made], ["a", "b"])
    values = {n: np.array(made[n].values)[::2] for n in made.names}
    units = {"position_ref": "m", "position": "m", "current": "A", "load_force": "N"}
    half = Recording.build(
        0.08 * np.arange(len(values["current"])), values, units, clock="drive", rate=12.5,
        meta={"status": "measured"},
    )  # fmt: skip
    with pytest.raises(FormatError, match=r"12\.5 Hz"):
        trained.predict_proba([half])
    assert set(TRANSFER) <= set(feature_table([made]).names)
