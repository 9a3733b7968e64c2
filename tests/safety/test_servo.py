"""The servos' campaign: causes of each hazard, monitors, rates of one's own, resuming."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import elevon
from elevon.cli import main
from elevon.errors import Interrupted
from elevon.safety import Watched, campaign, safety, servo
from elevon.safety.hazards import observe
from elevon.safety.rows import Failure
from elevon.safety.study import Study, study_of

TIME = np.arange(0.0, servo.LENGTH, 1.0 / 400.0)
LIMITS = {"speed": 50.0, "current": 20.0, "trip": 0.0, "supply": 380.0}
ROW = servo.ServoRow("made", (), amplitude=0.1, load=100.0, supply=380.0)


def run(course="hold", **signals):
    """Hazards of a made recording: an output that stands where it is commanded."""
    names = servo.RECORD.partition("@")[0].split(",")
    values = {name: np.zeros_like(TIME) for name in names}
    values |= {name: np.broadcast_to(value, TIME.shape) for name, value in signals.items()}
    return observe(Watched(TIME, values, replace(ROW, course=course), "ok", LIMITS), servo.HAZARDS)


def test_an_output_that_follows_shows_no_hazard() -> None:
    """Held, moved, or moved all the time."""
    for course in servo.COURSES:
        assert run(course) == {}
    sine = 0.1 * np.sin(2.0 * np.pi * 0.3 * TIME)
    late = 0.1 * np.sin(2.0 * np.pi * 0.3 * (TIME - 0.03))
    assert run("track", command=sine, output_position=late, encoder_position=late) == {}


AWAY = np.where(TIME > 2.0, 0.02, 0.0)


@pytest.mark.parametrize(
    ("name", "course", "signals"),
    [
        ("uncommanded motion", "hold", {"output_position": AWAY, "encoder_position": AWAY}),
        ("loss of motion", "move", {"command": np.where(TIME > 1.0, 0.05, 0.0)}),
        ("jam", "track", {"command": 0.02, "current_q": 15.0}),
        ("oscillation", "hold", {"output_position": 4e-3 * np.sin(2.0 * np.pi * 8.0 * TIME)}),
        ("runaway", "hold", {"output_position": np.clip(TIME - 2.0, 0.0, 0.2),
                             "output_speed": 1.0}),
        ("wrong position reported", "hold", {"encoder_position": AWAY}),
    ],
)  # fmt: skip
def test_each_hazard_is_seen(name, course, signals) -> None:
    """A planted course of signals shows it, and a tenth of it does not."""
    assert name in run(course, **signals)
    small = {key: np.asarray(value) * 0.1 for key, value in signals.items()}
    assert name not in run(course, **small)


@pytest.fixture(scope="module", params=["torino-rotary", "nasa-ballscrew"])
def lasting(request):
    """The campaign of lasting single failures alone."""
    population = Study.rows

    def singles(self, seed):
        rows = population(self, seed)
        return (r for r in rows if len(r.faults) < 2 and r.lasting and not r.late)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Study, "rows", singles)
        patch.setattr(Study, "switching_rows", lambda *_: iter([]))
        patch.setattr(campaign, "TRIPLES", 1)
        return safety(request.param, high=0)


def test_causes_of_each_hazard(lasting) -> None:
    """Five hazards at least have failures that cause them; a unit without a failure has none."""
    causes = {item.name: {cut.failures[0] for cut in item.cut_sets} for item in lasting.hazards}
    assert sum(bool(failures) for failures in causes.values()) >= 5
    assert all(item.healthy == 0 for item in lasting.hazards)
    assert "jam@transmission" in causes["jam"]
    assert "stuck@sensor.resolver" in causes["runaway"]
    assert "dead@sensor.encoder" in causes["wrong position reported"]
    assert any(name.startswith("dropout") for name in causes["oscillation"])
    assert {"open_phase@motor.phase_a", "jam@transmission"} <= causes["loss of motion"]


def test_monitors_announce(lasting) -> None:
    """A dead encoder is found by both positions, a shorted switch by the trip; friction by none."""
    known = {item.name: item for item in lasting.failures}
    assert known["dead@sensor.encoder"].evident
    assert known["shorted_switch@inverter.a_high"].check == "drive tripped"
    assert not known["lubrication@transmission=0.9"].evident
    assert known["lubrication@transmission=0.9"].check == "servo test"
    covered = {item.monitor: item.share for item in lasting.coverage}
    assert covered["monitor: positions disagree"] > 0.05
    assert sum(covered.values()) <= 1.0 + 1e-9


def test_a_monitor_is_a_parameter(tmp_path: Path) -> None:
    """A limit that any motion exceeds announces the unit without a failure, so nothing at all."""
    file = tmp_path / "checks.toml"
    file.write_text('[[monitor]]\nname = "wild"\nsignal = "motor_sped"\nlimit = 1.0\n'
                    'time = "10 ms"\n')  # fmt: skip
    assert main(["safety", "torino-rotary", "--checks", str(file)]) == 2
    with pytest.raises(elevon.ElevonError, match="motor_speed"):
        safety("torino-rotary", checks=file)


def test_an_interrupted_campaign_goes_on(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """What is finished is not run again, and the answer is that of an undisturbed one."""
    study = study_of(elevon.Actuator.load("torino-rotary"), None, None, ())
    jam = Failure("jam", "transmission", 100.0)
    template = servo.template(study.actuator)
    rows = list(servo.population([jam], 0, template))
    monkeypatch.setattr(Study, "rows", lambda *_: iter(rows))
    monkeypatch.setattr(Study, "switching_rows", lambda *_: iter([]))
    monkeypatch.setattr(campaign, "TRIPLES", 1)
    monkeypatch.setattr(campaign, "CHUNK", 8)
    batches: list[int] = []
    one = campaign.Runner._batch

    def counted(*given):
        if len(batches) == 3 and not (tmp_path / "stopped").exists():
            (tmp_path / "stopped").touch()
            raise Interrupted("stopped by hand")
        batches.append(1)
        return one(*given)

    monkeypatch.setattr(campaign.Runner, "_batch", counted)
    with pytest.raises(Interrupted):
        safety("torino-rotary", high=0, folder=tmp_path / "a")
    finished = (tmp_path / "a" / "finished.log").read_text().count("outcomes")
    assert finished == 3 < len(rows) / 8
    batches.clear()
    resumed = safety("torino-rotary", high=0, folder=tmp_path / "a")
    again = len(batches)
    fresh = safety("torino-rotary", high=0, folder=tmp_path / "b")
    assert again == len(batches) - again - finished
    assert json.dumps(resumed.to_dict()) == json.dumps(fresh.to_dict())


def test_rates_of_ones_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A file's rate, ratio and interval are those of the answer; other parts stay."""
    study = study_of(elevon.Actuator.load("torino-rotary"), None, None, ())
    rows = [replace(servo.template(study.actuator), group="one failure", course="track",
                    faults=(Failure("jam", "transmission", 100.0),))]  # fmt: skip
    monkeypatch.setattr(Study, "rows", lambda *_: iter(rows))
    monkeypatch.setattr(Study, "switching_rows", lambda *_: iter([]))
    monkeypatch.setattr(campaign, "TRIPLES", 1)
    file = tmp_path / "rates.toml"
    file.write_text('[[part]]\nname = "mine"\nrate = 4e-6\nfactor = 2.0\nsource = "test"\n'
                    'mode = [{ failure = ["jam@transmission"], ratio = 0.5, evident = false, '
                    'source = "test" }]\n')  # fmt: skip
    result = safety("torino-rotary", rates=file, flight_time="2 h", high=0)
    jam = next(item for item in result.failures if item.name == "jam@transmission")
    assert (jam.rate, jam.rate_low, jam.rate_high, jam.alpha) == (2e-6, 1e-6, 4e-6, 0.5)
    assert (jam.evident, jam.interval, jam.part) == (False, 1000.0, "mine")
    hazard = next(item for item in result.hazards if item.name == "jam")
    assert (hazard.mean, hazard.interval) == (2e-6, (1e-6, 4e-6))
    assert result.flight == 2.0
