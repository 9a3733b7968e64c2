"""Recordings in Parquet, NetCDF and MATLAB files: what others read, and what is refused."""

import struct
import zlib

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from elevon import Clock, Recording
from elevon.errors import (
    FormatError,
    InputError,
)
from elevon.recording import mat
from tests.recording.make import one_clock, ordinary


def test_parquet_carries_units_and_plain_pages(tmp_path):
    file = pq.ParquetFile(ordinary().save(tmp_path / "a.parquet"))
    schema = file.schema_arrow
    assert schema.names == ["clock", "time", "output_position", "motor_speed", "force"]
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
        assert dataset["output_position"].dims == ("time_drive",)


@pytest.mark.parametrize("way", ["external", "soft", "storage", "virtual", "group", "text"])
def test_netcdf_that_points_elsewhere_is_refused(tmp_path, way):
    """An HDF5 file may name other files of the reader's disk; a recording never does."""
    path = one_clock().save(tmp_path / "a.nc")
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
