"""ASAM MDF 4, TDMS and MCAP files, written by the libraries' own writers; skipped without them."""

import json
import sys

import numpy as np
import pytest

from elevon.cli import main
from elevon.errors import FormatError
from elevon.logs.formats.detect import read_table
from elevon.logs.formats.table import Limits
from elevon.logs.read import read_log

RATIO = 50.0


@pytest.fixture(scope="module")
def servo():
    """A servo behind a gear: role to (values, unit), every 2 ms; a temperature every 0.1 s."""
    time = np.arange(0.0, 6.0, 0.002)
    command = 0.4 * np.sin(3.0 * time) + 0.1 * np.sin(11.0 * time)
    output = np.interp(time - 0.02, time, command)
    speed = RATIO * np.gradient(output, time)
    current = 1.5 * np.tanh(speed) + 0.02 * np.gradient(speed, time) + 0.05 * speed
    fast = {
        "Position setpoint": (np.degrees(command), "deg"),
        "Actual position": (np.degrees(output), "deg"),
        "Motor speed": (speed * 30.0 / np.pi, "rpm"),
        "Motor current": (current, "A"),
    }
    slow = np.arange(0.0, 6.0, 0.1)
    return time, fast, slow, 25.0 + slow


def check(log, servo):
    time, fast, slow, warm = servo
    np.testing.assert_allclose(log.time, time, atol=1e-9)
    np.testing.assert_allclose(log["command"], np.radians(fast["Position setpoint"][0]), atol=1e-12)
    np.testing.assert_allclose(log.output, np.radians(fast["Actual position"][0]), atol=1e-12)
    np.testing.assert_allclose(log.speed, fast["Motor speed"][0] * np.pi / 30.0, rtol=1e-9)
    np.testing.assert_allclose(log.current, fast["Motor current"][0])
    inside = time <= slow[-1]
    expected = 273.15 + np.interp(time[inside], slow, warm)
    np.testing.assert_allclose(log["temperature"][inside], expected)
    assert np.isnan(log["temperature"][~inside]).all()


def written_mdf(path, servo):
    asammdf = pytest.importorskip("asammdf")
    time, fast, slow, warm = servo
    content = asammdf.MDF(version="4.10")
    signals = [
        asammdf.Signal(samples=values, timestamps=time, name=name, unit=unit)
        for name, (values, unit) in fast.items()
    ]
    content.append(signals)
    temperature = asammdf.Signal(samples=warm, timestamps=slow, name="Winding temp", unit="°C")
    content.append([temperature])
    content.save(path, overwrite=True)
    content.close()
    return path


def written_tdms(path, servo):
    nptdms = pytest.importorskip("nptdms")
    time, fast, slow, warm = servo

    def channel(group, name, values, unit, step):
        stated = {"wf_increment": step, "wf_start_offset": 0.0, "unit_string": unit}
        return nptdms.ChannelObject(group, name, values, properties=stated)

    with nptdms.TdmsWriter(str(path)) as writer:
        objects = [channel("drive", n, v, unit, time[1]) for n, (v, unit) in fast.items()]
        writer.write_segment([*objects, channel("slow", "Winding temp", warm, "°C", slow[1])])
    return path


def written_mcap(path, servo, encoding="json"):
    writer_of = pytest.importorskip("mcap.writer")
    pytest.importorskip("mcap_ros2")
    time, fast, slow, warm = servo
    names = {"Position setpoint": "position_setpoint_deg", "Actual position": "position_deg",
             "Motor speed": "motor_speed_rpm", "Motor current": "current_A"}  # fmt: skip
    with path.open("wb") as stream:
        writer = writer_of.Writer(stream)
        writer.start()
        drive, heat = (
            writer.register_channel(topic=topic, message_encoding=encoding, schema_id=0)
            for topic in ("/drive", "/heat")
        )
        rows = [
            (at, drive, {names[n]: float(v[k]) for n, (v, _) in fast.items()} | {"mode": "run"})
            for k, at in enumerate(time)
        ]
        rows += [(at, heat, {"temp_degc": float(v)}) for at, v in zip(slow, warm, strict=True)]
        for at, channel, row in sorted(rows, key=lambda item: item[0]):
            stamp = 1_700_000_000_000_000_000 + round(1e9 * at)
            writer.add_message(channel, stamp, json.dumps(row).encode(), stamp)
        writer.finish()
    return path


WRITERS = {"mf4": written_mdf, "tdms": written_tdms, "mcap": written_mcap}


@pytest.mark.parametrize("ending", WRITERS)
def test_a_measurement_file_is_read_without_a_map(tmp_path, servo, ending):
    path = WRITERS[ending](tmp_path / f"log.{ending}", servo)
    check(read_log(path), servo)
    (note,) = [note for note in read_table(path).notes if "straight lines" in note]
    assert "60 samples" in note


@pytest.mark.parametrize("ending", WRITERS)
def test_a_damaged_one_and_one_beyond_the_limits_are_refused(tmp_path, servo, ending, capsys):
    path = WRITERS[ending](tmp_path / f"log.{ending}", servo)
    with pytest.raises(FormatError, match="limit"):
        read_table(path, limits=Limits(values=1000))
    cut = tmp_path / f"cut.{ending}"
    cut.write_bytes(path.read_bytes()[:80])
    assert main(["import", str(cut), "--guess"]) == 2
    assert cut.name in capsys.readouterr().err


def test_messages_that_nothing_decodes_are_named(tmp_path, servo):
    path = written_mcap(tmp_path / "log.mcap", servo, encoding="flatbuffer")
    with pytest.raises(FormatError, match="no channel of numbers"):
        read_table(path)


@pytest.mark.parametrize(
    ("first", "package"), [(b"MDF     4.10", "asammdf"), (b"TDSm", "nptdms"),
                           (b"\x89MCAP0\r\n", "mcap")],
)  # fmt: skip
def test_without_the_library_the_command_that_installs_it_is_named(
    tmp_path, monkeypatch, capsys, first, package
):
    for name in [n for n in sys.modules if n.partition(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    path = tmp_path / "log.bin"
    path.write_bytes(first + bytes(200))
    assert main(["import", str(path), "--guess"]) == 2
    message = capsys.readouterr().err
    assert package in message
    assert "elevon[measurements]" in message
