"""Classes learnt from labelled logs: in closed cases, and from logs of the bench to an answer."""

import json
from dataclasses import replace

import numpy as np
import pytest

import elevon
from elevon import Actuator
from elevon.diagnose.engine.days import drawn
from elevon.diagnose.learning.archive import read_archive, write_archive
from elevon.diagnose.learning.classes import LearnedClasses, faulty_logit
from elevon.diagnose.learning.classify import LabelledLog, learned_classes
from elevon.diagnose.learning.trees import Trees
from elevon.errors import FormatError, InputError
from tests.diagnose.virtual import bench_logs

FAULTS = {"healthy": [], "backlash@transmission": ["backlash@transmission=0.2 deg"],
          "bad": ["short@motor.phase_b=0.25"]}  # fmt: skip


@pytest.fixture(scope="module")
def unit():
    return Actuator.load("torino-rotary")


@pytest.fixture(scope="module")
def labelled(unit):
    """Four units, of each two healthy logs and one of each fault, each of another day."""
    logs, known = [], []
    for number in range(4):
        for label, faults in FAULTS.items():
            for day in range(2 if label == "healthy" else 1):
                today = drawn(unit, np.random.default_rng([6, number, len(label), day]))
                log = bench_logs(today, [(10 * number + day, faults)])[0]
                logs.append(replace(log, name=f"{number}-{label}-{day}"))
                known.append(LabelledLog(label, f"unit {number}", "cold" if day else "warm"))
    return logs, known


@pytest.fixture(scope="module")
def learned(labelled):
    logs, known = labelled
    keep = [k for k, item in enumerate(known) if item.unit != "unit 3"]
    return elevon.learn([logs[k] for k in keep], [known[k] for k in keep], pole_pairs=4.0)


@pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
def test_a_unit_that_was_not_learnt_is_classed(unit, labelled, learned, tmp_path):
    path = learned.save(tmp_path / "model.npz")
    for log, known in zip(*labelled, strict=True):
        if known.unit != "unit 3":
            continue
        answer = elevon.diagnose(log, unit, method="learned", model=path)
        if known.label == "healthy":
            assert answer.status == "healthy"
            continue
        kind, _, place = known.label.partition("@")
        assert answer.status == "faulty"
        assert answer.best == (f"{kind}@{place or 'unit'}",)
        assert answer.headline.startswith(f"FAULTY: {kind}")
        assert "labelled" in answer.report().html()
        json.dumps(answer.to_dict()["faults"])
    assert "most probable class: 6 healthy" in answer.findings[0]


def test_groups_that_are_left_out_are_counted(learned):
    left = learned.report["left_out"]
    assert left["unit"]["logs"] == 12
    assert (left["unit"]["healthy"], left["unit"]["faulty"]) == (6, 6)
    assert left["unit"]["right"] >= 11
    assert "condition" in left
    assert len(learned.healthy) == 6


def test_the_file_comes_back(learned, tmp_path):
    again = LearnedClasses.load(learned.save(tmp_path / "model.npz"))
    assert again.features == learned.features
    assert again.classes == ("backlash@transmission", "bad", "healthy")
    np.testing.assert_array_equal(again.discriminant.precision, learned.discriminant.precision)
    kind, about, arrays = read_archive(tmp_path / "model.npz")
    arrays["healthy"] = np.array([np.nan])
    damaged = {n: v for n, v in about.items() if n not in ("format", "version", "kind")}
    write_archive(tmp_path / "bad.npz", kind, damaged, arrays)
    with pytest.raises(FormatError, match="not finite"):
        LearnedClasses.load(tmp_path / "bad.npz")
    write_archive(tmp_path / "other.npz", "surrogate", damaged, arrays)
    with pytest.raises(FormatError, match="holds a surrogate"):
        LearnedClasses.load(tmp_path / "other.npz")


def test_a_file_cut_or_changed_anywhere_is_no_file(tmp_path):
    whole = write_archive(tmp_path / "whole.npz", "classes", {}, {"x": np.arange(500.0)})
    data = whole.read_bytes()
    (tmp_path / "bad.npz").write_bytes(data[: len(data) // 2])
    with pytest.raises(FormatError, match=r"bad\.npz"):
        read_archive(tmp_path / "bad.npz")
    for place in range(40, len(data) // 2, 7):  # within the packed arrays
        (tmp_path / "bad.npz").write_bytes(
            data[:place] + bytes([data[place] ^ 255]) + data[place + 1 :]
        )
        try:
            _, _, arrays = read_archive(tmp_path / "bad.npz")
        except FormatError:
            continue
        np.testing.assert_array_equal(arrays["x"], np.arange(500.0))


def test_another_motion_is_refused(unit, labelled, learned):
    slow = bench_logs(unit, [(1, [])], procedure="chirp")[0]
    with pytest.raises(InputError, match="not of the motion"):
        elevon.diagnose(slow, unit, method="learned", model=learned)
    with pytest.raises(InputError, match="another motion"):
        learned_classes([labelled[0][0], slow, *labelled[0][1:]], [labelled[1][0], *labelled[1]])


@pytest.mark.parametrize(
    ("labels", "text"),
    [
        (["a"] * 3 + ["b"] * 3, "one must be 'healthy'"),
        (["healthy"] * 6, "another"),
        (["healthy"] * 4 + ["b"] * 2, "2 logs; 3 are needed"),
    ],
)
def test_labels_that_teach_nothing_are_refused(labels, text):
    with pytest.raises(InputError, match=text):
        learned_classes([None] * len(labels), [LabelledLog(label) for label in labels])


@pytest.mark.parametrize("classes", [2, 3])
def test_trees_as_arrays_say_what_the_library_says(classes):
    ensemble = pytest.importorskip("sklearn.ensemble")
    rng = np.random.default_rng(classes)
    values = rng.standard_normal((60, 4)).astype(np.float32)
    labels = (values[:, 0] + rng.normal(0.0, 0.3, 60) > 0.0).astype(int)
    labels += (values[:, 1] > 0.5) * (classes == 3)
    model = ensemble.GradientBoostingClassifier(init="zero", n_estimators=8, random_state=0)
    model.fit(values, labels)
    trees = Trees.stored(Trees.of(model).arrays())
    scores = trees.scores(values.astype(float))
    share = np.exp(scores - np.logaddexp.reduce(scores, axis=1)[:, None])
    np.testing.assert_allclose(share, model.predict_proba(values), atol=1e-9)


def test_trees_that_go_round_are_refused():
    node = {"feature": [0, 0], "left": [1, 0], "right": [1, 0], "roots": [[0]],
            "threshold": [0.0, 0.0], "value": [0.0, 0.0]}  # fmt: skip
    with pytest.raises(ValueError, match="leads back"):
        Trees.build({name: np.array(value) for name, value in node.items()})


def test_the_logit_of_any_fault_sums_the_faults():
    scores = np.log([[0.2, 0.3, 0.5]])
    assert faulty_logit(scores, ["a", "healthy", "b"])[0] == pytest.approx(np.log(0.7 / 0.3))
