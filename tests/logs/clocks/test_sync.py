"""Two clocks aligned: offset and drift found, with intervals that hold the truth."""

import math

import numpy as np
import pytest

from elevon.errors import FormatError, InputError
from elevon.logs.clocks.sync import align_clocks, find_trigger
from elevon.logs.formats.drive import write_drive_csv
from elevon.logs.formats.loadcell import (
    read_loadcell,
    write_loadcell,
)
from elevon.logs.importing import import_log


def shared_motion(t):
    return np.sin(2 * math.pi * 0.21 * t) + 0.5 * np.sin(2 * math.pi * 0.9 * t + 1) * (t > 3)


def pair(seed, *, offset=2.3456, drift=1.5e-3, noise=0.05, rate=80.0, seconds=16.0):
    rng = np.random.default_rng(seed)
    drive = np.arange(0.0, 20.0, 1 / 400)
    signal = shared_motion(drive) + rng.normal(0, noise, len(drive))
    cell_time = np.arange(0.0, seconds, 1 / rate)
    value = (
        30
        + 25 * shared_motion(offset + (1 + drift) * cell_time)
        + rng.normal(0, 25 * noise, len(cell_time))
    )
    trigger = (drive >= offset).astype(float)
    return drive, signal, cell_time, value, trigger


def test_the_trigger_is_known_to_a_sample():
    edge = find_trigger([0.0, 0.1, 0.2, 0.3, 0.4], [4.0, 4.0, 12.0, 12.0, 4.0])
    assert edge.time == pytest.approx(0.15)
    assert edge.std == pytest.approx(0.1 / math.sqrt(12))
    assert edge.later == 1
    falling = find_trigger([0.0, 0.1, 0.2], [1.0, 1.0, 0.0])
    assert falling.time == pytest.approx(0.15)
    assert find_trigger([0.0, 0.1], [1.0, 1.0]) is None


@pytest.mark.parametrize("with_edge", [True, False])
def test_offset_and_drift_are_recovered_with_honest_intervals(with_edge):
    scores = []
    for seed in range(12):
        drive, signal, cell_time, value, trigger = pair(seed)
        edge = find_trigger(drive, trigger) if with_edge else None
        fit = align_clocks(drive, signal, cell_time, value, edge=edge)
        assert abs(fit.offset - 2.3456) < 0.01
        assert abs(fit.drift - 1.5e-3) < 1e-3
        scores.append((fit.offset - 2.3456) / fit.offset_std)
        scores.append((fit.drift - 1.5e-3) / fit.drift_std)
    assert np.mean(np.abs(scores) < 1.96) > 0.75
    assert 0.3 < np.std(scores) < 2.0


def test_the_edge_sharpens_the_offset():
    drive, signal, cell_time, value, trigger = pair(3, noise=0.3)
    blind = align_clocks(drive, signal, cell_time, value)
    edge = find_trigger(drive, trigger)
    sharp = align_clocks(drive, signal, cell_time, value, edge=edge)
    assert sharp.offset_std < blind.offset_std
    assert sharp.offset_std <= 1.05 * edge.std
    assert sharp.method == "trigger and correlation"


def test_a_periodic_motion_without_trigger_is_refused_as_ambiguous():
    drive = np.arange(0.0, 20.0, 1 / 400)
    cell_time = np.arange(0.0, 12.0, 1 / 80)
    wave = lambda t: np.sin(2 * math.pi * 0.5 * t)  # noqa: E731
    noise = np.random.default_rng(4).normal(0, 0.05, len(cell_time))
    with pytest.raises(InputError, match="repeats"):
        align_clocks(drive, wave(drive), cell_time, wave(cell_time + 3.1) + noise)


def test_no_motion_in_common_leaves_the_trigger_alone():
    drive, signal, cell_time, _, trigger = pair(0)
    silent = np.random.default_rng(1).normal(0, 0.1, len(cell_time))
    fit = align_clocks(drive, signal, cell_time, silent, edge=find_trigger(drive, trigger))
    assert fit.method == "trigger"
    assert math.isinf(fit.drift_std)
    with pytest.raises(InputError, match="variance"):
        align_clocks(drive, signal, cell_time, silent)


