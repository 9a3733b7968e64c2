"""Every format gives back every bit, and trusts nothing it reads."""

import json
import os
import random
import signal
import struct
import subprocess
import sys
import textwrap
import warnings
import zlib

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st

from elevon import Clock, Recording
from elevon.errors import (
    DamageError,
    FormatError,
    InputError,
    OutputError,
    OutputExistsError,
    UncheckedWarning,
    UnknownNameError,
)
from elevon.recording import csv, mat
from tests.recording.make import ordinary, plain_doubles, recordings

ALL = [".parquet", ".nc", ".mat", ".csv"]
MANY_CLOCKS = [".parquet", ".nc", ".mat"]  # of any numbers; .csv but for what a NaN can hide


def _one_clock():
    return ordinary().select(clock="cell")


@pytest.mark.parametrize("ending", ALL)
def test_several_clocks_come_back_to_the_bit(tmp_path, ending):
    recording = ordinary()
    assert Recording.load(recording.save(tmp_path / f"a{ending}")).equals(recording)


@pytest.mark.parametrize("ending", ALL)
def test_one_clock_comes_back_to_the_bit(tmp_path, ending):
    recording = _one_clock()
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


def test_nothing_to_save_is_saved(tmp_path):
    empty = Recording([], clocks=[Clock("main", [])], meta={"status": "interrupted"})
    for ending in ALL:
        assert Recording.load(empty.save(tmp_path / f"a{ending}")).equals(empty)


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
    path = _one_clock().save(tmp_path / "a.csv")
    assert Recording.load(ordinary().save(path, force=True)).equals(ordinary())


def test_csv_without_a_clock(tmp_path):
    with pytest.raises(InputError, match="the recording has none"):
        Recording([]).save(tmp_path / "a.csv")


@pytest.mark.parametrize("name", ["a.hdf5", "a", "a.parquett", "a.xlsx"])
def test_unknown_endings_name_the_valid_ones(tmp_path, name):
    with pytest.raises(UnknownNameError, match=r"\.parquet"):
        ordinary().save(tmp_path / name)
    with pytest.raises(UnknownNameError, match=r"\.parquet"):
        Recording.load(tmp_path / name)


@pytest.mark.parametrize("ending", ALL)
def test_no_overwrite_without_force(tmp_path, ending):
    path = _one_clock().save(tmp_path / f"a{ending}")
    before = path.read_bytes()
    with pytest.raises(OutputExistsError, match="--force"):
        _one_clock().with_meta(other=1).save(path)
    assert path.read_bytes() == before
    _one_clock().with_meta(other=1).save(path, force=True)
    assert Recording.load(path).meta["other"] == 1


@pytest.mark.parametrize("ending", ALL)
def test_an_unwritable_place_is_a_clear_error(tmp_path, ending):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot make the folder"):
        _one_clock().save(tmp_path / "file" / f"a{ending}")


def test_a_missing_file_names_its_neighbour(tmp_path):
    _one_clock().save(tmp_path / "run_1.csv")
    with pytest.raises(InputError, match=r"no such file; did you mean 'run_1\.csv'"):
        Recording.load(tmp_path / "run1.csv")


@pytest.mark.parametrize("ending", ALL)
def test_kill_9_in_the_middle_of_a_save_leaves_no_half_file(tmp_path, ending):
    """The saver is killed at random instants while it replaces a good file again and again."""
    path = tmp_path / f"a{ending}"
    _one_clock().save(path)
    program = textwrap.dedent(
        """
        import sys, numpy as np
        from elevon import Recording
        n = 50_000
        big = Recording.build(np.arange(n), {"x": np.sin(np.arange(n))}, {"x": "rad"})
        big.save(sys.argv[1], force=True)
        print("saving", flush=True)
        while True:
            big.save(sys.argv[1], force=True)
        """
    )
    chance = random.Random(ending)
    process = subprocess.Popen([sys.executable, "-c", program, str(path)], stdout=subprocess.PIPE)
    with process:
        assert process.stdout.readline() == b"saving\n"
        try:
            process.wait(chance.uniform(0.05, 0.3))
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    assert len(Recording.load(path)["x"]) == 50_000


