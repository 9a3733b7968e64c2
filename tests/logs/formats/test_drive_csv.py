"""The drive's trace: written and read back through every dialect, and refused where it must be."""

import math

import numpy as np
import pytest

from elevon.errors import FormatError, InputError, OutputExistsError
from elevon.logs.formats.drive import DriveFormat, write_drive_csv
from elevon.logs.formats.text import read_text_table
from elevon.logs.importing import import_log

DIALECTS = [
    {},
    {"delimiter": ";"},
    {"delimiter": ";", "decimal_comma": True},
    {"delimiter": "\t", "decimal_comma": True, "line_end": "\r\n"},
    {"encoding": "utf-8-sig", "line_end": "\r\n"},
    {"encoding": "latin-1", "delimiter": ";"},
    {"position_unit": "rad", "encoder_shaft": "slow"},
    {"position_unit": "deg", "encoder_shaft": "slow"},
    {"position_unit": "rad", "encoder_shaft": "fast"},
]


@pytest.mark.parametrize(
    "dialect", DIALECTS, ids=lambda d: "-".join(map(str, d.values())) or "plain"
)
def test_what_is_written_is_read_back(tmp_path, truth, dialect):
    path = write_drive_csv(tmp_path / "log.csv", truth.signals, layout=DriveFormat(**dialect))
    log = import_log(path)
    for name, values in truth.signals.items():
        clock = log.recording.clocks["drive"]
        got = clock.time if name == "time" else log.recording[name].values
        np.testing.assert_allclose(got, values, rtol=1e-7, atol=1e-7 * np.ptp(values))
    assert log.recording.clocks["drive"].rate == pytest.approx(400.0, rel=1e-9)
    assert log.report.has("unit-confirmed")
    assert log.report.has("shaft-confirmed")
    assert log.recording.meta["status"] == "measured"


def test_backlash_and_ratio_are_reported(tmp_path, truth):
    slow = DriveFormat(encoder_shaft="slow")
    path = write_drive_csv(tmp_path / "log.csv", truth.signals, layout=slow)
    text = next(f.text for f in import_log(path).report.findings if f.code == "shaft-confirmed")
    ratio = float(text.split("gear ratio seen ")[1].split(",")[0])
    backlash = float(text.split("backlash about ")[1].split(" deg")[0])
    assert ratio == pytest.approx(124.0, rel=0.002)
    assert backlash == pytest.approx(math.degrees(truth.backlash), abs=0.05)


def test_optional_columns_may_be_missing_and_extra_ones_are_kept(tmp_path, truth):
    few = {
        k: truth.signals[k]
        for k in ("time", "encoder_position", "resolver_position", "motor_speed")
    }
    path = write_drive_csv(tmp_path / "few.csv", few)
    lines = path.read_text().splitlines()
    lines = [lines[0] + ",Temp_é [degC]"] + [
        f"{line},{20 + k * 1e-3}" for k, line in enumerate(lines[1:])
    ]
    extra = tmp_path / "extra.csv"
    extra.write_bytes("\n".join(lines).encode("latin-1") + b"\n")
    log = import_log(extra)
    assert set(log.recording.names) == {
        "encoder_position",
        "resolver_position",
        "motor_speed",
        "extra_Temp",
    }
    assert log.recording["extra_Temp"].values[3] == pytest.approx(20.003)
    assert log.report.has("extra-column")


def test_currents_are_peak_inside(tmp_path, truth):
    path = write_drive_csv(
        tmp_path / "log.csv", truth.signals, layout=DriveFormat(current_convention="peak")
    )
    log = import_log(path)  # nothing is stated: rms assumed, and stated
    assert log.report.has("convention-assumed")
    np.testing.assert_allclose(
        log.recording["current_ref"].values, math.sqrt(2) * truth.signals["current_ref"], rtol=1e-7
    )
    (tmp_path / "log_command.json").write_text('{"current": "peak"}')
    log = import_log(path)
    assert not log.report.has("convention-assumed")
    np.testing.assert_allclose(
        log.recording["current_ref"].values, truth.signals["current_ref"], rtol=1e-7
    )


HEADER = "Xms,C0Drive_axis_1r4821,C1Drive_axis_1r4820,Drive_axis_1.r62,Drive_axis_1.r63"


def rows(count=40, start=0.0):
    """A sine in degrees on both shafts, with the speed that belongs to it."""
    lines = []
    for k in range(count):
        angle, speed = 100 * math.sin(k / 8), 100 * math.cos(k / 8) / 8 / 360 / 0.0025 * 60
        lines.append(f"{start + 2.5 * k},{angle},{angle},{speed},{speed}")
    return lines


