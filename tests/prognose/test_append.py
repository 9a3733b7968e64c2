"""An answer is added to a history: whole, later than the last, of the same unit; or not at all."""

import json

import pytest

from elevon.diagnose.engine.answer import Cause, Diagnosis
from elevon.errors import InputError, OutputExistsError
from elevon.prognose import LAWS
from elevon.prognose.history import next_entry, read_history

KEY = "backlash@transmission"


def answer(severity=2e-3, status="faulty"):
    cause = Cause("backlash", "transmission", "rad", 0.99, severity, (severity / 2, severity * 2))
    return Diagnosis(
        ("day.csv",), status, 0.99, 0.05, 0.001, (cause,), (KEY,), 0.98, (), {KEY: 1e-4}, (), (),
        0.1, actuator="unit",
    )  # fmt: skip


def test_a_history_begins_and_grows_and_is_what_predict_reads(tmp_path):
    place = tmp_path / "unit" / "history"
    next_entry(place, "600 flights", "unit").write(answer(1e-3))
    next_entry(place, "1300", "unit").write(answer(2e-3))
    history = read_history(place, unit="flights")
    seen = [item.seen[KEY].severity for item in history.inspections([LAWS["gear_wear"]])]
    assert [entry.usage for entry in history.entries] == [600.0, 1300.0]
    assert seen == [1e-3, 2e-3]


def test_a_serial_number_of_the_history_is_the_inspections_too(tmp_path):
    stamp = {"usage": 100, "unit": "hours", "serial": "A 17", "faults": []}
    (tmp_path / "a.json").write_text(json.dumps(stamp))
    written = next_entry(tmp_path, 200, "unit").write(answer())
    assert json.loads(written.read_text())["serial"] == "A 17"
    assert json.loads(written.read_text())["unit"] == "hours"


@pytest.mark.parametrize(
    ("usage", "actuator", "text"),
    [
        ("1200 flights", "unit", r"--usage 1200: flights-1300.json .*made at 1300 flights"),
        ("1300", "unit", "comes after it"),
        ("1400", "other", "is of unit, this one of other"),
        ("1400 hours", "unit", "counted in flights"),
        ("1400 flight", "unit", "did you mean 'flights'"),
        ("many", "unit", "'many': is not a use such as '1300 flights'"),
        ("-5", "unit", "is not a use"),
        ("nan", "unit", "is not a use"),
    ],
)
def test_what_cannot_be_the_next_is_refused_and_nothing_changes(tmp_path, usage, actuator, text):
    next_entry(tmp_path, "1300 flights", "unit").write(answer())
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(InputError, match=text):
        next_entry(tmp_path, usage, actuator)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_the_first_inspection_states_the_unit_of_use(tmp_path):
    with pytest.raises(InputError, match="of what"):
        next_entry(tmp_path / "new", "600", "unit")
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("status", ["unknown_fault", "model_does_not_fit"])
def test_an_answer_without_a_severity_is_no_inspection(tmp_path, status):
    place = next_entry(tmp_path / "new", "600 hours", "unit")
    with pytest.raises(InputError, match=f"not written: the answer is {status}"):
        place.write(answer(status=status))
    assert list((tmp_path / "new").iterdir()) == []


def test_two_at_once_do_not_replace_each_other(tmp_path):
    first, second = (next_entry(tmp_path, "600 flights", "unit") for _ in range(2))
    written = first.write(answer(1e-3))
    with pytest.raises(OutputExistsError):
        second.write(answer(5e-3))
    assert json.loads(written.read_text())["faults"][0]["severity"] == 1e-3


def test_force_replaces_the_last_inspection_and_no_other(tmp_path):
    next_entry(tmp_path, "600 flights", "unit").write(answer(1e-3))
    next_entry(tmp_path, "900", "unit").write(answer(2e-3))
    next_entry(tmp_path, "900", "unit", force=True).write(answer(3e-3))
    history = read_history(tmp_path, unit="flights")
    seen = [item.seen[KEY].severity for item in history.inspections([LAWS["gear_wear"]])]
    assert seen == [1e-3, 3e-3]
    with pytest.raises(InputError, match="comes after it"):
        next_entry(tmp_path, "600", "unit", force=True)
