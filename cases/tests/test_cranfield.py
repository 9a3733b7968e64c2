"""`elevon reproduce cranfield`: on made-up tables, and on the data where they are."""

import json

import numpy as np
import pytest

from elevon.cli import main
from elevon.errors import InputError
from elevon_cases.cranfield.data import read_folder
from elevon_cases.cranfield.judge import detect, leave_load_out, leave_run_out
from elevon_cases.cranfield.result import cranfield_page, evaluate
from tests.diagnose.cycles import CLASSES, HEADER, write_condition


@pytest.fixture(autouse=True)
def few_draws(monkeypatch):
    monkeypatch.setattr("elevon_cases.cranfield.result.DRAWS", 20)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("cranfield")
    for condition in CLASSES:
        write_condition(path, condition)
    (path / "README.md").write_text("not data")
    (path / "other.csv").write_text(HEADER)
    return path


@pytest.fixture(scope="module")
def data(folder):
    return read_folder(folder)


def test_folder_is_named_file_by_file(data):
    assert len(data.condition) == 4 * 3 * 3
    assert data.present()[0] == {"condition": "normal", "load_kgf": -40.0, "runs": [8, 9, 10]}
    named = "\n".join(data.skipped)
    assert "README.md" in named
    assert "other.csv" in named
    assert "backlash1: absent" in named


def test_nobody_answers_for_what_it_was_trained_on(data, monkeypatch):
    from elevon_cases.cranfield import judge

    splits = []
    inner = judge._answer

    def watched(data, x, train, test, how):
        splits.append((train, test))
        return inner(data, x, train, test, how)

    monkeypatch.setattr(judge, "_answer", watched)
    answers = leave_load_out(data, tuple(CLASSES), ("hold_noise", "tracking_slow"))
    assert len(answers.truth) == len(data.condition)
    for train, test in splits:
        assert not set(data.load[train]) & set(data.load[test])
    splits.clear()
    answers = leave_run_out(data, ("hold_noise", "tracking_slow"))
    assert len(answers.truth) == len(data.condition)
    for train, test in splits:
        assert set(data.load[train]) == set(data.load[test])
        assert not set(data.run[train]) & set(data.run[test])


def test_figures_of_made_up_faults(data):
    result = evaluate(data)
    values = result.to_dict()
    assert values["three_class_macro_f1_mean"] > 0.9
    assert values["four_family_grouped_accuracy_worst"] > 0.9
    assert values["missing"] == []
    assert values["detection_rate"]["lackLubrication2"] == 1.0
    assert values["detection_rate"]["normal"] <= 3 / 9
    assert {row["load_kgf"] for row in values["rows"]} == {"-40", "20", "40", "mean", "worst"}
    assert all(0.0 <= row["low"] <= row["high"] <= 1.0 for row in values["rows"])
    json.dumps(values, allow_nan=False)
    page = cranfield_page(result).html()
    assert page.index("distinguished with") < page.index("<svg")


def test_shuffled_labels_are_not_learned(data):
    from dataclasses import replace

    random = np.random.default_rng(0)
    shuffled = replace(data, condition=random.permutation(data.condition))
    result = evaluate(shuffled)
    scores = [f.value for f in result.figures if f.figure == "four families" and f.load == "mean"]
    # Four classes at random: 0.25; a leak of the truth would show as a high score.
    assert max(scores) < 0.6


def test_a_folder_without_what_a_figure_needs(tmp_path, capsys):
    write_condition(tmp_path, "normal", loads=(20,), runs=(3, 5))
    write_condition(tmp_path, "spalling1", loads=(20,), runs=(3, 5))
    assert main(["reproduce", "cranfield", "--data", str(tmp_path), "--json"]) == 1
    values = json.loads(capsys.readouterr().out)
    assert values["status"] == "fail"
    assert "three_class_macro_f1_mean" in values["missing"]
    assert values["three_class_macro_f1_mean"] is None
    assert values["four_family_grouped_accuracy_worst"] is not None


@pytest.mark.parametrize("content", [None, {}, {"normal.csv": "a,b\n1,2\n"}])
def test_bad_folders(tmp_path, content, capsys):
    folder = tmp_path / "data"
    if content is not None:
        folder.mkdir()
        for name, text in content.items():
            (folder / name).write_text(text)
    assert main(["reproduce", "cranfield", "--data", str(folder), "--json"]) == 2
    assert capsys.readouterr().out == ""


def test_a_run_that_stands_twice_is_used_once(tmp_path):
    write_condition(tmp_path, "normal", loads=(20, 40), runs=(1, 2))
    path = tmp_path / "normal.csv"
    body = path.read_text().removeprefix(HEADER)
    path.write_text(HEADER + body + body)
    data = read_folder(tmp_path)
    assert len(data.condition) == 4
    assert sum("second part" in line for line in data.skipped) == 4
    with pytest.raises(InputError, match="no such folder"):
        read_folder(tmp_path / "absent")


def test_false_alarms_are_those_of_recordings_left_out(data):
    rows = {d.condition: d for d in detect(data)}
    assert rows["normal"].count == 9
    assert rows["lackLubrication2"].hits == 9
    assert rows["normal"].hits_sessions is None  # the stages that stand for sessions are absent


@pytest.mark.shared
@pytest.mark.long
def test_the_real_data(shared):
    folder = shared / "data" / "cranfield"
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent: the Cranfield data are not part of this project")
    result = evaluate(read_folder(folder))
    assert result.status == "pass"
    assert result.headline["four_family_load_out_macro_f1"] > 0.465  # a public figure