BAD = {
    "empty": ("", "empty"),
    "blank lines": ("\n\n  \n", "no line"),
    "header alone": (HEADER + "\n", "header alone"),
    "backwards": ("\n".join([HEADER, *rows(20), *rows(20)]) + "\n", "backwards"),
    "text in numbers": ("\n".join([HEADER, *rows(5), "12.5,abc,1,2,3"]) + "\n", "'abc'"),
    "infinite": ("\n".join([HEADER, *rows(5), "12.5,1e999,1,2,3"]) + "\n", "finite"),
    "word infinite": ("\n".join([HEADER, *rows(5), "12.5,inf,1,2,3"]) + "\n", "finite"),
    "underscore": ("\n".join([HEADER, *rows(5), "12.5,1_0,1,2,3"]) + "\n", "'1_0'"),
    "truncated": ("\n".join([HEADER, *rows(5), "12.5,1.0"]), "cut off"),
    "ragged": ("\n".join([HEADER, *rows(5), "12.5,1.0,2,3,4,5", *rows(3, 15)]) + "\n", "6 cells"),
    "decimal comma in commas": (
        HEADER + "\n" + "\n".join("1,5,2,5,3,5,4,5,5,5" for _ in range(5)) + "\n",
        "semicolons",
    ),
    "point and comma": (HEADER.replace(",", ";") + "\n1,5;2;3;4;5\n4.5;2;3;4;5\n", "thousands"),
    "no time stamp": ("\n".join([HEADER, *rows(5), ",1,1,1,1"]) + "\n", "no time stamp"),
    "one instant": ("\n".join([HEADER, "0,1,1,1,1", "0,1,1,1,1"]) + "\n", "single instant"),
    "two columns of one name": (HEADER + ",Xms\n" + "1,2,3,4,5,6\n" * 3, "both named"),
    "two columns of one parameter": (HEADER + ",Other.r62\n" + "1,2,3,4,5,6\n" * 3, "r62"),
    "no header": ("\n".join(rows(20)) + "\n", "no column is known|no time column"),
    "no time": ("Drive_axis_1.r62,Drive_axis_1.r63,Drive_axis_1.r4820\n1,2,3\n", "no time"),
    "no position": ("Xms,Drive_axis_1.r62,Drive_axis_1.r63\n1,2,3\n", "neither"),
    "binary": ("\x00\x01\x02" * 50, "zero byte"),
    "bad quotes": (HEADER + '\n1,"2,3,4,5\n', "quotes"),
}


@pytest.mark.parametrize(("content", "message"), BAD.values(), ids=BAD.keys())
def test_bad_files_are_refused_with_their_reason(tmp_path, content, message):
    path = tmp_path / "bad.csv"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        import_log(path)


def test_utf16_is_read_as_utf8_is(tmp_path):
    text = "\n".join([HEADER, *rows(20)]) + "\n"
    tables = []
    for name in ("utf-8", "utf-16", "utf-16-le"):
        path = tmp_path / f"{name}.csv"
        path.write_bytes((b"\xff\xfe" if name == "utf-16-le" else b"") + text.encode(name))
        tables.append(read_text_table(path).columns)
    for other in tables[1:]:
        assert list(other) == list(tables[0])
        assert all(np.array_equal(other[k], tables[0][k]) for k in other)


def test_damaged_utf16_and_long_lines_are_refused(tmp_path):
    path = tmp_path / "bad.csv"
    path.write_bytes(HEADER.encode("utf-16") + b"\x00\xd8\x00")
    with pytest.raises(FormatError, match="UTF-16"):
        import_log(path)
    path.write_bytes(HEADER.encode() + b"\n" + b"1" * 100_000)
    with pytest.raises(FormatError, match="longer than"):
        import_log(path)


def test_a_huge_table_is_refused_before_memory_is_used(tmp_path):
    from elevon.logs.formats.table import Limits

    path = tmp_path / "big.csv"
    path.write_text("\n".join([HEADER, *rows(2000)]))
    with pytest.raises(FormatError, match="limit of 1000 numbers"):
        read_text_table(path, limits=Limits(values=1000))
    with pytest.raises(FormatError, match="limit of 3"):
        read_text_table(path, limits=Limits(columns=3))


def test_a_gzip_bomb_stops_at_the_limit(tmp_path):
    import gzip

    from elevon.logs.formats.table import Limits

    path = tmp_path / "bomb.csv.gz"
    path.write_bytes(gzip.compress(b"\n" * 8_000_000))
    with pytest.raises(FormatError, match="expands"):
        read_text_table(path, limits=Limits(values=10_000))


def test_wrong_sign_and_shaft_are_named(tmp_path, truth):
    signals = dict(truth.signals)
    signals["encoder_position"] = -signals["encoder_position"]
    path = write_drive_csv(tmp_path / "log.csv", signals)
    with pytest.raises(InputError, match=r"r4821.*wrong sign"):
        import_log(path)
    signals = dict(truth.signals)
    signals["resolver_position"] = -signals["resolver_position"]
    path = write_drive_csv(tmp_path / "log2.csv", signals)
    with pytest.raises(InputError, match=r"r4820.*wrong sign"):
        import_log(path)
    signals = dict(truth.signals)
    signals["motor_speed"] = -signals["motor_speed"]
    path = write_drive_csv(tmp_path / "log3.csv", signals)
    with pytest.raises(InputError, match=r"r63.*wrong sign"):
        import_log(path)
    signals = dict(truth.signals)
    signals["encoder_position"] = 4.0 * signals["encoder_position"]  # the encoder's own wheel
    path = write_drive_csv(tmp_path / "log4.csv", signals, layout=DriveFormat(encoder_shaft="slow"))
    with pytest.raises(InputError, match="wrong shaft"):
        import_log(path)
    slow = DriveFormat(encoder_shaft="slow")
    with pytest.raises(InputError, match=r"fits no unit.*gear ratio of 80"):
        import_log(
            write_drive_csv(tmp_path / "l5.csv", truth.signals, layout=slow), gear_ratio=80.0
        )


