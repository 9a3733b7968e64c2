"""Every format gives back every bit."""

import numpy as np
import pytest
from hypothesis import given, settings

from elevon import Clock, Recording
from elevon.errors import (
    InputError,
    OutputError,
    OutputExistsError,
    UnknownNameError,
)
from tests.recording.make import ALL, MANY_CLOCKS, one_clock, ordinary, plain_doubles, recordings


@pytest.mark.parametrize("ending", ALL)
def test_several_clocks_come_back_to_the_bit(tmp_path, ending):
    recording = ordinary()
    assert Recording.load(recording.save(tmp_path / f"a{ending}")).equals(recording)


@pytest.mark.parametrize("ending", ALL)
def test_one_clock_comes_back_to_the_bit(tmp_path, ending):
    recording = one_clock()
    loaded = Recording.load(recording.save(tmp_path / f"a{ending.upper()}"))
    assert loaded.equals(recording)
    assert loaded.clocks["cell"].gaps == (2,)


@pytest.mark.parametrize("ending", MANY_CLOCKS)
@given(recording=recordings())
@settings(max_examples=25)
def test_any_recording_comes_back(tmp_path_factory, ending, recording):
    path = tmp_path_factory.mktemp("any") / f"a{ending}"
    recording.save(path)
    assert Recording.load(path).equals(recording)


@given(recording=recordings(most_clocks=1, numbers=plain_doubles))
@settings(max_examples=25)
def test_any_recording_of_one_clock_comes_back_from_csv(tmp_path_factory, recording):
    path = tmp_path_factory.mktemp("any") / "a.csv"
    recording.save(path)
    assert Recording.load(path).equals(recording)


@pytest.mark.parametrize("ending", ALL)
def test_many_samples_come_back(tmp_path, ending):
    """More than one row group, block or chunk."""
    count = 300_001
    values = np.random.default_rng(1).normal(size=count)
    recording = Recording.build(np.arange(count) * 1e-6, {"x": values}, {"x": "rad"}, rate=1e6)
    assert Recording.load(recording.save(tmp_path / f"a{ending}")).equals(recording)


def test_two_clocks_of_several_row_groups(tmp_path):
    count = 270_000
    time = np.arange(count) * 1e-6
    first = Recording.build(time, {"x": time}, {"x": "rad"}, clock="one")
    second = Recording.build(time + 0.5, {"y": -time}, {"y": "rad"}, clock="two")
    both = first.joined(second)
    assert Recording.load(both.save(tmp_path / "a.parquet")).equals(both)


@pytest.mark.parametrize("ending", ALL)
def test_the_same_recording_is_the_same_bytes_at_any_time_of_day(tmp_path, ending, monkeypatch):
    first = one_clock().save(tmp_path / f"a{ending}").read_bytes()
    monkeypatch.setattr("time.time", lambda: 1e9)
    monkeypatch.setattr("time.asctime", lambda: "Sun Sep  9 01:46:40 2001")
    second = one_clock().save(tmp_path / f"a{ending}", force=True).read_bytes()
    assert first == second


def test_nothing_to_save_is_saved(tmp_path):
    empty = Recording([], clocks=[Clock("main", [])], meta={"status": "interrupted"})
    for ending in ALL:
        assert Recording.load(empty.save(tmp_path / f"a{ending}")).equals(empty)


@pytest.mark.parametrize("name", ["a.hdf5", "a", "a.parquett", "a.xlsx"])
def test_unknown_endings_name_the_valid_ones(tmp_path, name):
    with pytest.raises(UnknownNameError, match=r"\.parquet"):
        ordinary().save(tmp_path / name)
    with pytest.raises(UnknownNameError, match=r"\.parquet"):
        Recording.load(tmp_path / name)


@pytest.mark.parametrize("ending", ALL)
def test_no_overwrite_without_force(tmp_path, ending):
    path = one_clock().save(tmp_path / f"a{ending}")
    before = path.read_bytes()
    with pytest.raises(OutputExistsError, match="--force"):
        one_clock().with_meta(other=1).save(path)
    assert path.read_bytes() == before
    one_clock().with_meta(other=1).save(path, force=True)
    assert Recording.load(path).meta["other"] == 1


@pytest.mark.parametrize("ending", ALL)
def test_an_unwritable_place_is_a_clear_error(tmp_path, ending):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot make the folder"):
        one_clock().save(tmp_path / "file" / f"a{ending}")


def test_a_missing_file_names_its_neighbour(tmp_path):
    one_clock().save(tmp_path / "run_1.csv")
    with pytest.raises(InputError, match=r"no such file; did you mean 'run_1\.csv'"):
        Recording.load(tmp_path / "run1.csv")
