"""The one log: roles, clocks, parts, what was derived of it, how it is read."""

from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from elevon import Recording
from elevon.errors import DamageError, InputError, VersionError
from elevon.logs.drive import drive_log
from elevon.logs.log import Log, bridged, per_log
from elevon.logs.read import read_log, read_logs
from elevon.recording.channel import Channel, Clock

ROLES = {
    "speed_ref": "speed_ref",
    "motor_speed": "motor_speed",
    "torque_current": "i",
    "state": "s",
}


def recording(**meta):
    fast = Clock("fast", 5.0 + 0.01 * np.arange(400))
    slow = Clock("slow", 5.0 + 0.1 * np.arange(40))
    wave = np.sin(3.0 * fast.time)
    channels = [
        Channel("speed_ref", "rad/s", wave, fast),
        Channel("motor_speed", "rad/s", 0.9 * wave, fast),
        Channel("i", "A", 2.0 * slow.time, slow),
        Channel("s", "1", np.arange(40) // 10, slow),
    ]
    return Recording(channels, meta={"roles": ROLES, **meta})


def test_channels_of_other_clocks_are_read_at_the_logs_instants():
    log = Log.of(recording(), "a")
    assert (log.time[0], log.start, log.units["state"]) == (0.0, 5.0, "1")
    known = log.time <= 3.9
    np.testing.assert_allclose(log.current[known], 2.0 * (log.time + 5.0)[known])  # a straight line
    assert set(log["state"]) == {0.0, 1.0, 2.0, 3.0}  # a state is the last one, never between
    there = log.on("torque_current")
    assert len(there.time) == 40
    assert there.on("state") is there


def test_a_role_that_is_missing_is_named_with_the_nearest():
    log = Log.of(recording(), "a")
    with pytest.raises(InputError, match=r"a: no channel has the role 'motor_sped'.*motor_speed"):
        log["motor_sped"]
    assert log.get("load") is None
    assert not log.has("motor_speed", "load")
    with pytest.raises(InputError, match="'load'"):
        Log.of(recording(), "a", clock="load")


def test_the_stand_says_what_it_set():
    stand = {"name": "rig", "parameters": {"load.factor": 1.5}, "rig_moves": True}
    log = Log.of(recording(stand=stand, acquisition={"cutoff_hz": 250.0}), "a")
    assert (log.stand.name, log.stand.moves_output, log.stand.cutoff) == ("rig", True, 250.0)
    assert log.stand.parameters == {"load.factor": 1.5}
    assert not log.stand.whole_load
    assert Log.of(recording(scenario={}), "a").stand.whole_load  # a run's own recording


def test_a_part_begins_at_zero_and_remembers_nothing():
    log = Log.of(recording(), "a")
    calls = []

    @per_log
    def top(item):
        calls.append(item)
        return float(item.speed.max())

    assert top(log) == top(log)
    part = log.part((log.time >= 1.0) & (log.time < 2.0), 1.0, 2.0)
    assert (len(part.time), part.start) == (100, 6.0)
    assert part.time[0] == pytest.approx(0.0, abs=1e-12)
    top(part)
    assert calls == [log, part]
    assert not part.counting(part.time > 2.0).good.any()
    assert part.without("state").channels.keys() == log.channels.keys() - {"state"}


def test_gaps_are_bridged_by_straight_lines_and_states_by_the_last():
    time = np.arange(5.0)
    gap = np.array([0.0, np.nan, 2.0, np.nan, 8.0])
    np.testing.assert_array_equal(bridged(time, gap), [0.0, 1.0, 2.0, 5.0, 8.0])
    np.testing.assert_array_equal(bridged(time, gap, "1"), [0.0, 0.0, 2.0, 2.0, 8.0])


def test_a_drives_log_is_made_once():
    log = Log.of(recording(), "a")
    speed = log.speed.copy()
    speed[7] = np.nan
    ready = drive_log(replace(log, channels={**log.channels, "motor_speed": speed}))
    assert np.flatnonzero(~ready.good).tolist() == [7]
    assert np.isfinite(ready.speed).all()
    assert drive_log(ready) is ready


def test_an_own_recording_and_a_log_are_read_alike(tmp_path):
    path = recording().save(tmp_path / "a.parquet")
    log = read_log(path)
    assert log.channels.keys() == ROLES.keys()
    assert log.name == "a.parquet"
    (tmp_path / "b").mkdir()
    other = recording().save(tmp_path / "b" / "a.parquet")
    names = [item.name for item in read_logs([path, other])]
    assert names == [f"{tmp_path.name}/a.parquet", "b/a.parquet"]


@pytest.mark.parametrize("text", ['{"a":' * 100_000, "{}", '{"schema": 3}', "\0"])
def test_a_recording_with_a_damaged_description_is_no_log_of_somebody_else(tmp_path, text):
    path = recording().save(tmp_path / "a.parquet")
    table = pq.read_table(path)
    pq.write_table(table.replace_schema_metadata({"elevon": text}), path)
    with pytest.raises(DamageError, match="description is damaged"):
        read_log(path)


@pytest.mark.parametrize("ending", [".parquet", ".nc", ".mat", ".csv"])
def test_a_recording_of_a_later_layout_is_no_log_of_somebody_else(tmp_path, monkeypatch, ending):
    recording().save(tmp_path / f"a{ending}")
    path = next(tmp_path.glob(f"*{ending}"))
    monkeypatch.setattr("elevon.recording.header._READ", (1,))
    with pytest.raises(VersionError, match="layout has version"):
        read_log(path)
