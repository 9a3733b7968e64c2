"""What is learnt from labelled logs and from data sets, from closed cases to an answer."""

import json
import math
import time
from dataclasses import replace

import numpy as np
import pytest

import elevon
from elevon import Actuator
from elevon.campaign import load_campaign
from elevon.diagnose.engine.days import drawn
from elevon.diagnose.learning.examples import Examples, examples_of_dataset
from elevon.diagnose.learning.fit import _conformal_error, learned_classes
from elevon.diagnose.learning.labels import LabelledLog, read_labels
from elevon.diagnose.learning.model import LearnedModel, fault_logits
from elevon.diagnose.learning.motion import KnownMotion, LoggedMotion
from elevon.diagnose.learning.trees import Trees
from elevon.errors import FormatError, InputError, OutputExistsError
from tests.cli.conftest import elevon_cli  # noqa: F401 - a fixture
from tests.diagnose.virtual import bench_logs

FAULTS = {"healthy": [], "backlash@transmission": ["backlash@transmission=0.2 deg"],
          "bad": ["short@motor.phase_b=0.25"]}  # fmt: skip
MOTION = KnownMotion(np.linspace(-1.0, 1.0, 200), 1.0, 10.0)


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


def drawn_examples(units, rng, *, exclusive=False, runs=20):
    """Units of known law: each kind moves a number of its own by the root of its severity."""
    kinds = ("a@x", "b@x")
    unit = np.repeat(np.arange(units), runs)
    count = len(unit)
    present = rng.random((count, 2)) < 0.3
    if exclusive:
        present &= present.cumsum(axis=1) == 1
    severity = np.where(present, rng.uniform(0.2, 1.0, (count, 2)) ** 2, 0.0)
    centre = rng.standard_normal((units, 3))[unit]
    shift = np.hstack([np.sqrt(severity), np.zeros((count, 1))])
    values = centre + shift + 0.03 * rng.standard_normal((count, 3))
    names = ("p", "q", "r")
    words = np.array([f"unit {k}" for k in unit])
    none = np.full(count, "")
    return Examples(names, values, kinds, present, severity, ("1",) * 2, words, none)


@pytest.fixture(scope="module")
def from_runs():
    """Of runs of which one may have several kinds."""
    classes, report = learned_classes(drawn_examples(16, np.random.default_rng(1)), MOTION)
    return LearnedModel(None, classes, report)


@pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
def test_a_unit_that_was_not_learnt_is_classed(unit, labelled, learned, tmp_path):
    path = learned.save(tmp_path / "model.npz")
    logs, items = labelled
    base = next(log for log, k in zip(logs, items, strict=True) if k == LabelledLog(
        "healthy", "unit 3", "cold"))  # fmt: skip
    for log, known in zip(logs, items, strict=True):
        if known.unit != "unit 3":
            continue
        answer = elevon.diagnose(log, unit, model=path)
        if log is not base:
            with_baseline = elevon.diagnose(log, unit, base, model=path)
            assert with_baseline.best == answer.best
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
    assert learned.holds == ["classes"]
    for report in (learned.report, learned.report["relative"]):
        left = report["left_out"]
        assert left["unit"]["logs"] == 12
        assert (left["unit"]["healthy"], left["unit"]["faulty"]) == (6, 6)
        assert left["unit"]["right"] >= 11
        assert "condition" in left
    assert len(learned.classes.views["absolute"].healthy) == 6


