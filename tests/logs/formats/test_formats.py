"""Binary logs: what is read, what is passed over, and bombs that stop at the limit."""

import struct
import zlib

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import netcdf_file, savemat

from elevon.errors import FormatError, InputError
from elevon.logs.formats import text
from elevon.logs.formats.cranfield import DATA_DOI, read_cranfield
from elevon.logs.formats.detect import file_kind, read_table
from elevon.logs.formats.drive import write_drive_csv
from elevon.logs.formats.table import Limits
from elevon.logs.formats.text import LineReader, read_text_table
from elevon.logs.formats.vectors import read_matlab
from elevon.logs.importing import import_log

SMALL = Limits(values=20_000)
DEG = np.pi / 180

MAP = """
gear_ratio = 124.0
current = "peak"
[[column]]
name = "t"
signal = "time"
unit = "ms"
[[column]]
name = "output"
signal = "encoder_position"
unit = "deg"
sign = -1
[[column]]
name = "motor"
signal = "resolver_position"
unit = "rev"
[[column]]
name = "n"
signal = "motor_speed"
unit = "rpm"
[[column]]
name = "iq"
signal = "current_q_meas"
unit = "mA"
"""


def foreign(truth):
    s = truth.signals
    return {
        "t": s["time"] * 1e3,
        "output": -s["encoder_position"] / DEG,
        "motor": s["resolver_position"] / (2 * np.pi),
        "n": s["motor_speed"] * 30 / np.pi,
        "iq": s["current_q_meas"] * 1e3,
    }


def write_csv(path, data):
    rows = np.column_stack(list(data.values()))
    np.savetxt(path, rows, delimiter=",", header=",".join(data), comments="", fmt="%.9g")


def write_hdf(path, data, *, matlab=False):
    with h5py.File(path, "w", userblock_size=512 if matlab else 0) as file:
        for name, values in data.items():
            file.create_dataset(
                name, data=values[None, :] if matlab else values, compression="gzip"
            )
        file.create_dataset("matrix", data=np.zeros((4, 5)))
        file.create_dataset("words", data=["a", "b"])
        file["elsewhere"] = h5py.ExternalLink("/etc/passwd", "/x")
        file["soft"] = h5py.SoftLink("/" + next(iter(data)))
    if matlab:
        head = b"MATLAB 7.3 MAT-file".ljust(124) + struct.pack("<H", 0x0200) + b"IM"
        with path.open("r+b") as raw:
            raw.write(head)


def write_netcdf3(path, data):
    with netcdf_file(path, "w") as file:
        file.createDimension("row", len(data["t"]))
        for name, values in data.items():
            file.createVariable(name, "d", ("row",))[:] = values


def write_parquet(path, data):
    words = pa.array(["x"] * len(data["t"]))
    pq.write_table(pa.table({**data, "remark": words}), path)