@pytest.mark.parametrize("ending", ALL)
def test_a_full_disk_leaves_the_old_file(tmp_path, ending):
    """A limit on the file size stands in for the full disk."""
    path = _one_clock().save(tmp_path / f"a{ending}")
    before = path.read_bytes()
    program = textwrap.dedent(
        """
        import resource, signal, sys, numpy as np
        from elevon import Recording
        from elevon.errors import OutputError
        x = np.random.default_rng(0).normal(size=50_000)
        big = Recording.build(np.arange(x.size), {"x": x}, {"x": "rad"})
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))
        try:
            big.save(sys.argv[1], force=True)
        except OutputError:
            sys.exit(42)
        """
    )
    assert subprocess.run([sys.executable, "-c", program, str(path)], check=False).returncode == 42
    assert path.read_bytes() == before
    left = {entry.name for entry in tmp_path.iterdir()}
    assert left == {path.name, *([f"{path.name}.json"] if ending == ".csv" else [])}
    assert Recording.load(path).equals(_one_clock())


@pytest.mark.parametrize("ending", ALL)
def test_too_large_for_the_limit(tmp_path, ending):
    path = ordinary().select(clock="drive").save(tmp_path / f"a{ending}")
    with pytest.raises(FormatError, match=r"the limit is 0 MiB"):
        Recording.load(path, max_bytes=4000)


@pytest.mark.parametrize("ending", ALL)
@pytest.mark.parametrize(
    "content", [b"", b"\0" * 200, b"hello\n", b"PAR1" * 50, b"\x89HDF\r\n\x1a\n"]
)
def test_another_content_is_a_clear_error(tmp_path, ending, content):
    path = tmp_path / f"a{ending}"
    path.write_bytes(content)
    with pytest.raises(FormatError, match=rf"a\{ending}"):
        Recording.load(path)


@pytest.mark.parametrize("ending", ALL)
@given(data=st.data())
@settings(max_examples=60)
def test_damaged_files_are_a_clear_error_or_the_same_recording(tmp_path_factory, ending, data):
    """Cut short or with bytes changed: never another exception, never a crash."""
    path = tmp_path_factory.mktemp("damaged") / f"a{ending}"
    content = bytearray(_one_clock().save(path).read_bytes())
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    else:
        for _ in range(data.draw(st.integers(1, 4))):
            content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(content)
    whole = _one_clock()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UncheckedWarning)
            loaded = Recording.load(path, max_bytes=2**26)
    except FormatError as error:
        assert str(path) in str(error)  # noqa: PT017
        return
    assert loaded.equals(whole)


@given(data=st.data())
@settings(max_examples=60)
def test_a_damaged_file_beside_is_a_clear_error_or_the_same(tmp_path_factory, data):
    path = _one_clock().save(tmp_path_factory.mktemp("damaged") / "a.csv")
    near = path.with_name("a.csv.json")
    content = bytearray(near.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    near.write_bytes(content[: data.draw(st.integers(0, len(content)))])
    try:
        loaded = Recording.load(path)
    except FormatError as error:
        assert str(path) in str(error)  # noqa: PT017
        return
    assert loaded.equals(_one_clock())


def _header(path):
    return json.loads(path.with_name(f"{path.name}.json").read_text())["recording"]


def _with_header(path, header):
    near = path.with_name(f"{path.name}.json")
    near.write_text(json.dumps({**json.loads(near.read_text()), "recording": header}))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda h: h.update(schema=1), "layout has version 1, this Elevon reads version 2"),
        (lambda h: h.pop("clocks"), "damaged"),
        (lambda h: h.update(clocks=[]), "describes 0 clocks"),
        (lambda h: h["clocks"][0].update(samples=4), "holds 5 of 4"),
        (lambda h: h["clocks"][0].update(samples="5"), "integers"),
        (lambda h: h["clocks"][0].update(samples=10**15), "the limit is"),
        (lambda h: h["clocks"][0].update(gaps=[17]), "gap indices"),
        (lambda h: h["clocks"][0].update(rate="fast"), "fast"),
        (lambda h: h["clocks"][0].update(name="../x"), "clock '../x'"),
        (lambda h: h["clocks"][0]["channels"][0].update(unit="rad"), "do not agree"),
        (lambda h: h["clocks"][0]["channels"][0].update(name="forces"), "do not agree"),
        (lambda h: h["clocks"][0]["channels"][0].update(text="another"), "SHA-256"),
        (lambda h: h["meta"].update(seed=9), "SHA-256"),
        (lambda h: h.pop("sha256"), "damaged"),
        (lambda h: h["clocks"][0]["channels"].append(dict(h["clocks"][0]["channels"][0])), "once"),
    ],
)
def test_a_description_that_lies_is_found_out(tmp_path, change, message):
    path = _one_clock().save(tmp_path / "a.csv")
    header = _header(path)
    change(header)
    _with_header(path, header)
    with pytest.raises(FormatError, match=message):
        Recording.load(path)


def test_deeply_nested_descriptions_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    _one_clock().save(path)
    path.with_name("a.csv.json").write_text("[" * 1_000_000)
    with pytest.raises(FormatError, match="damaged"):
        Recording.load(path)