def test_kinds_that_come_together_are_told_with_their_severity(from_runs):
    classes = from_runs.classes
    assert from_runs.holds == ["classes", "severities"]
    assert not classes.exclusive
    fresh = drawn_examples(20, np.random.default_rng(2)).against_baselines(0)
    says = [classes.says(row[None], relative=True) for row in fresh.values]
    there = np.array([[o.probability[k] > 0.5 for k in classes.kinds] for o in says])
    large = (fresh.severity == 0.0) | (fresh.severity > 0.1)
    assert (there == fresh.present)[large].mean() > 0.97
    chance = np.array([o.chance for o in says])
    healthy = fresh.healthy
    # 200 healthy logs, and a threshold by as many: three deviations of both.
    assert (chance[healthy] <= 0.05).mean() < 0.05 + 3.0 * math.sqrt(2 * 0.05 * 0.95 / 100)
    assert (chance[~healthy] <= 0.05).mean() > 0.9
    inside = [
        o.severity[kind][1] <= x <= o.severity[kind][2]
        for o, row, has in zip(says, fresh.severity, fresh.present, strict=True)
        for kind, x, here in zip(classes.kinds, row, has, strict=True)
        if here
    ]
    assert np.mean(inside) > 0.9 - 3.0 * math.sqrt(0.09 / len(inside)) - 0.02


def test_what_is_given_is_answered_in_ten_milliseconds(from_runs):
    classes = from_runs.classes
    row = drawn_examples(2, np.random.default_rng(3)).values[:1]
    spent = []
    for _ in range(200):
        begin = time.process_time()
        classes.says(row)
        spent.append(time.process_time() - begin)
    assert np.median(spent) < 0.010


def test_several_logs_of_a_unit_are_surer_than_one(from_runs):
    examples = drawn_examples(6, np.random.default_rng(4)).against_baselines(0)
    row = examples.values[np.flatnonzero(examples.present[:, 0] & (examples.severity[:, 0] > 0.3))]
    one, two = (from_runs.classes.says(row[:n], relative=True) for n in (1, 2))
    widths = [np.ptp(o.severity["a@x"][1:]) for o in (one, two)]
    assert widths[1] < widths[0]
    assert two.p_fault >= one.p_fault - 1e-6


def test_exclusive_kinds_share_the_probability():
    examples = drawn_examples(5, np.random.default_rng(5), exclusive=True, runs=12)
    classes, report = learned_classes(examples, MOTION)
    assert classes.exclusive
    opinion = classes.says(examples.values[:1])
    assert sum(opinion.probability.values()) == pytest.approx(opinion.p_fault)
    assert set(report["loss"]) == {"discriminant", "boosting"}


def test_changes_are_against_another_healthy_log_of_the_unit():
    rng = np.random.default_rng(6)
    examples = drawn_examples(5, rng, runs=4)
    examples = replace(examples, values=np.arange(len(examples.unit))[:, None] * np.ones((1, 3)))
    changes = examples.against_baselines(3)
    for word in changes.unit:
        near = np.flatnonzero(examples.healthy & (examples.unit == word))
        assert len(near) >= 1
    rows = [
        k for k, word in enumerate(examples.unit)
        if len(set(np.flatnonzero(examples.healthy & (examples.unit == word))) - {k})
    ]  # fmt: skip
    assert len(changes.values) == len(rows)
    for row, change in zip(rows, changes.values[:, 0], strict=True):
        base = row - int(change)
        assert base != row
        assert examples.healthy[base]
        assert examples.unit[base] == examples.unit[row]


def test_the_file_comes_back(learned, from_runs, tmp_path):
    for number, model in enumerate((learned, from_runs)):
        path = model.save(tmp_path / f"{number}.npz")
        again = LearnedModel.load(path)
        assert again.holds == model.holds
        assert (
            again.report["left_out"]["unit"]["right"] == model.report["left_out"]["unit"]["right"]
        )
        for name, view in model.classes.views.items():
            other = again.classes.views[name]
            np.testing.assert_array_equal(other.discriminant.precision, view.discriminant.precision)
            np.testing.assert_array_equal(other.named, view.named)
        rows = np.random.default_rng(0).standard_normal((3, len(model.classes.features)))
        for row in rows:
            one, two = (m.classes.says(row[None]) for m in (model, again))
            assert two.probability == pytest.approx(one.probability, abs=1e-5)
            assert two.severity.keys() == one.severity.keys()
        with pytest.raises(OutputExistsError):
            model.save(path)


