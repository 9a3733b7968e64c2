"""Properties over input files: what is written is read, damage is an InputError, no more."""

import contextlib
import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from elevon.errors import InputError
from elevon.logs.command.note import read_command_note
from elevon.logs.formats.detect import read_table
from elevon.logs.formats.drive import DriveFormat, write_drive_csv
from elevon.logs.formats.loadcell import read_loadcell, write_loadcell
from elevon.logs.formats.text import read_text_table
from elevon.logs.importing import import_log
from elevon.logs.maps.column_map import safe_name
from elevon.recording.channel import check_name
from tests.logs.conftest import servo_log
from tests.logs.formats.test_formats import MAP, WRITERS, foreign

finite = st.floats(min_value=-1e12, max_value=1e12, allow_nan=False)


@given(
    data=arrays(np.float64, st.tuples(st.integers(1, 20), st.integers(1, 6)), elements=finite),
    dialect=st.sampled_from([(",", "."), (";", "."), (";", ","), ("\t", ","), ("\t", ".")]),
    line_end=st.sampled_from(["\n", "\r\n"]),
    mark=st.sampled_from([b"", b"\xef\xbb\xbf"]),
    newline_at_end=st.booleans(),
    trailing=st.booleans(),
)
def test_any_table_survives_any_dialect(
    tmp_path_factory, data, dialect, line_end, mark, newline_at_end, trailing
):
    delimiter, decimal = dialect
    end = delimiter if trailing else ""
    head = delimiter.join(f"c{k} é" for k in range(data.shape[1])) + end
    body = [delimiter.join(repr(float(v)).replace(".", decimal) for v in row) + end for row in data]
    text = line_end.join([head, *body]) + (line_end if newline_at_end else "")
    path = tmp_path_factory.getbasetemp() / "table.csv"
    path.write_bytes(mark + text.encode("utf-8"))
    if data.shape[1] == 1 and not trailing and decimal == ",":
        return  # one column shows no delimiter: the decimal comma then looks like one
    table = read_text_table(path)
    np.testing.assert_array_equal(np.column_stack(list(table.columns.values())), data)


@given(raw=st.binary(max_size=300))
def test_random_bytes_are_refused_or_read(tmp_path_factory, raw):
    path = tmp_path_factory.getbasetemp() / "random.bin"
    path.write_bytes(raw)
    for read in (read_table, read_loadcell, read_command_note, import_log):
        with contextlib.suppress(InputError):
            read(path)


@given(text=st.text(alphabet='0123456789.,;"-+eE \t\nxXms_nainf', max_size=200))
def test_text_that_looks_like_numbers_is_refused_or_read(tmp_path_factory, text):
    path = tmp_path_factory.getbasetemp() / "text.csv"
    path.write_text(text)
    for read in (read_table, read_loadcell, import_log):
        with contextlib.suppress(InputError):
            read(path)


@given(
    value=st.recursive(
        st.none() | st.booleans() | st.floats() | st.text(max_size=10),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(
                st.sampled_from(["waveform", "amplitude_deg", "arm", "brake", "current", "x"])
                | st.text(max_size=5),
                inner,
                max_size=4,
            )
        ),
        max_leaves=8,
    )
)
def test_any_json_is_a_note_or_an_input_error(tmp_path_factory, value):
    import json

    path = tmp_path_factory.getbasetemp() / "note.json"
    path.write_text(json.dumps(value))
    try:
        note = read_command_note(path)
    except InputError:
        return
    assert all(np.isfinite(v) for v in note.parameters.values())


@given(names=st.lists(st.text(max_size=60), max_size=8))
def test_foreign_names_become_channel_names(names):
    taken = set()
    for name in names:
        taken.add(check_name(safe_name(name, taken)))
    assert len(taken) == len(names)


@pytest.fixture(scope="module")
def short():
    return servo_log(seconds=1.0)


@pytest.mark.parametrize("name", WRITERS)
def test_damaged_files_are_refused_or_read(tmp_path, short, name):
    """Two hundred mutations a format, the same ones every time."""
    data = {key: values[:200] for key, values in foreign(short).items()}
    WRITERS[name](tmp_path / name, data)
    raw = (tmp_path / name).read_bytes()
    (tmp_path / "map.toml").write_text(MAP)
    rng = random.Random(name)
    path = tmp_path / ("damaged_" + name)
    refused = 0
    for _ in range(200):
        content = bytearray(raw)
        for _ in range(rng.choice([1, 2, 5, 20])):
            if not content:
                break
            place = rng.randrange(min(len(content), rng.choice([64, 600, 4000, 10**9])))
            if rng.random() < 0.15:
                content = content[: place + 1]
            else:
                content[place : place + 4] = rng.choice(
                    [bytes([rng.randrange(256)]), b"\xff\xff\xff\xff", b"\0\0\0\0", b""]
                ) + bytes(content[place + 1 : place + 4])
        path.write_bytes(bytes(content))
        try:
            import_log(path, column_map=tmp_path / "map.toml")
        except InputError:
            refused += 1
    assert refused > 20  # the mutations do reach the readers


@given(
    unit=st.sampled_from(["deg", "rad"]),
    shaft=st.sampled_from(["fast", "slow"]),
    ratio=st.floats(20.0, 500.0),
    amplitude=st.floats(0.02, 1.0),
    zero=st.floats(-100.0, 100.0),
)
def test_units_and_shaft_are_found_for_any_gearbox(
    tmp_path_factory, unit, shaft, ratio, amplitude, zero
):
    t = np.arange(0.0, 4.0, 1 / 400)
    motor = zero + ratio * amplitude * np.sin(2 * np.pi * 0.7 * t)
    signals = {
        "time": t,
        "resolver_position": motor,
        "encoder_position": (motor - zero) / ratio + 3.0,
        "motor_speed": ratio * amplitude * 2 * np.pi * 0.7 * np.cos(2 * np.pi * 0.7 * t),
    }
    if ratio * amplitude < 0.5:
        return
    layout = DriveFormat(position_unit=unit, encoder_shaft=shaft, gear_ratio=ratio, digits=12)
    path = tmp_path_factory.getbasetemp() / "gear.csv"
    write_drive_csv(path, signals, layout=layout, force=True)
    log = import_log(path, gear_ratio=ratio, sidecars=False)
    for name in ("resolver_position", "encoder_position"):
        np.testing.assert_allclose(log.recording[name].values, signals[name], rtol=1e-8, atol=1e-8)


@given(
    values=arrays(np.float64, st.integers(2, 30), elements=st.floats(-1e6, 1e6)),
    rate=st.floats(5.0, 200.0),
)
def test_any_load_cell_file_is_read_back(tmp_path_factory, values, rate):
    path = tmp_path_factory.getbasetemp() / "cell.csv"
    time = np.arange(len(values)) / rate
    write_loadcell(path, time, values, force=True)
    log = read_loadcell(path)
    np.testing.assert_allclose(log.time, time, rtol=1e-8)
    np.testing.assert_allclose(log.value, values, rtol=1e-8)