def test_csv_is_plain_text_with_units(tmp_path):
    lines = _one_clock().save(tmp_path / "a.csv").read_text().splitlines()
    assert lines[0] == "time [s],force [N]"
    assert lines[1] == "0,1"
    assert len(lines) == 6
    table = pd.read_csv(tmp_path / "a.csv")
    assert list(table.columns) == ["time [s]", "force [N]"]
    written = np.column_stack([_one_clock().clock().time, _one_clock()["force"].values])
    np.testing.assert_allclose(table.to_numpy(), written, rtol=1e-15, atol=1e-300)


def test_csv_without_the_file_beside_it_says_so(tmp_path):
    path = _one_clock().save(tmp_path / "a.csv")
    path.with_name("a.csv.json").unlink()
    with pytest.warns(UncheckedWarning, match=r"no a\.csv\.json beside it") as told:
        recording = Recording.load(path)
    assert told[0].filename == __file__
    assert recording["force"].values.tobytes() == _one_clock()["force"].values.tobytes()
    assert recording.meta == {}


def test_csv_changed_since_is_an_error(tmp_path):
    path = _one_clock().save(tmp_path / "a.csv")
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
    path = _one_clock().save(tmp_path / "a.csv")
    new = _one_clock().with_meta(seed=9)
    changed = Recording.build([0, 1], {"x": [1, 2]}, {"x": "rad"}, meta={"seed": 9})
    saved = csv.write_beside

    class Killed(BaseException):
        pass

    def killed(table, about, *, keep_old):
        if step == "table" and not keep_old:
            raise Killed
        saved(table, about, keep_old=keep_old)
        if step == "description":
            raise Killed

    # A table of the very same bytes is whole with the new description at once.
    old = _one_clock() if step == "description" else changed
    for later, expected in ((changed, old), (new, new)):
        with monkeypatch.context() as patch:
            patch.setattr(csv, "write_beside", killed)
            with pytest.raises(Killed):
                later.save(path, force=True)
        assert Recording.load(path).equals(expected)
        _one_clock().save(path, force=True)


def test_a_description_without_its_table_stands_in_nobodys_way(tmp_path):
    path = _one_clock().save(tmp_path / "a.csv")
    path.unlink()
    with pytest.raises(InputError, match="no such file"):
        Recording.load(path)
    assert Recording.load(_one_clock().save(path)).equals(_one_clock())
    (tmp_path / "b.csv.json").write_text('{"mine": 1}')
    with pytest.raises(OutputExistsError, match=r"b\.csv\.json"):
        _one_clock().save(tmp_path / "b.csv")


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


def test_parquet_carries_units_and_plain_pages(tmp_path):
    file = pq.ParquetFile(ordinary().save(tmp_path / "a.parquet"))
    schema = file.schema_arrow
    assert schema.names == ["clock", "time", "user_position", "motor_speed", "force"]
    assert schema.field("force").metadata[b"unit"] == b"N"
    known = {"PLAIN", "RLE", "RLE_DICTIONARY", "PLAIN_DICTIONARY"}
    for group in range(file.num_row_groups):
        for index in range(len(schema.names)):
            column = file.metadata.row_group(group).column(index)
            assert column.compression == "SNAPPY"
            assert set(column.encodings) <= known
    frame = file.read().to_pandas()
    cell = frame[frame.clock == "cell"].drop(columns="clock").dropna(axis=1, how="all")
    assert list(cell.columns) == ["time", "force"]


def test_parquet_of_others_is_refused(tmp_path):
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"time": [0.0, 1.0], "x": [1.0, 2.0]}), path)
    with pytest.raises(FormatError, match="no recording"):
        Recording.load(path)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"time": [0.0, 1.0]}, "'x' is missing"),
        ({"time": [0.0, 1.0], "x": [1, 2]}, "not float64"),
        ({"time": [0.0, 1.0], "x": [1.0, None]}, "has nulls"),
        ({"time": [0.0], "x": [1.0]}, "does not end with a row group"),
        ({"time": [0.0, 1.0, 2.0], "x": [1.0, 2.0, 3.0]}, "does not end with a row group"),
    ],
)
def test_parquet_that_lies_is_found_out(tmp_path, columns, message):
    honest = Recording.build([0, 1], {"x": [1, 2]}, {"x": "rad"}).save(tmp_path / "a.parquet")
    metadata = pq.read_schema(honest).metadata
    path = tmp_path / "b.parquet"
    pq.write_table(pa.table(columns).replace_schema_metadata(metadata), path)
    with pytest.raises(FormatError, match=message):
        Recording.load(path)