@pytest.mark.parametrize("text", [
    "0,1\n0.1,2\n0.2,3\n",
    "time,value\n0,1\n0.1,2\n0.2,3\n",
    "\ufefftime [s];value [N]\r\n0;1\r\n0,1;2\r\n0,2;3\r\n",
    "time [ms]\tvalue [N]\n0\t1\n100\t2\n200\t3\n",
    "0 1\n100 2\n200 3\n",
    "t;v\n0,0;1,0\n0,1;2,0\n0,2;3,0\n",
])  # fmt: skip
def test_loadcell_dialects(tmp_path, text):
    path = tmp_path / "cell.csv"
    path.write_bytes(text.encode("utf-8"))
    log = read_loadcell(path)
    np.testing.assert_allclose(log.time, [0.0, 0.1, 0.2])
    np.testing.assert_allclose(log.value, [1.0, 2.0, 3.0])
    assert log.unit == "N"


def test_loadcell_refusals(tmp_path):
    path = tmp_path / "cell.csv"
    for text, message in (
        ("time,value\n", "header alone"),
        ("1,2,3\n4,5,6\n", "two columns"),
        ("0,1\n1,\n", "no number"),
        ("0,1\n0.2,2\n0.1,3\n", "backwards"),
        ("time [s],value [lbs]\n0,1\n", "unit"),
        ("time [A],value [N]\n0,1\n", "unit"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=message):
            read_loadcell(path)


def test_loadcell_written_is_read(tmp_path):
    path = write_loadcell(tmp_path / "cell.csv", [0.0, 0.0125], [1.25, -2.5], unit="N m")
    log = read_loadcell(path)
    np.testing.assert_array_equal(log.time, [0.0, 0.0125])
    np.testing.assert_array_equal(log.value, [1.25, -2.5])
    assert log.unit == "N m"
    with pytest.raises(InputError, match="finite"):
        write_loadcell(tmp_path / "c2.csv", [0.0], [math.inf])


def test_a_load_cell_beside_the_log_is_joined(tmp_path, truth):
    signals = dict(truth.signals)
    write_drive_csv(tmp_path / "run.csv", signals)
    cell_time = np.arange(0.0, 17.0, 1 / 80)
    drive = signals["time"]
    moved = truth.trigger + (1 + 8e-4) * cell_time
    force = 40 * np.sign(np.interp(moved, drive, signals["motor_speed"]))
    force += np.random.default_rng(2).normal(0, 1.0, len(cell_time))
    write_loadcell(tmp_path / "run_loadcell.csv", cell_time, force)
    (tmp_path / "run_command.toml").write_text(
        'waveform = "sine"\namplitude = "7 deg"\nfrequency = 0.2\nbrake = "on"\narm = 0.1\n'
        'chain_ratio = 4\ncurrent = "rms"\nnote_by = "somebody"\n'
    )
    log = import_log(tmp_path / "run.csv")
    sync = log.report.synchronisation
    assert sync["offset_s"] == pytest.approx(truth.trigger, abs=0.01)
    assert sync["drift"] == pytest.approx(8e-4, abs=max(4 * sync["drift_std"], 1e-4))
    np.testing.assert_allclose(log.recording["load_cell_torque"].values, force * 0.025, rtol=1e-7)
    np.testing.assert_allclose(log.recording.clocks["load_cell"].time, moved, atol=0.02)
    note = log.recording.meta["command_note"]
    assert note["parameters"] == pytest.approx({"amplitude": math.radians(7), "frequency": 0.2})
    assert note["brake"] is True
    assert log.report.has("key-ignored")
    log.recording.save(tmp_path / "run.parquet")


def test_an_unsynchronised_load_cell_is_kept_and_said(tmp_path, truth):
    signals = {k: v for k, v in truth.signals.items() if k != "trigger"}
    write_drive_csv(tmp_path / "run.csv", signals)
    cell_time = np.arange(0.0, 17.0, 1 / 80)
    write_loadcell(
        tmp_path / "x.csv", cell_time, np.random.default_rng(2).normal(0, 1.0, len(cell_time))
    )
    log = import_log(tmp_path / "run.csv", loadcell=tmp_path / "x.csv")
    assert log.report.has("not-synchronised")
    assert "load_cell_force" in log.recording


def test_a_missing_load_cell_is_an_error(tmp_path, truth):
    path = write_drive_csv(tmp_path / "run.csv", truth.signals)
    with pytest.raises(InputError, match="no such file"):
        import_log(path, loadcell=tmp_path / "none.csv")
    (tmp_path / "run_loadcell.csv").write_text("")
    with pytest.raises(FormatError, match="empty"):
        import_log(path)
