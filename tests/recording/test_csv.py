"""Recordings in CSV: plain tables with a description beside them."""

import json
import multiprocessing
import os

import numpy as np
import pandas as pd
import pytest

from elevon import Recording, files
from elevon.errors import (
    DamageError,
    FormatError,
    InputError,
    OutputExistsError,
    UncheckedWarning,
)
from elevon.recording import csv
from tests.recording.make import one_clock, ordinary


def test_csv_of_several_clocks_is_one_table_a_clock(tmp_path):
    ordinary().save(tmp_path / "a.csv")
    names = ["a.cell.csv", "a.cell.csv.json", "a.drive.csv", "a.drive.csv.json"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    cell = Recording.load(tmp_path / "a.cell.csv")
    assert cell.equals(ordinary().select(clock="cell"))
    with pytest.raises(OutputExistsError, match=r"a\.drive\.csv"):
        ordinary().save(tmp_path / "a.csv")
    ordinary().with_meta(seed=4).save(tmp_path / "b.csv")
    for ending in (".csv", ".csv.json"):
        (tmp_path / f"b.cell{ending}").write_bytes((tmp_path / f"a.cell{ending}").read_bytes())
    b = json.loads((tmp_path / "b.cell.csv.json").read_text())
    (tmp_path / "b.cell.csv.json").write_text(
        json.dumps({**b, "files": ["b.drive.csv", "b.cell.csv"]})
    )
    with pytest.raises(DamageError, match="not of one recording"):
        Recording.load(tmp_path / "b.csv")
    (tmp_path / "a.cell.csv").unlink()
    with pytest.raises(DamageError, match=r"a\.cell\.csv is missing"):
        Recording.load(tmp_path / "a.csv")


def test_csv_of_one_clock_replaced_by_several(tmp_path):
    path = one_clock().save(tmp_path / "a.csv")
    assert Recording.load(ordinary().save(path, force=True)).equals(ordinary())


def test_csv_without_a_clock(tmp_path):
    with pytest.raises(InputError, match="the recording has none"):
        Recording([]).save(tmp_path / "a.csv")


def test_csv_is_plain_text_with_units(tmp_path):
    lines = one_clock().save(tmp_path / "a.csv").read_text().splitlines()
    assert lines[0] == "time [s],force [N]"
    assert lines[1] == "0,1"
    assert len(lines) == 6
    table = pd.read_csv(tmp_path / "a.csv")
    assert list(table.columns) == ["time [s]", "force [N]"]
    written = np.column_stack([one_clock().clock().time, one_clock()["force"].values])
    np.testing.assert_allclose(table.to_numpy(), written, rtol=1e-15, atol=1e-300)


def test_csv_without_the_file_beside_it_says_so(tmp_path):
    path = one_clock().save(tmp_path / "a.csv")
    path.with_name("a.csv.json").unlink()
    with pytest.warns(UncheckedWarning, match=r"no a\.csv\.json beside it") as caught:
        recording = Recording.load(path)
    assert caught[0].filename == __file__
    assert recording["force"].values.tobytes() == one_clock()["force"].values.tobytes()
    assert recording.meta == {}


def test_csv_changed_since_is_an_error(tmp_path):
    path = one_clock().save(tmp_path / "a.csv")
    path.write_text(path.read_text().replace("0,1\n", "0,2\n"))
    with pytest.raises(DamageError, match=r"not the bytes that a\.csv\.json describes"):
        Recording.load(path)


def test_csv_of_an_earlier_version_says_what_to_do(tmp_path):
    (tmp_path / "a.csv").write_text('# elevon {"schema":2}\ntime [s],x [rad]\n0,1\n')
    with pytest.raises(FormatError, match="description in the first line"):
        Recording.load(tmp_path / "a.csv")


@pytest.mark.parametrize("step", ["description", "table"])
def test_a_replacement_cut_short_leaves_one_whole_recording(tmp_path, monkeypatch, step):
    """The process ends right after the description, or right after the table, has its name."""
    path = one_clock().save(tmp_path / "a.csv")
    new = one_clock().with_meta(seed=9)
    changed = Recording.build([0, 1], {"x": [1, 2]}, {"x": "rad"}, meta={"seed": 9})
    saved = csv.write_description

    class Killed(BaseException):
        pass

    def killed(table, about, *, keep_old):
        if step == "table" and not keep_old:
            raise Killed
        saved(table, about, keep_old=keep_old)
        if step == "description":
            raise Killed

    # A table of the very same bytes is whole with the new description at once.
    old = one_clock() if step == "description" else changed
    for later, expected in ((changed, old), (new, new)):
        with monkeypatch.context() as patch:
            patch.setattr(csv, "write_description", killed)
            with pytest.raises(Killed):
                later.save(path, force=True)
        assert Recording.load(path).equals(expected)
        one_clock().save(path, force=True)


def _killed_at(save, at):
    """Save in a process that ends, as if killed, before its step number `at`."""

    def child():
        count = iter(range(at + 1))

        def die(_operation, _path):
            if next(count) == at:
                os._exit(9)

        files.step = die
        save()
        os._exit(0)

    process = multiprocessing.get_context("fork").Process(target=child)
    process.start()
    process.join(60)
    return process.exitcode


@pytest.mark.parametrize(
    "first",
    [pytest.param(True, marks=pytest.mark.long, id="new"), pytest.param(False, id="replaced")],
)
def test_tables_of_several_clocks_cut_short_are_the_old_or_the_new(tmp_path, first):
    path, new = tmp_path / "a.csv", ordinary().with_meta(seed=9)
    states, at, code = [], 0, 9
    while code == 9:
        for item in tmp_path.iterdir():
            item.unlink()
        if not first:
            ordinary().save(path)
        code = _killed_at(lambda: new.save(path, force=True), at)
        if first and not list(tmp_path.glob("a.*.csv")):
            states.append("old")
        else:
            loaded = Recording.load(path)
            states.append("new" if loaded.equals(new) else "old")
            assert loaded.equals(new) or (not first and loaded.equals(ordinary()))
        assert new.save(path, force=True) == path
        assert Recording.load(path).equals(new)
        assert not list(tmp_path.glob(".a.*.next*"))
        assert len(list(tmp_path.glob("a.*"))) == 4
        at += 1
    assert code == 0
    assert at > 20
    assert states == sorted(states, reverse=True)
    assert set(states) == {"old", "new"}


def test_a_description_without_its_table_stands_in_nobodys_way(tmp_path):
    path = one_clock().save(tmp_path / "a.csv")
    path.unlink()
    with pytest.raises(InputError, match="no such file"):
        Recording.load(path)
    assert Recording.load(one_clock().save(path)).equals(one_clock())
    (tmp_path / "b.csv.json").write_text('{"mine": 1}')
    with pytest.raises(OutputExistsError, match=r"b\.csv\.json"):
        one_clock().save(tmp_path / "b.csv")


def test_csv_of_others_is_read_with_its_units(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("\ufefftime [ms],speed [rpm], angle [deg]\r\n0,60,0\r\n2.5,nan,180\r\n")
    with pytest.warns(UncheckedWarning, match="a.csv: no a.csv.json beside it"):
        recording = Recording.load(path)
    assert recording.clock().time.tolist() == [0.0, 0.0025]
    assert recording["angle"].values[1] == pytest.approx(np.pi)
    assert np.isnan(recording["speed"].values[1])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time [s],x\n0,1\n", "'x' is not of the form 'name \\[unit\\]'"),
        ("x [rad],time [s]\n0,1\n", "first column must be 'time"),
        ("time [s],x [rad],x [rad]\n0,1,2\n", "'x' is there twice"),
        ("time [s],x [radd]\n0,1\n", "unknown unit 'radd'"),
        ("time [m],x [rad]\n0,1\n", "is a length, expected a time"),
        ("time [s],x [rad]\n0,1\n1\n", "a.csv"),
        ("time [s],x [rad]\n0,\n", "a.csv"),
        ("time [s],x [rad]\n0,one\n", "one"),
        ("time [s],x [rad]\n1,1\n0,1\n", "does not increase"),
        ("time [s],if [rad]\n1,1\n", "reserved"),
    ],
)
def test_bad_csv(tmp_path, text, message):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(FormatError, match=message):
        Recording.load(path)