def test_netcdf_is_read_by_xarray(tmp_path):
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(ordinary().save(tmp_path / "a.nc"), engine="h5netcdf") as dataset:
        assert dict(dataset.sizes)["time_cell"] == 5
        assert dataset["force"].attrs["units"] == "N"
        assert float(dataset["force"][0]) == 1.0
        assert dataset["user_position"].dims == ("time_drive",)


@pytest.mark.parametrize("way", ["external", "soft", "storage", "virtual", "group", "text"])
def test_netcdf_that_points_elsewhere_is_refused(tmp_path, way):
    """An HDF5 file may name other files of the reader's disk; a recording never does."""
    path = _one_clock().save(tmp_path / "a.nc")
    secret = tmp_path / "secret.h5"
    with h5py.File(secret, "w") as file:
        file["force"] = np.arange(5.0)
    with h5py.File(path, "a") as file:
        del file["force"]
        if way == "external":
            file["force"] = h5py.ExternalLink(str(secret), "force")
        elif way == "soft":
            file["force"] = h5py.SoftLink("/time")
        elif way == "storage":
            raw = [(str(secret), 0, 40)]
            file.create_dataset("force", (5,), "f8", external=raw)
        elif way == "virtual":
            layout = h5py.VirtualLayout((5,), "f8")
            layout[:] = h5py.VirtualSource(str(secret), "force", (5,))
            file.create_virtual_dataset("force", layout)
        elif way == "group":
            file.create_group("force")
        else:
            file["force"] = ["a"] * 5
    with pytest.raises(FormatError, match="refused"):
        Recording.load(path)


def test_netcdf_of_others_is_refused(tmp_path):
    with h5py.File(tmp_path / "a.nc", "w") as file:
        file["x"] = np.arange(3.0)
    with pytest.raises(FormatError, match="no recording"):
        Recording.load(tmp_path / "a.nc")


def test_mat_reads_naturally(tmp_path):
    content = scipy.io.loadmat(ordinary().save(tmp_path / "a.mat"))
    assert content["cell"]["force"].item().shape == (5, 1)
    assert content["drive"]["time"].item().shape == (400, 1)
    assert content["units"]["force"].item().item() == "N"


def test_mat_refuses_more_than_matlab_reads():
    """2 GB are promised by a clock without the memory for them."""
    count = 2**28
    instants = np.lib.stride_tricks.as_strided(np.arange(1.0), (count,), (0,))
    clock = Clock("main", [0.0])
    object.__setattr__(clock, "time", instants)
    with pytest.raises(InputError, match=r"clock 'main': 2\.00 GiB; MATLAB version 5"):
        mat.check(Recording([], clocks=[clock]))


def test_mat_holds_names_of_31_characters(tmp_path):
    name = "x" * 31
    recording = Recording.build([0], {name: [1]}, {name: "rad"}, clock="y" * 31)
    assert Recording.load(recording.save(tmp_path / "a.mat")).equals(recording)


def test_mat_saved_again_compressed_is_read(tmp_path):
    recording = ordinary()
    content = scipy.io.loadmat(recording.save(tmp_path / "a.mat"))
    plain = {key: value for key, value in content.items() if not key.startswith("__")}
    scipy.io.savemat(tmp_path / "b.mat", plain, do_compression=True)
    assert Recording.load(tmp_path / "b.mat").equals(recording)


def test_mat_that_would_swell_is_refused_before_it_does(tmp_path):
    head = b"MATLAB 5.0 MAT-file".ljust(116) + bytes(8) + struct.pack("<H", 0x0100) + b"IM"
    packed = zlib.compress(struct.pack("<II", 14, 2**31 - 8) + bytes(1000))
    path = tmp_path / "a.mat"
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)
    with pytest.raises(FormatError, match="would need 2048 MiB"):
        Recording.load(path, max_bytes=2**30)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"x": np.arange(3.0)}, "no recording"),
        ({"elevon": np.arange(3.0)}, "no recording"),
        ({"elevon": "{}"}, "damaged"),
    ],
)
def test_mat_of_others_is_refused(tmp_path, content, message):
    scipy.io.savemat(tmp_path / "a.mat", content)
    with pytest.raises(FormatError, match=message):
        Recording.load(tmp_path / "a.mat")


def test_mat_7_3_is_named(tmp_path):
    (tmp_path / "a.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(512))
    with pytest.raises(FormatError, match="-v7"):
        Recording.load(tmp_path / "a.mat")


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may read everything")
def test_an_unreadable_file_is_a_clear_error(tmp_path):
    path = _one_clock().save(tmp_path / "a.csv")
    path.chmod(0)
    with pytest.raises(FormatError, match="cannot be read"):
        Recording.load(path)