def test_a_map_mends_what_the_log_cannot_say(tmp_path, truth):
    signals = dict(truth.signals)
    signals["encoder_position"] = -4.0 * signals["encoder_position"]
    path = write_drive_csv(tmp_path / "log.csv", signals, layout=DriveFormat(encoder_shaft="slow"))
    note = tmp_path / "map.toml"
    entry = '[[column]]\nname = "C0Drive_axis_1r4821"\nsignal = "encoder_position"\nunit = "deg"\n'
    note.write_text(entry + 'scale = 0.25\nsign = -1\nshaft = "slow"\n')
    log = import_log(path, column_map=note)
    np.testing.assert_allclose(
        log.recording["encoder_position"].values, truth.signals["encoder_position"], atol=1e-8
    )
    note.write_text(entry + 'scale = 0.25\nsign = 1\nshaft = "slow"\n')
    with pytest.raises(InputError, match="sign stated contradicts"):
        import_log(path, column_map=note)
    note.write_text(entry + 'scale = 0.25\nsign = -1\nshaft = "fast"\n')
    with pytest.raises(InputError, match="other shaft"):
        import_log(path, column_map=note)


def test_a_log_at_rest_says_that_units_are_not_confirmed(tmp_path, truth):
    standing = {k: np.full(500, float(v[0])) for k, v in truth.signals.items()}
    standing["time"] = truth.signals["time"][:500]
    log = import_log(write_drive_csv(tmp_path / "still.csv", standing))
    assert {f.place for f in log.report.findings if f.code == "unit-unconfirmed"} == {
        "resolver_position",
        "encoder_position",
    }


def test_gaps_duplicates_stuck_and_clipped_are_reported(tmp_path, truth):
    signals = {k: v.copy() for k, v in truth.signals.items()}
    signals["current_q_meas"] = np.clip(signals["current_q_meas"], -0.25, 0.25)
    signals["encoder_position"][3000:3600] = signals["encoder_position"][3000]
    keep = np.r_[0:1000, 1040:8000]
    signals = {k: v[keep] for k, v in signals.items()}
    signals["time"][5] = signals["time"][4]
    log = import_log(write_drive_csv(tmp_path / "log.csv", signals))
    codes = {(f.place, f.code) for f in log.report.findings}
    assert ("drive", "gap") in codes
    assert ("drive", "duplicates") in codes
    assert ("current_q_meas", "clipped") in codes
    assert ("encoder_position", "stuck") in codes
    assert [gap[2] for gap in log.report.clocks["drive"]["gaps"]] == [1, 40]
    assert log.report.clocks["drive"]["duplicates"] == 1
    assert len(log.recording.clocks["drive"]) == len(keep) - 1


def test_saturated_set_point_is_told_from_clipping(tmp_path):
    from tests.logs.conftest import servo_log

    fast = servo_log(seconds=5, amplitude=math.radians(45), bias=math.radians(60), frequency=0.2)
    log = import_log(write_drive_csv(tmp_path / "log.csv", fast.signals))
    assert log.report.has("saturated")
    assert not any(f.code == "clipped" and f.place == "speed_ref" for f in log.report.findings)


def test_time_in_whole_milliseconds_keeps_its_rate(tmp_path, truth):
    signals = {k: v[:4000] for k, v in truth.signals.items()}
    signals["time"] = np.floor(signals["time"] * 1000) / 1000
    log = import_log(write_drive_csv(tmp_path / "log.csv", signals))
    assert log.report.clocks["drive"]["rate_hz"] == pytest.approx(400.0, rel=1e-5)
    assert log.report.clocks["drive"]["gaps"] == []


def test_writer_refuses(tmp_path, truth):
    path = tmp_path / "log.csv"
    with pytest.raises(InputError, match="current_q_meas"):
        write_drive_csv(path, {"time": [0.0], "current_q_mea": [0.0]})
    with pytest.raises(InputError, match="shape"):
        write_drive_csv(path, {"time": [0.0, 1.0], "trigger": [0.0]})
    with pytest.raises(InputError, match="finite"):
        write_drive_csv(path, {"time": [0.0], "trigger": [math.nan]})
    with pytest.raises(InputError, match="distinguished"):
        DriveFormat(decimal_comma=True)
    write_drive_csv(path, {"time": [0.0], "trigger": [0.0]})
    with pytest.raises(OutputExistsError):
        write_drive_csv(path, {"time": [0.0], "trigger": [0.0]})
