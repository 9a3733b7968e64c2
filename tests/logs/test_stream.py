"""Samples read from lines as they come: the numbers of a file, whatever the portions."""

import json

import numpy as np
import pytest

from elevon.errors import FormatError, InputError
from elevon.logs.maps.column_map import ColumnMap
from elevon.logs.stream import StreamReader

HEAD = b"time [ms];motor_speed [rpm];Ist;output_position [deg];extra\n"
ROWS = b"0;60;1,5;0;7\n2,5;-60;;90;7\n"
MAP = ColumnMap.model_validate(
    {"current": "peak", "column": [{"name": "Ist", "role": "torque_current"}]}
)


def parts(data, portion=None, **kind):
    """All that a stream says, read in portions of so many bytes, and its reader."""
    reader = StreamReader(**kind)
    size = portion or len(data) or 1
    out = [p for k in range(0, len(data), size) for p in reader.read(data[k : k + size])]
    return out, reader


def joined(out):
    names = out[0].samples
    return {name: np.concatenate([part.samples[name] for part in out]) for name in names}


@pytest.mark.parametrize("portion", [1, 7, None])
def test_a_csv_is_read_as_a_file_is(tmp_path, portion):
    from elevon.logs.importing import import_log

    out, reader = parts(b"sep=;\n# a comment\n\n" + HEAD + ROWS, portion, column_map=MAP)
    got = joined(out)
    file = tmp_path / "log.csv"
    file.write_bytes(HEAD + ROWS)
    recording = import_log(file, column_map=MAP, gear_ratio=None).recording
    for role in ("motor_speed", "torque_current", "output_position"):
        np.testing.assert_array_equal(got[role], recording.role(role).values)
    np.testing.assert_array_equal(got["time"], recording.role("motor_speed").time)
    assert got.keys() == {"time", "motor_speed", "torque_current", "output_position"}
    assert any("extra" in note for part in out for note in part.notes)
    assert reader.cut_off == 0


@pytest.mark.parametrize("portion", [1, 11, None])
def test_json_by_roles(portion):
    lines = [
        {"time": 0.0, "motor_speed": 1, "gust": 3},
        {"time": 0.1, "motor_speed": None},
        {"motor_speed": 2.5, "time": 0.2, "motor_sped": 1},
    ]
    data = "".join(json.dumps(line) + "\r\n" for line in lines).encode()
    out, reader = parts(data + b'{"time": 0.3, "mot', portion)
    got = joined(out)
    np.testing.assert_array_equal(got["time"], [0.0, 0.1, 0.2])
    np.testing.assert_array_equal(got["motor_speed"], [1.0, np.nan, 2.5])
    assert [note for part in out for note in part.notes] == [
        "'gust' is not read",
        "'motor_sped' is not read; did you mean 'motor_speed' or 'output_speed' or 'motor_torque'?",
    ]
    assert reader.cut_off == len(b'{"time": 0.3, "mot')


def test_a_day_ends_where_the_header_stands_again():
    out, _ = parts(HEAD + ROWS + HEAD + ROWS, column_map=MAP)
    assert [part.new_day for part in out] == [True, False]
    assert all(len(part.samples["time"]) == 2 for part in out)
    line = b'{"time": 0.0, "motor_speed": 1}\n'
    out, _ = parts(line + b'{"event": "new_day"}\n' + line)
    assert [part.new_day for part in out] == [True, False]


def test_lines_that_are_no_samples_are_counted_with_the_first_reason():
    bad = [b"1;2\n", b"x;1;1;1;1\n", b"nan;1;1;1;1\n", b"1e99;1;1;1;1\n", b"1;1e200;1;1;1\n"]
    out, _ = parts(HEAD + ROWS + b"".join(bad) + b"5,0;1;1;1;1\n", column_map=MAP)
    assert [part.unreadable for part in out] == [5]
    assert "line 4: 2 cells where the header has 5" in out[0].why
    np.testing.assert_allclose(out[0].samples["time"], [0.0, 0.0025, 0.005])
    line = b'{"time": 0.0, "motor_speed": 1}\n'
    bad = [b"[]\n", b"{\n", b'{"time": true, "motor_speed": 1}\n', b'{"time": 1e999}\n',
           b'{"time": ' + b"9" * 400 + b"}\n", b"[" * 5000 + b"\n"]  # fmt: skip
    out, _ = parts(line + b"".join(bad) + line)
    assert [part.unreadable for part in out] == [len(bad)]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (HEAD + b"1;2\n", "2 cells where the header has 5"),
        (HEAD + ROWS + b"x\n" * 1000, "1 cells where the header has 5"),
        (b"a,b\n1,2\n", "column 'Ist'"),
        (b'{"a": 1}\n', "a sample needs 'time'"),
        (b'{"time": "now", "motor_speed": 1}\n', "is not a number"),
        (b"x" * 70000, "longer than 65536 bytes"),
        (HEAD + b"\x00\x01\n", "a zero byte"),
        (b"\xff\xfet\x00\n", "UTF-16"),
    ],
)
def test_what_is_no_stream_is_refused(data, words):
    with pytest.raises((FormatError, InputError), match=words):
        parts(data, column_map=MAP)


def test_a_unit_that_nobody_states_is_that_of_a_log_or_refused():
    data = b"Xms,Drive_axis_1.r63,C1Drive_axis_1r4820\n0,60,180\n"
    with pytest.raises(InputError, match="a stream cannot settle it"):
        parts(data)
    out, _ = parts(data, factors={"C1Drive_axis_1r4820": np.pi / 180.0})
    np.testing.assert_allclose(out[0].samples["motor_position"], [np.pi])


@pytest.mark.parametrize("again", [b"", HEAD])
def test_a_stream_read_on_knows_its_header(again):
    _, first = parts(HEAD + ROWS, column_map=MAP)
    reader = StreamReader(column_map=MAP)
    reader.go_on(first.heading)
    out = list(reader.read(b";60;1,5\n"[len(again) :] + again + b"5;60;1,5;0;7\n"))
    assert sum(len(part.samples["time"]) for part in out) == 1
    assert not any(part.new_day for part in out)
    json_reader = StreamReader()
    json_reader.go_on("{")
    out = list(json_reader.read(b'eed": 1}\n{"time": 0.0, "motor_speed": 1}\n'))
    assert [(part.unreadable, len(part.samples["time"])) for part in out] == [(1, 1)]