WRITERS = {
    "log.csv": write_csv,
    "log.parquet": write_parquet,
    "log.mat": lambda path, data: savemat(path, data, do_compression=True),
    "plain.mat": savemat,
    "struct.mat": lambda path, data: savemat(path, {"run": data, "note": "hello"}),
    "v73.mat": lambda path, data: write_hdf(path, data, matlab=True),
    "log.nc": write_hdf,
    "classic.nc": write_netcdf3,
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_foreign_log_is_read_through_a_map(tmp_path, truth, name):
    path = tmp_path / name
    WRITERS[name](path, foreign(truth))
    (tmp_path / "map.toml").write_text(MAP)
    log = import_log(path, column_map=tmp_path / "map.toml")
    for signal in ("encoder_position", "resolver_position", "motor_speed", "current_q_meas"):
        true = truth.signals[signal]
        np.testing.assert_allclose(
            log.recording[signal].values, true, rtol=1e-7, atol=1e-7 * np.ptp(true)
        )
    np.testing.assert_allclose(log.recording.clocks["drive"].time, truth.signals["time"], atol=1e-6)
    with pytest.raises(FormatError, match="--map"):
        import_log(path)


def test_a_saved_recording_comes_back_bit_for_bit(tmp_path, truth):
    log = import_log(write_drive_csv(tmp_path / "log.csv", truth.signals))
    for ending in ("parquet", "nc", "mat"):
        saved = log.recording.save(tmp_path / f"rec.{ending}")
        again = import_log(saved)
        assert again.report.file_format == "recording"
        assert again.recording.equals(log.recording)


def test_drive_names_inside_a_mat_file_are_known(tmp_path, truth):
    s = truth.signals
    data = {
        "Xms": s["time"] * 1e3,
        "r4820": s["resolver_position"] / DEG,
        "r4821": s["encoder_position"] / DEG,
        "r63": s["motor_speed"] * 30 / np.pi,
    }
    savemat(tmp_path / "log.mat", data)
    log = import_log(tmp_path / "log.mat")
    np.testing.assert_allclose(
        log.recording["encoder_position"].values, s["encoder_position"], atol=1e-9
    )


BAD_MAPS = {
    "unknown key": ('[[column]]\nname = "t"\nsignal = "time"\nunits = "ms"\n', "unit"),
    "unknown signal": ('[[column]]\nname = "t"\nsignal = "encoder_positon"\n', "encoder_position"),
    "not in the file": ('[[column]]\nname = "time"\nsignal = "time"\n', "unknown column"),
    "kind of unit": ('[[column]]\nname = "t"\nsignal = "time"\nunit = "rpm"\n', "rpm"),
    "sign": ('[[column]]\nname = "t"\nsignal = "time"\nsign = 2\n', "sign"),
    "twice": ('[[column]]\nname = "t"\nsignal = "time"\n' * 2, "twice"),
    "no shaft": (
        '[[column]]\nname = "t"\nsignal = "time"\n'
        '[[column]]\nname = "iq"\nsignal = "current_ref"\nshaft = "fast"\n',
        "no shaft",
    ),
    "not toml": ("[[column]\n", "TOML"),
}


@pytest.mark.parametrize(("text", "message"), BAD_MAPS.values(), ids=BAD_MAPS.keys())
def test_bad_maps_are_refused(tmp_path, truth, text, message):
    write_csv(tmp_path / "log.csv", foreign(truth))
    (tmp_path / "map.toml").write_text(text)
    with pytest.raises(InputError, match=message):
        import_log(tmp_path / "log.csv", column_map=tmp_path / "map.toml")


def test_a_stated_unit_that_the_motion_contradicts_is_refused(tmp_path, truth):
    write_csv(tmp_path / "log.csv", foreign(truth))
    (tmp_path / "map.toml").write_text(MAP.replace('unit = "rev"', 'unit = "deg"'))
    with pytest.raises(InputError, match=r"'motor'.*contradict"):
        import_log(tmp_path / "log.csv", column_map=tmp_path / "map.toml")


def test_objects_cells_and_text_are_passed_over(tmp_path):
    cell = np.empty(2, dtype=object)
    cell[:] = [np.zeros(3), "x"]
    savemat(
        tmp_path / "log.mat",
        {"t": np.arange(5.0), "cell": cell, "word": "abc", "z": np.ones(5) * 1j, "m": np.eye(3)},
    )
    table = read_matlab(tmp_path / "log.mat")
    assert list(table.columns) == ["t"]
    assert sum("passed over" in note for note in table.notes) == 4


def test_nested_structures_are_refused(tmp_path):
    savemat(tmp_path / "deep.mat", {"a": {"b": {"c": np.arange(3.0)}}})
    with pytest.raises(FormatError, match="structure"):
        read_matlab(tmp_path / "deep.mat")


def mat_header():
    return b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"


def test_a_compressed_bomb_stops_at_the_limit(tmp_path):
    packed = zlib.compress(b"\0" * 50_000_000, 9)
    (tmp_path / "bomb.mat").write_bytes(mat_header() + struct.pack("<II", 15, len(packed)) + packed)
    with pytest.raises(FormatError, match="expands"):
        read_matlab(tmp_path / "bomb.mat", limits=SMALL)


def test_a_declared_giant_is_refused_before_it_is_allocated(tmp_path):
    def element(kind, data):
        return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)

    body = element(6, struct.pack("<II", 6, 0)) + element(5, struct.pack("<ii", 1, 2**30))
    body += element(1, b"x") + element(9, b"\0" * 8)
    (tmp_path / "giant.mat").write_bytes(mat_header() + element(14, body))
    with pytest.raises(FormatError, match="declared"):
        read_matlab(tmp_path / "giant.mat")


def test_hdf5_and_parquet_bombs_stop_at_the_limit(tmp_path):
    with h5py.File(tmp_path / "bomb.nc", "w") as file:
        file.create_dataset("t", shape=(2**33,), dtype="f8", chunks=(2**20,), compression="gzip")
    with pytest.raises(FormatError, match="limit"):
        read_table(tmp_path / "bomb.nc")
    zeros = pa.table({"t": pa.array(np.zeros(200_000))})
    pq.write_table(zeros, tmp_path / "bomb.parquet", compression="zstd")
    with pytest.raises(FormatError, match="limit"):
        read_table(tmp_path / "bomb.parquet", limits=SMALL)


def test_hdf5_never_leaves_the_file(tmp_path):
    with h5py.File(tmp_path / "log.nc", "w") as file:
        file["t"] = np.arange(10.0)
        file.create_dataset("out", shape=(10,), dtype="f8", external=[("/etc/hosts", 0, 80)])
        layout = h5py.VirtualLayout(shape=(10,), dtype="f8")
        layout[:] = h5py.VirtualSource("other.h5", "x", shape=(10,))
        file.create_virtual_dataset("virtual", layout)
    table = read_table(tmp_path / "log.nc")
    assert list(table.columns) == ["t"]
    assert sum("outside the file" in note for note in table.notes) == 2


