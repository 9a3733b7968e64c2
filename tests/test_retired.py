"""Retired names: refused when given, mapped when an old file is read."""

import tarfile
import warnings
from pathlib import Path

import pytest

import elevon
from elevon.errors import (
    DamageError,
    InputError,
    RetiredNamesWarning,
    UnknownNameError,
    nearest,
)
from elevon.faults import find_record
from elevon.retired import current, mapped, successors

OLD = Path(__file__).parent / "recording" / "old"
FORMATS = ("parquet", "nc", "csv", "mat")


@pytest.mark.parametrize("ending", FORMATS)
def test_an_old_recording_loads_with_the_present_names_and_says_so_once(ending):
    with pytest.warns(RetiredNamesWarning, match="user_position, user_speed") as caught:
        recording = elevon.Recording.load(OLD / f"rec.{ending}")
    assert len(caught) == 1
    assert caught[0].filename == __file__
    names = [channel.name for channel in recording.channels]
    assert names == ["output_position", "output_speed", "motor_speed", "fault_1"]
    assert recording["output_position"].text == "output position"
    assert recording["fault_1"].text == "severity of backlash@transmission"
    assert recording.meta["roles"]["output_position"] == "output_position"
    assert recording.meta["faults"] == ["backlash@transmission=0.01:step(time=0.02 s)"]
    assert list(recording.meta["scenario"]["load"]) == ["output"]
    assert recording.labels[0]["kind"] == "backlash"
    assert "output_speed" in recording.final
    assert "user_speed" not in recording.final


@pytest.mark.parametrize("ending", FORMATS)
def test_an_old_recording_keeps_every_bit(ending):
    with pytest.warns(RetiredNamesWarning):
        recording = elevon.Recording.load(OLD / f"rec.{ending}")
    titles, *rows = (OLD / "rec.csv").read_text("utf-8").splitlines()
    assert titles.startswith("time [s],user_position [rad],user_speed [rad/s]")
    columns = list(zip(*([float(cell) for cell in row.split(",")] for row in rows), strict=True))
    assert recording.clock().time.tolist() == list(columns[0])
    for channel, values in zip(recording.channels, columns[1:], strict=True):
        assert channel.values.tolist() == list(values), channel.name


@pytest.mark.parametrize("ending", FORMATS)
def test_an_old_recording_saved_is_a_new_one(tmp_path, ending):
    with pytest.warns(RetiredNamesWarning):
        recording = elevon.Recording.load(OLD / f"rec.{ending}")
    path = recording.save(tmp_path / f"new.{ending}")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert elevon.Recording.load(path).equals(recording)


def test_the_checksum_of_an_old_file_is_that_of_its_old_content(tmp_path):
    table = tmp_path / "rec.csv"
    table.write_bytes((OLD / "rec.csv").read_bytes())
    text = (OLD / "rec.csv.json").read_text("utf-8")
    (tmp_path / "rec.csv.json").write_text(text.replace("user speed", "user Speed"))
    with pytest.raises(DamageError):
        elevon.Recording.load(table)


@pytest.mark.parametrize(
    ("word", "place", "first"),
    [
        ("play", "transmission", "backlash"),
        ("freeplay", "transmission", "backlash"),
        ("free-play", "transmission", "backlash"),
        ("lash", "transmission", "backlash"),
        ("winding_short", "motor.phase_a", "short"),
        ("winding_short", "sensor.resolver.sine", "resolver_short"),
        ("winding_open", "sensor.resolver.sine", "resolver_open"),
        ("turn_short", "motor.phase_a", "short"),
        ("wear", "gear", "tooth_wear"),
        ("wear", "transmission", "backlash"),
        ("stiction", "transmission", "friction"),
        ("bearing_wear", "bearing.inner", "bearing"),
    ],
)
def test_a_fault_that_people_try_is_refused_with_what_it_is_called(word, place, first):
    with pytest.raises(UnknownNameError) as caught:
        find_record(word, place, "ballscrew")
    assert caught.value.nearest[0] == first
    assert f"did you mean '{first}'" in str(caught.value)


def test_wear_may_be_either():
    with pytest.raises(UnknownNameError) as caught:
        find_record("wear", "gear", "ballscrew")
    assert caught.value.nearest[:2] == ["tooth_wear", "backlash"]


def test_overheating_is_no_fault():
    with pytest.raises(UnknownNameError, match="not a fault: see thermal"):
        find_record("overheat", "motor", "rotary")


@pytest.mark.parametrize(
    ("act", "present"),
    [
        (lambda: elevon.Session("torino-rotary").set(user=1.0), "'output'"),
        (lambda: _load("torino-rotary").with_values({"play.total": 0.1}), "'backlash.total'"),
        (lambda: _load("torino-rotary").with_values({"play.totl": 0.1}), "'backlash.total'"),
        (
            lambda: _load("torino-rotary").with_values({"control.position_feedback": "user"}),
            "'output'",
        ),
        (
            lambda: elevon.Scenario.from_dict({"duration": "1 s", "load": {"user": {}}}),
            "'output'",
        ),
        (
            lambda: elevon.simulate(
                "torino-rotary", {"duration": "0.01 s"}, record="user_position@400 Hz"
            ),
            "'output_position'",
        ),
        (
            lambda: elevon.simulate(
                "torino-rotary", {"duration": "0.01 s", "fault": ["play@transmission=0.1 deg"]}
            ),
            "'backlash'",
        ),
    ],
    ids=["port", "parameter", "misspelt", "choice", "load", "signal", "fault"],
)
def test_an_old_name_is_refused_with_the_present_one_first(act, present):
    with pytest.raises(InputError) as caught:
        act()
    offered = str(caught.value).replace("valid: ", "did you mean ").partition("did you mean ")[2]
    assert offered.startswith(present)


def _load(name):
    return elevon.Actuator.load(name)


def test_the_present_name_is_first_among_near_ones():
    assert nearest("user_position", ["motor_position", "output_position"])[0] == "output_position"
    assert nearest("play.total", ["relay.total", "backlash.total"])[0] == "backlash.total"
    assert successors("stiction", ["friction.static", "gear.ratio"]) == ["friction.static"]
    assert successors("play", ["gear.ratio"]) == []


def test_only_names_are_replaced():
    assert current("replay play user users display") == "replay play user users display"
    assert current("user_positions") == "user_positions"
    assert mapped({"user": "user", "kind": "play"}) == {"user": "user", "kind": "play"}
    fault = {"kind": "play", "place": "transmission", "severity": 1}
    assert mapped([fault])[0]["kind"] == "backlash"
    entry = {"path": "control.position_feedback", "value": "user", "note": "user"}
    assert mapped(entry) == {**entry, "value": "output"}


def test_an_old_data_set_takes_no_old_name(tmp_path):
    with tarfile.open(OLD.parents[1] / "campaign" / "old" / "campaign.tar.gz") as archive:
        archive.extractall(tmp_path, filter="data")
    with pytest.warns(RetiredNamesWarning):
        ds = elevon.load_campaign(tmp_path / "campaign")
    with pytest.raises(UnknownNameError, match="did you mean 'output_position'"):
        ds.signals.to_arrow(["user_position"])