def test_a_file_that_is_none_or_was_changed_anywhere_is_refused(from_runs, tmp_path):
    whole = from_runs.save(tmp_path / "whole.npz").read_bytes()
    bad = tmp_path / "bad.npz"
    for content in (b"", b"text", whole[: len(whole) // 2], whole[:-2000]):
        bad.write_bytes(content)
        with pytest.raises(FormatError, match=r"bad\.npz: is no model of elevon learn"):
            LearnedModel.load(bad)
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    np.savez(tmp_path / "objects.npz", about=np.array([{"a": 1}], dtype=object))
    for name in ("other.npz", "objects.npz"):
        with pytest.raises(FormatError, match="is no model"):
            LearnedModel.load(tmp_path / name)
    row = np.zeros((1, 3))
    expected = from_runs.classes.says(row).probability
    for place in range(40, len(whole), len(whole) // 60):
        bad.write_bytes(whole[:place] + bytes([whole[place] ^ 255]) + whole[place + 1 :])
        try:
            again = LearnedModel.load(bad)
        except FormatError:
            continue
        assert again.classes.says(row).probability == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("absolute.healthy", np.array([np.nan])),
        ("absolute.trees.feature", np.array([99])),
        ("absolute.trees.roots", np.zeros((2, 7), dtype=int)),
        ("absolute.severities.start", np.zeros(3)),
        ("absolute.discriminant.means", np.zeros((2, 3))),
        ("share", np.zeros(1)),
    ],
)
def test_arrays_that_do_not_go_together_are_refused(from_runs, tmp_path, name, value):
    path = from_runs.save(tmp_path / "model.npz")
    with np.load(path) as stored:
        arrays = {key: stored[key] for key in stored.files}
    np.savez(path, **{**arrays, name: value})
    with pytest.raises(FormatError, match="is no model"):
        LearnedModel.load(path)


def test_another_motion_is_refused(unit, labelled, learned):
    slow = bench_logs(unit, [(1, [])], procedure="chirp")[0]
    with pytest.raises(InputError, match="not of the motion"):
        elevon.diagnose(slow, unit, model=learned)
    with pytest.raises(InputError, match="another motion"):
        elevon.learn([labelled[0][0], slow, *labelled[0][1:]], [labelled[1][0], *labelled[1]])
    with pytest.raises(InputError, match="--fault: the classes"):
        elevon.diagnose(labelled[0][0], unit, model=learned, faults=["backlash@transmission"])


def test_a_motion_that_a_plan_varies_is_known_by_its_middle():
    shape = np.linspace(-1.0, 1.0, 200)
    items = [LoggedMotion(f"run {k}", {}, k * shape, 1.0, 10.0) for k in (8.0, 10.0, 12.0)]
    known = KnownMotion.spanning(items)
    assert not any(known.refusal(item) for item in items)
    assert "off by" in known.refusal(replace(items[0], command=20.0 * shape))
    assert "lasts" in known.refusal(replace(items[0], seconds=20.0))


@pytest.mark.parametrize(
    ("labels", "text"),
    [
        (["a"] * 3 + ["b"] * 3, "one must be 'healthy'"),
        (["healthy"] * 6, "all logs are healthy"),
        (["healthy"] * 4 + ["b"] * 2, "2 logs; 3 are needed"),
    ],
)
def test_labels_that_teach_nothing_are_refused(labelled, labels, text):
    with pytest.raises(InputError, match=text):
        elevon.learn(labelled[0][: len(labels)], [LabelledLog(label) for label in labels])
    with pytest.raises(InputError, match="6 logs, but labels of 5"):
        elevon.learn(labelled[0][:6], [LabelledLog()] * 5)


def test_a_table_of_labels_is_read_line_by_line(tmp_path):
    path = tmp_path / "labels.csv"
    path.write_text(
        "log,label,unit,condition,severity,healthy,day\n"
        "a.csv,backlash@transmission,u,cold,0.3 deg,,1\nb.csv,run in,u,warm,,yes,2\n"
        "c.csv,worn,u,warm,2,no,\n"
    )
    one, two, three = read_labels(path, ["a.csv", "b.csv", "c.csv"])
    assert (one.severity, one.severity_unit) == (pytest.approx(math.radians(0.3)), "rad")
    assert (two.label, two.day) == ("healthy", "2")
    assert math.isnan(two.severity)
    assert (three.label, three.severity, three.severity_unit) == ("worn", 2.0, "1")


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("a.csv,healthy,,,0.3,", "of a healthy log"),
        ("a.csv,healthy,,,,no", "its column healthy says no"),
        ("a.csv,worn,,,,perhaps", "yes or no"),
        ("a.csv,worn,,,0,", "other than nought"),
        ("a.csv,backlash@transmission,,,3 kg,", "severity"),
    ],
)
def test_a_line_of_labels_that_contradicts_itself_is_refused(tmp_path, line, text):
    path = tmp_path / "labels.csv"
    path.write_text(f"log,label,unit,condition,severity,healthy\n{line}\n")
    with pytest.raises(InputError, match=text):
        read_labels(path, ["a.csv"])


@pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
def test_spread_and_classes_answer_together(unit, labelled):
    """A label that the model knows, and a word that it has no candidate for."""
    logs, known = labelled
    both = elevon.learn(logs, known, actuator=unit)
    assert both.holds == ["spread", "classes"]
    assert both.report["spread"]["units"] == 4
    healthy, backlash = logs[0], next(x for x in logs if "backlash" in x.name)
    answer = elevon.diagnose(backlash, unit, healthy, model=both)
    assert answer.best == ("backlash@transmission",)
    assert answer.method == "model"
    assert answer.false_alarm == 0.05
    assert any(text.startswith("the learnt classes: ") for text in answer.findings)
    slow = bench_logs(unit, [(1, [])], procedure="chirp")[0]
    alone = elevon.diagnose(slow, unit, model=both)
    assert any("the learnt classes give no answer" in text for text in alone.findings)


PLAN = """
name = "small"
actuator = "torino-rotary"
fidelity = "low"
record = ["command,encoder_position,resolver_position,resolver_speed,current_q_meas@200 Hz"]
[scenario]
duration = "4 s"
[[scenario.command.terms]]
kind = "sine"
amplitude = "7 deg"
frequency = "0.5 Hz"
[population]
units = 8
points = 1
seed = 1
[[population.spread]]
parameter = "friction.dynamic"
sd = "10 %"
[random]
count = 8
method = "uniform"
seed = 5
[[random.draw]]
fault = "backlash@transmission"
from = "0.1 deg"
to = "0.5 deg"
probability = 0.4
[[random.draw]]
fault = "friction@transmission"
from = "0.3"
to = "1.2"
probability = 0.4
"""


def test_a_data_set_has_its_own_labels(elevon_cli, tmp_path, unit):  # noqa: F811
    (tmp_path / "plan.toml").write_text(PLAN)
    (tmp_path / "labels.csv").write_text("log,label\n")
    folder = tmp_path / "set"
    assert elevon_cli("campaign", "run", tmp_path / "plan.toml", "--out", folder).code == 0
    out = tmp_path / "model.npz"
    result = elevon_cli("learn", folder, "--out", out, "--json")
    assert result.code == 0, result.err
    answer = json.loads(result.out)
    assert answer["holds"] == ["classes", "severities"]
    assert answer["logs"] == 64
    refused = elevon_cli("learn", folder, "--labels", tmp_path / "labels.csv", "--out", "x.npz")
    assert refused.code == 2
    assert "its own labels" in refused.err
    ds = load_campaign(folder)
    examples, motion, lost, _ = examples_of_dataset(ds, 4.0)
    assert not lost
    assert examples.kinds == ("backlash@transmission", "friction@transmission")
    assert 10 < examples.healthy.sum() < 40
    assert not motion.refusal(LoggedMotion("", {}, motion.command, motion.pace, motion.seconds))
    run = int(np.flatnonzero(examples.present[:, 0] & ~examples.present[:, 1])[0])
    path = tmp_path / "run.parquet"
    ds.recording(run).save(path)
    result = elevon_cli("diagnose", path, "--actuator", "torino-rotary", "--model", out, "--json")
    assert result.code == 0, result.err
    data = json.loads(result.out)
    assert data["method"] == "learned"
    assert data["best"]["faults"] == ["backlash@transmission"]
    cause = data["faults"][0]
    assert cause["interval"][0] < cause["severity"] < cause["interval"][1]
    bad = elevon_cli("diagnose", path, "--actuator", "torino-rotary", "--model", path)
    assert bad.code == 2
    assert "is no model of elevon learn" in bad.err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("learn-spread", "log.csv"), "Did you mean learn"),
        (("diagnose-train", "--out", "x.npz"), "Did you mean learn"),
        (("campaign", "surrogate", "set"), "elevon learn DATASET"),
        (("dataset", "score", "set"), "python -m studies"),
        (("diagnose", "log.csv", "--spread", "s.toml"), "give --model MODEL"),
        (("diagnose", "log.csv", "--surrogate", "s.npz"), "give --model MODEL"),
    ],
)
def test_commands_and_options_that_went_name_what_took_their_place(elevon_cli, words, text):  # noqa: F811
    result = elevon_cli(*words)
    assert result.code == 2
    assert text in result.err