def test_kinds_are_told_by_content(tmp_path, truth):
    kinds = {
        "log.parquet": "parquet",
        "log.nc": "netcdf",
        "classic.nc": "netcdf",
        "v73.mat": "mat",
        "log.mat": "mat",
        "log.csv": "csv",
    }
    for name, kind in kinds.items():
        path = tmp_path / f"{name}.dat"
        WRITERS[name](tmp_path / name, foreign(truth))
        (tmp_path / name).rename(path)
        assert file_kind(path) == kind


CRANFIELD = "set_point,position_error,current,profile,load,run,fault_type,group,time\n"


def test_cranfield_layout(tmp_path):
    rows = [
        f"{20 + 0.1 * k},{0.5},{1.0 + 0.01 * k},trap,{load},{run},2,{g},{0.04 * k:.2f}"
        for load in (20, -40) for run in (1, 2) for g in (1, 2, 3) for k in range(10)
    ]  # fmt: skip
    path = tmp_path / "backlash2.csv"
    path.write_text(CRANFIELD + "\n".join(rows) + "\n")
    recordings = read_cranfield(path)
    assert [(r.meta["load_kgf"], r.meta["run"]) for r in recordings] == [
        (20, 1), (20, 2), (-40, 1), (-40, 2),
    ]  # fmt: skip
    first = recordings[0]
    assert first.labels == [{"kind": "backlash", "stage": 2}]
    assert len(first.clock().gaps) == 2
    assert first["position"].values[0] == pytest.approx(0.0195)
    assert DATA_DOI in first.meta["source"]
    path.write_text(CRANFIELD.replace("current", "amps") + "\n".join(rows) + "\n")
    with pytest.raises(FormatError, match="current"):
        read_cranfield(path)


@pytest.mark.shared
def test_the_real_cranfield_files(shared):
    folder = shared / "data" / "cranfield"
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent: the Cranfield data are not part of this project")
    recordings = read_cranfield(folder / "backlash2.csv.gz")
    assert len(recordings) == 21
    for recording in recordings:
        assert len(recording.clock()) == 1620
        assert len(recording.clock().gaps) == 4
        assert (
            0.015 < recording["position"].values.min() < recording["position"].values.max() < 0.15
        )
    with pytest.raises(InputError):
        import_log(folder / "backlash2.csv.gz")


@pytest.mark.parametrize("name", ["log.mat", "rows.mat", "v73.mat"])
def test_a_long_matrix_is_its_columns(tmp_path, name):
    """As MATLAB's users save a log: one array, a signal a column; 7.3 stores it transposed."""
    path = tmp_path / name
    data = np.column_stack((np.arange(60) * 1e-3, np.sin(np.arange(60) * 0.1)))
    if name == "v73.mat":
        write_hdf(path, {"data": data.T})
    else:
        savemat(path, {"data": data if name == "log.mat" else data.T, "square": np.eye(9)})
    table = read_table(path)
    assert list(table.columns) == ["data_1", "data_2"]
    np.testing.assert_array_equal(np.column_stack(list(table.columns.values())), data)
    assert any("passed over" in note for note in table.notes)


ODD = {
    "plain": "1,2,3",
    "empty cell": "1,,3",
    "exponent": "-1.5e-3,+2,3E4",
    "spaces": "1, 2,3",
    "words": "1,nan,3",
    "blank": "",
    "carriage return": "1,2,3\r",
    "delimiter at the end": "1,2,3,",
}


@pytest.mark.parametrize("kind", ODD)
def test_blocks_of_plain_numbers_are_read_as_line_by_line(tmp_path, monkeypatch, kind):
    """A strange line in the second of three blocks."""
    monkeypatch.setattr(text, "_BLOCK", 600)
    rows = [f"{k},{k / 7!r},{-(k**9)}e-300" for k in range(60)]
    rows[25] = ODD[kind]
    path = tmp_path / "log.csv"
    path.write_bytes(("a,b,c\n" + "\n".join(rows) + "\n").encode())
    fast = read_text_table(path)
    monkeypatch.setattr(LineReader, "_plain", lambda *_: False)
    slow = read_text_table(path)
    assert fast.notes == slow.notes
    for name, values in slow.columns.items():
        assert np.array_equal(fast.columns[name], values, equal_nan=True)


@pytest.mark.parametrize("odd", ["1,2", "1,2,3,4", "1,2-,3", "1,2,x", "1,1_0,2"])
def test_a_strange_line_is_refused_by_its_number(tmp_path, monkeypatch, odd):
    monkeypatch.setattr(text, "_BLOCK", 100)
    path = tmp_path / "log.csv"
    path.write_text("a,b,c\n" + "1,2,3\n" * 40 + f"{odd}\n" + "1,2,3\n" * 40)
    with pytest.raises(FormatError, match=r"line 42\b"):
        read_text_table(path)
