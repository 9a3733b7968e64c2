"""What a history's inspections say, or why they are refused, and how their logs are diagnosed."""

import json

import pytest

from elevon import Actuator
from elevon.errors import FormatError, InputError, Interrupted
from elevon.prognose import LAWS
from elevon.prognose.history import diagnosed, read_history

KEY = "backlash@transmission"
CAUSE = {"kind": "backlash", "place": "transmission", "probability": 0.9, "severity": 2e-3,
         "interval": [1e-3, 3e-3]}  # fmt: skip
STAMP = {"usage": 300, "unit": "flights"}


def history(place, *entries):
    place.mkdir(exist_ok=True)
    for k, entry in enumerate(entries):
        (place / f"{k}.json").write_text(json.dumps({**STAMP, "usage": 100 * k, **entry}))
    return read_history(place, unit="flights")


@pytest.mark.parametrize(
    ("entry", "text"),
    [
        ({"faults": {"kind": "backlash"}}, "0.json: faults = .* is not a list"),
        ({"faults": [{"kind": "backlash"}]}, r"0.json: faults\[0\]: 'place' is missing"),
        ({"faults": ["backlash"]}, r"faults\[0\] = 'backlash' is not a table"),
        ({"faults": [{**CAUSE, "probability": "high"}]}, r"faults\[0\]: .*probability"),
        ({"faults": [{**CAUSE, "probability": 1.5}]}, "probability = 1.5 is outside 0 to 1"),
        ({"faults": [{**CAUSE, "severity": None}]}, f"0.json: {KEY}: .* not numbers"),
        ({"faults": [{**CAUSE, "severity": 5e-3}]}, "severity 0.005 is not within 0.001 to 0.003"),
        ({"faults": [], "detectable": [KEY]}, "0.json: detectable = "),
        ({"faults": [], "detectable": {KEY: 0.0}}, f"detectable {KEY} = 0.0 is no number above 0"),
        ({"faults": [{**CAUSE, "severity": 10**400}]}, r"0.json: faults\[0\]: severity: int too"),
        ({"faults": [], "detectable": {KEY: 10**400}}, "is no number above 0"),
        ({"faults": [{**CAUSE, "equivalents": []}]}, "'equivalents'; did you mean 'ambiguous_with"),
        ({"faults": [CAUSE], "reset": ["ply@transmission"]}, "reset: .*did you mean 'backlash@"),
    ],
)
def test_a_diagnosis_that_is_none_is_refused_by_file_place_and_value(tmp_path, entry, text):
    with pytest.raises(InputError, match=text):
        history(tmp_path, entry).inspections([LAWS["gear_wear"]])


def test_a_part_that_no_law_of_this_mission_drives_may_be_made_new(tmp_path):
    entry = {"faults": [CAUSE], "reset": ["short@motor.phase_b", "bearing@bearing.inner"]}
    (seen,) = history(tmp_path, entry).inspections([LAWS["gear_wear"]])
    assert seen.seen[KEY].severity == 2e-3


class Answer:
    def to_dict(self):
        return {"faults": [CAUSE], "detectable": {KEY: 1e-4}}


@pytest.mark.parametrize("name", ["torino-rotary", "nasa-ballscrew"])
def test_all_logs_of_an_inspection_are_one_diagnosis_against_all_healthy_ones(
    tmp_path, monkeypatch, name
):
    """Which of the healthy logs are of a log's own test is the diagnosis' business."""
    from elevon.diagnose import door
    from elevon.prognose import history as room

    calls = []

    def answered(logs, actuator, baselines):
        calls.append((actuator.name, logs, baselines))
        return Answer()

    monkeypatch.setattr(door, "diagnose", answered)
    monkeypatch.setattr(room, "_read", lambda logs: [path.name for path, _ in logs])
    for log in ("a0", "b0", "a1", "b1", "a2", "b2", "c2"):
        (tmp_path / log).touch()
    read = history(
        tmp_path,
        {"logs": ["a0", "b0"], "healthy": True},
        {"logs": ["a1", "b1"], "healthy": True},
        {"logs": ["a2", "b2", "c2"]},
        {"faults": [CAUSE]},
    )
    done = diagnosed(read, Actuator.load(name))
    healthy = ["a0", "b0", "a1", "b1"]
    logs = [["a0", "b0"], ["a1", "b1"], ["a2", "b2", "c2"]]
    assert calls == [(name, group, healthy) for group in logs]
    seen = done.inspections([LAWS["gear_wear"]])
    assert [item.seen[KEY].severity for item in seen] == [2e-3] * 4
    with pytest.raises(Interrupted):
        diagnosed(read, Actuator.load(name), progress=lambda _: False)


def test_a_log_that_cannot_be_diagnosed_is_named_with_its_inspection(tmp_path):
    (tmp_path / "a.csv").write_text("time,speed\n0,1\n")
    read = history(tmp_path, {"logs": ["a.csv"]})
    with pytest.raises(InputError, match=r"0\.json: .*a\.csv"):
        diagnosed(read, Actuator.load("torino-rotary"))


def test_each_log_may_have_its_map(tmp_path):
    for log in ("a.csv", "b.csv", "own.toml"):
        (tmp_path / log).touch()
    one = history(tmp_path / "one", {"logs": ["../a.csv", "../b.csv"], "map": "torino"})
    assert [column_map for _, column_map in one.entries[0].logs] == ["torino", "torino"]
    each = history(
        tmp_path / "each", {"logs": ["../a.csv", "../b.csv"], "map": ["torino", "../own.toml"]}
    )
    known = [column_map for _, column_map in each.entries[0].logs]
    assert known == ["torino", tmp_path / "each" / "../own.toml"]
    with pytest.raises(FormatError, match="map names 1 for 2 logs"):
        history(tmp_path / "few", {"logs": ["../a.csv", "../b.csv"], "map": ["torino"]})
