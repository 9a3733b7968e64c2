"""An interrupted demonstration goes on with what is finished, and with nothing else."""

import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import elevon
from elevon import Actuator
from elevon.bench.hidden import RECOVERED
from elevon.calibrate.outcome import Calibration
from elevon.calibrate.validation import SignalError, Validation, ValidationTrace
from elevon.demo.story import Story
from elevon.estimate import Estimate
from elevon.plain import Plain


@pytest.fixture(scope="module")
def base():
    return Actuator.load("torino-rotary")


def found(base):
    fitted = base.with_values(
        {"friction.dynamic": 0.1 + 0.2, "drive.kind": "pwm", "backlash.total": 1.0 / 3.0e2},
        source="calibration",
    )
    paths = [*RECOVERED, "control.position_gain"]
    estimates = tuple(
        Estimate(
            1.0 / 7.0, 1e-3, interval=(1.0 / 9.0, 2.0 / 7.0), path=path, unit="1", given=("a", "b")
        )
        for path in paths
    )
    return Calibration(
        actuator=fitted, before=base, logs=(), parameters={item.path: item for item in estimates},
        findings=("what it says",),
    )  # fmt: skip


def validation(name, logs, factor):
    rng = np.random.default_rng(4)
    signals = ("encoder_position", "motor_speed", "current_q_meas")
    error = [
        SignalError(log, signal, "rad", factor / 3.0, 0.2, 1.0, math.nan, 3.0, None)
        for log in logs
        for signal in signals
    ]
    traces = [
        ValidationTrace(
            log,
            rng.normal(size=40),
            {s: rng.normal(size=40) for s in signals},
            {s: rng.normal(size=40) for s in signals},
            rng.normal(size=40) > 0.0,
        )
        for log in logs
    ]
    return Validation(name, "low", 10.0, tuple(error), dict.fromkeys(logs, "sine"), tuple(traces))


def test_results_come_back_from_json_to_the_bit(base):
    result = found(base)
    assert Calibration.from_dict(json.loads(json.dumps(result.to_dict()))) == result
    checked = validation("set", ["a.csv", "b.csv"], 1.0)
    other = Validation.from_dict(json.loads(json.dumps(checked.to_dict())))
    assert other == checked
    for new, old in zip(other.traces, checked.traces, strict=True):
        assert new.used.tolist() == old.used.tolist()
        assert new.time.tobytes() == old.time.tobytes()
        for name, values in old.simulated.items():
            assert new.simulated[name].tobytes() == values.tobytes()
        for name, values in old.measured.items():
            assert new.measured[name].tobytes() == values.tobytes()


def test_values_that_are_damaged_are_not_taken(base):
    data = found(base).to_dict()
    data["calibrated"]["parameters"]["entries"]["friction.dynamic"]["value"] = -1.0
    with pytest.raises(ValueError, match=r"friction\.dynamic"):
        Calibration.from_dict(data)


@dataclass(frozen=True)
class Kept(Plain):
    """A step's result."""

    x: float


@dataclass(frozen=True)
class Other(Plain):
    """A result of another form."""

    y: str


def made(story, page, x, kind=Kept, piece="life"):
    """Do the step, or take it; return its result and whether it was taken."""
    result = story.resumable("step", piece, kind, lambda: Kept(x), [page])
    return result.x, story.steps[-1].resumed


def test_a_step_counts_only_as_it_was_kept(tmp_path):
    page = tmp_path / "page.html"
    page.write_text("page")
    story = Story(tmp_path, "a")
    assert not story.resumes
    story.begin()
    assert made(story, page, 1.5) == (1.5, False)
    again = Story(tmp_path, "a")
    assert again.resumes
    assert made(again, page, 2.5) == (1.5, True)
    assert made(Story(tmp_path, "a"), page, 2.5, piece="calibration") == (2.5, False)
    assert made(Story(tmp_path, "a"), page, 2.5, Other) == (2.5, False)
    assert made(Story(tmp_path, "a"), page, 3.5) == (2.5, True)
    assert not Story(tmp_path, "b").resumes
    page.write_text("edited")
    assert made(Story(tmp_path, "a"), page, 4.5) == (4.5, False)
    file = tmp_path / "unfinished.log"
    file.write_text(file.read_text()[:-20])
    assert made(Story(tmp_path, "a"), page, 5.5) == (5.5, False)
    Story(tmp_path, "a").clear()
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


@pytest.mark.long
def test_the_whole_chain_interrupted_by_signals(tmp_path):
    """SIGINT to the group: within the life, behind the calibration, behind two diagnoses.

    Work is known by the package's files, so the package is a copy that nobody edits meanwhile.
    """
    copy = tmp_path / "package"
    shutil.copytree(Path(elevon.__file__).parent, copy / "elevon")
    out = tmp_path / "demo"
    unfinished = out / "unfinished.log"

    def has(name):
        return lambda: unfinished.is_file() and f'"item":"{name}"' in unfinished.read_text()

    moments = [
        (unfinished.is_file, 0.1, "no step is finished"),
        (has("calibration"), 0.1, "the unit's life, the calibration"),
        (has("inspection-2"), 0.1, " diagnoses"),
    ]
    command = [sys.executable, "-m", "elevon.cli", "demo", "--out", str(out), "--json"]
    for condition, wait, text in [*moments, (lambda: False, 0.0, "")]:
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            start_new_session=True, env={**os.environ, "PYTHONPATH": str(copy)},
        )  # fmt: skip
        while process.poll() is None and not condition():
            time.sleep(0.02)
        if process.poll() is None:
            time.sleep(wait)
            os.killpg(process.pid, signal.SIGINT)
        answer, messages = process.communicate(timeout=60)
        if text:
            assert (process.returncode, answer) == (130, ""), messages
            assert text in messages.splitlines()[-1]
            assert not [path for path in out.rglob("*") if ".part" in path.name]
    assert process.returncode == 0, messages
    result = json.loads(answer)
    resumed = [step["name"] for step in result["steps"] if step["resumed"]]
    assert [name.split()[0] for name in resumed] == ["the", "calibration", "diagnosis"]
    assert "kept from the interrupted run" in (out / "report.html").read_text("utf-8")