@pytest.mark.parametrize("classes", [2, 3])
def test_trees_as_arrays_say_what_the_library_says(classes):
    ensemble = pytest.importorskip("sklearn.ensemble")
    rng = np.random.default_rng(classes)
    values = rng.standard_normal((60, 4)).astype(np.float32)
    labels = (values[:, 0] + rng.normal(0.0, 0.3, 60) > 0.0).astype(int)
    labels += (values[:, 1] > 0.5) * (classes == 3)
    model = ensemble.GradientBoostingClassifier(init="zero", n_estimators=8, random_state=0)
    model.fit(values, labels)
    scores = Trees.stored(Trees.of(model).arrays()).scores(values.astype(float))
    if classes == 2:
        scores = np.hstack((np.zeros_like(scores), scores))
    share = np.exp(scores - np.logaddexp.reduce(scores, axis=1)[:, None])
    np.testing.assert_allclose(share, model.predict_proba(values), atol=1e-9)


def test_trees_of_a_number_say_what_the_library_says():
    ensemble = pytest.importorskip("sklearn.ensemble")
    rng = np.random.default_rng(2)
    values = rng.standard_normal((300, 4)).astype(np.float32).astype(float)
    model = ensemble.GradientBoostingRegressor(init="zero", n_estimators=8, max_leaf_nodes=6)
    model.fit(values, values[:, 0] + rng.normal(0.0, 0.3, 300))
    trees = Trees.of(model)
    both = Trees.joined([trees, Trees.constant(8)])
    scores = Trees.stored(both.arrays()).scores(values)
    np.testing.assert_allclose(scores[:, 0], model.predict(values), atol=1e-5)
    assert not scores[:, 1].any()


def test_trees_that_go_round_are_refused():
    node = {"feature": [0, 0], "left": [1, 0], "right": [1, 0], "roots": [[0]],
            "threshold": [0.0, 0.0], "value": [0.0, 0.0]}  # fmt: skip
    with pytest.raises(ValueError, match="leads back"):
        Trees.build({name: np.array(value) for name, value in node.items()})


def test_the_logit_of_any_fault_sums_the_faults():
    scores = np.log([[0.2, 0.3, 0.5]])
    assert fault_logits(scores, ["a", "healthy", "b"], True)[0] == pytest.approx(np.log(0.7 / 0.3))
    there = np.array([[0.2, 0.3]])
    logits = np.log(there / (1.0 - there))
    assert fault_logits(logits, [], False)[0] == pytest.approx(np.log((1.0 - 0.56) / 0.56))


def test_an_interval_holds_the_rank_of_the_next_error():
    assert _conformal_error(np.arange(1.0, 10.0)) == 9.0
    assert _conformal_error(np.arange(1.0, 20.0)) == 18.0
