"""A log on the page of the live bench, its model beside it; what a bench is told at its start."""

from pathlib import Path

import numpy as np
import pytest

from elevon import Actuator
from elevon.cli.elsewhere import _bench
from elevon.errors import InputError
from elevon.live import replay
from elevon.live.app import Guard
from elevon.live.bench import LiveBench
from elevon.live.health import Examiner, Health, Request
from elevon.live.replay import LogReplay
from elevon.live.unit import LiveUnit
from tests.live.serving import SINE

FAULT = {"backlash@transmission": "0.5 deg"}


def _log(folder, seconds, fault=None, seed=1):
    """A log as the bench records it, of a motion that runs already."""
    unit = LiveUnit(Actuator.load("torino-rotary"), fidelity="low", seed=seed)
    bench = LiveBench(unit, folder=folder)
    bench.act({"command": SINE} | ({} if fault is None else {"fault": fault}))
    while unit.time < 1.0:
        bench.loop.sample()
    bench.act({"record": True})
    while unit.time < 1.0 + seconds:
        bench.loop.sample()
    return bench.act({"record": False})["files"][0]


def test_a_log_is_played_and_takes_no_commands(tmp_path, monkeypatch):
    monkeypatch.setattr(replay, "_diagnosed", lambda *_: (Health(status="healthy"), []))
    actuator = Actuator.load("torino-rotary")
    played = LogReplay.of_file(_log(tmp_path, 1.0), actuator)
    names = {signal["name"] for signal in played.describe()["signals"]}
    assert {"output_position", "motor_speed"} <= names
    while played.source.status[0] == "ok":
        played.loop.sample()
    assert played.source.time == pytest.approx(1.0, abs=0.01)
    assert played.state()["health"]["status"] == "healthy"
    played.act({"restart": True})
    assert played.source.status[0] == "ok"
    with pytest.raises(InputError, match="a log is played"):
        played.act({"command": SINE})


@pytest.mark.long
def test_the_model_stands_beside_a_log_with_its_residual(tmp_path):
    actuator = Actuator.load("torino-rotary")
    played = LogReplay.of_file(_log(tmp_path, 12.0, FAULT), actuator)
    assert played.health.status == "faulty"
    assert played.health.faults[0].kind == "backlash"
    stems = [name.removesuffix("_residual") for name in played.source.names if "_residual" in name]
    assert stems
    at = {name: k for k, name in enumerate(played.source.names)}
    table = played.source.table
    for stem in stems:
        difference = table[:, at[f"{stem}_logged"]] - table[:, at[f"{stem}_model"]]
        np.testing.assert_allclose(table[:, at[f"{stem}_residual"]], difference, atol=1e-12)
        assert np.abs(difference).max() > 0.0


@pytest.mark.long
def test_a_mission_gives_the_remaining_life_and_a_baseline_is_taken(tmp_path):
    mission = Path(__file__).parents[2] / "examples" / "mission.toml"
    (tmp_path / "healthy").mkdir()
    base = _log(tmp_path / "healthy", 12.0, seed=2)
    examiner = Examiner(Actuator.load("torino-rotary"), [base], str(mission))
    bench = LiveBench(LiveUnit(Actuator.load("torino-rotary"), fidelity="low"))
    bench.act({"command": SINE, "fault": FAULT})
    while bench.unit.time < 11.1:
        bench.loop.sample()
    health = examiner.examine(Request(_log(tmp_path, 12.0, FAULT), bench.stretch().motion))
    assert health.status == "faulty"
    assert health.remaining
    assert "no prediction" not in health.remaining


@pytest.mark.parametrize(("token", "refused"), [("", True), ("wrong", True), ("secret", False)])
def test_a_network_address_asks_for_its_token(token, refused):
    guard = Guard("0.0.0.0", "secret")
    assert not guard.local
    reason = guard.refuses({"host": "bench.example:8484"}, token)
    assert (reason is not None) == refused
    other = guard.refuses({"host": "bench.example:8484", "origin": "http://evil.example"}, "secret")
    assert other[0] == 403
    assert "origin" in other[1]


def test_a_calibrated_file_is_what_diagnosis_holds_for_healthy(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('base = "torino-rotary"\n[load]\nstiffness = 4000\n')
    options = {"fidelity": "low", "seed": 0, "factor": 1.0, "out": tmp_path, "mission": None}
    made = _bench(str(file), None, baselines=[], hide_truth=False, **options)
    assert made.unit.actuator.parameters.value("load.stiffness") == 4000.0
    with pytest.raises(InputError, match="no such file"):
        _bench(str(file), None, baselines=[tmp_path / "none.csv"], hide_truth=False, **options)
