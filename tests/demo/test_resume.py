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
from types import SimpleNamespace

import numpy as np
import pytest

import elevon
from elevon import Actuator
from elevon.bench.hidden import RECOVERED, hidden_actuator
from elevon.bench.procedure import load_procedure
from elevon.calibrate.outcome import Calibration, by_path
from elevon.calibrate.validation import SignalError, Validation, ValidationTrace
from elevon.cli import main
from elevon.demo.finished import FinishedSteps, work_key
from elevon.demo.results import Backlashes, Step
from elevon.demo.run import run_demo
from elevon.errors import OutputExistsError
from elevon.estimate import Estimate
from elevon.plain import Plain
from elevon.report import Report
from elevon.report.checks import Check
from elevon.reproduce.backlash.campaign import RowResult
from elevon.reproduce.backlash.table import measured_rows
from tests.patches import put

PLACES = ("backlash", "bench", "calibration", "before", "after", "report")


@pytest.fixture(scope="module")
def base():
    return Actuator.load("torino-rotary")


def backlashes():
    rows = [
        RowResult(row, 1.0 / 3.0, row.measured_total_deg, math.pi, 0.1, 0.2, 0.3, 0.0045)
        for row in measured_rows()
    ]
    return Backlashes(tuple(rows), (Check("one", 0.1, 0.2, "deg"), Check("nan", math.nan, 1.0)))


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
        actuator=fitted, before=base, logs=(), parameters=by_path(estimates),
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
    table = backlashes()
    again = Backlashes.from_dict(json.loads(json.dumps(table.to_dict())))
    assert again.rows == table.rows
    assert repr(again.checks) == repr(table.checks)
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


def test_the_work_is_known_by_version_seed_and_actuator_files(base, monkeypatch):
    hidden = hidden_actuator(base, 0)
    keys = {
        work_key(0, base, hidden),
        work_key(1, base, hidden),
        work_key(0, base, hidden_actuator(base, 1)),
        work_key(0, base.with_values({"gear.ratio": 125.0}), hidden),
    }
    assert work_key(0, base, hidden) in keys
    monkeypatch.setattr(elevon, "__version__", "0.0.1", raising=False)
    keys.add(work_key(0, base, hidden))
    assert len(keys) == 5


@dataclass(frozen=True)
class Kept(Plain):
    """A step's result."""

    x: float


def test_a_step_counts_only_as_it_was_kept(tmp_path):
    page = tmp_path / "page.html"
    page.write_text("page")
    kept = FinishedSteps(tmp_path, "a" * 32)
    assert not kept.begun(force=False)
    kept.begin()
    kept.save("backlash", "in", {"x": 1.5}, 2.5, [page])
    assert kept.begun(force=False)
    assert kept.load("backlash", "in", Kept) == (Kept(1.5), 2.5)
    assert kept.load("backlash", "other", Kept) is None
    assert kept.load("calibration", "in", Kept) is None
    assert kept.load("backlash", "in", Step) is None
    assert FinishedSteps(tmp_path, "b" * 32).load("backlash", "in", Kept) is None
    with pytest.raises(OutputExistsError, match="other work"):
        FinishedSteps(tmp_path, "b" * 32).begun(force=False)
    assert not FinishedSteps(tmp_path, "b" * 32).begun(force=True)
    page.write_text("edited")
    assert kept.load("backlash", "in", Kept) is None
    page.write_text("page")
    file = tmp_path / "unfinished.log"
    file.write_text(file.read_text()[:-20])
    assert FinishedSteps(tmp_path, "a" * 32).load("backlash", "in", Kept) is None
    kept.clear()
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


class Chain:
    """The demonstration with its costly functions replaced; one of them presses Ctrl-C."""

    def __init__(self, monkeypatch, folder, base):
        self.calls, self.stop, self.base = [], None, base
        path = folder / "p.toml"
        trace = '[[step]]\nkind = "trace"\nname = "{}"\nduration = "1 s"\n'
        names = ("sine", "loaded", "held-out")
        path.write_text('name = "demo"\n' + "".join(trace.format(name) for name in names))
        procedure = load_procedure(path)
        self.logs = [f"{name}.csv" for name in names]
        from elevon.simulate import simulate

        def counted(actuator, scenario, **options):
            # The second log is the one that is cut.
            if self.stop == "bench" and "bench" in self.calls:
                raise KeyboardInterrupt
            self.calls.append("bench")
            return simulate(actuator, scenario, **options)

        truth = dict.fromkeys([item.path for item in found(base).estimates], 0.15)
        monkeypatch.setattr("elevon.demo.run._truth", lambda _demo: truth)
        monkeypatch.setattr("elevon.demo.run.demo_procedure", lambda: procedure)
        monkeypatch.setattr("elevon.demo.procedure.demo_procedure", lambda: procedure)
        monkeypatch.setattr(sys.modules["elevon.simulate"], "simulate", counted)
        replaced = {
            "elevon.reproduce.backlash.campaign.reproduce_backlash": self.backlash,
            "elevon.reproduce.case_page.case_page": lambda _name, _result: Report("backlashes"),
            "elevon.logs.read.log_of": lambda path: path,
            "elevon.demo.run.import_log": lambda path, **_options: path,
            "elevon.demo.run.same_rate": lambda _logs: None,
            "elevon.logs.drive.drive_log": lambda path: SimpleNamespace(name=path.name),
            "elevon.demo.run.calibrate": self.calibrate,
            "elevon.calibrate.write.write_calibration": self.write,
            "elevon.demo.run.validate": self.validate,
            "elevon.demo.page.demo_report": self.report,
        }
        for name, function in replaced.items():
            put(monkeypatch, name, function)

    def step(self, name):
        self.calls.append(name)
        if self.stop == name:
            raise KeyboardInterrupt

    def backlash(self, **_options):
        self.step("backlash")
        return backlashes()

    def calibrate(self, logs, _actuator, **_options):
        assert [log.name for log in logs] == self.logs[:-1]
        self.step("calibration")
        return found(self.base)

    def write(self, path, _result, *, force):
        assert force
        path.write_text("set")

    def validate(self, logs, actuator, **_options):
        name = "before" if actuator.hash == self.base.hash else "after"
        self.step(name)
        return validation(name, [log.name for log in logs], 1.0 if name == "before" else 0.5)

    def report(self, demo):
        self.step("report")
        return Report(json.dumps([step.name for step in demo.steps]))

    def run(self, out, *arguments, stop=None):
        """Give the command; return its exit code and what was computed."""
        self.stop, self.calls = stop, []
        return main(
            ["demo", "--part", "bench", "--out", str(out), "--json", *arguments]
        ), self.calls


@pytest.fixture
def chain(monkeypatch, tmp_path, base):
    return Chain(monkeypatch, tmp_path, base)


def test_every_interruption_keeps_what_is_finished(chain, tmp_path, capsys):
    out = tmp_path / "demo"
    done = {
        "backlash": (["backlash"], "no step is finished"),
        "bench": (["backlash", "bench"], "the backlash table, 1 of 3 logs"),
        "calibration": (["bench", "bench", "calibration"], "the backlash table, 3 of 3 logs"),
        "before": (["calibration", "before"], "the backlash table, the calibration, 3 of 3"),
        "after": (["before", "after"], "the validation of the published values"),
        "report": (["after", "report"], "the validation of the calibrated values"),
    }
    for place in PLACES:
        calls, text = done[place]
        assert chain.run(out, stop=place) == (130, calls)
        captured = capsys.readouterr()
        assert captured.out == ""
        last = captured.err.splitlines()[-1]
        assert last.startswith("elevon: interrupted; ")
        assert text in last
        assert last.endswith(("to go on", "to start over"))
        assert not (out / "report.html").exists()
    code, calls = chain.run(out)
    resumed = json.loads(capsys.readouterr().out)
    assert calls == ["report"]
    assert [step["resumed"] for step in resumed["steps"]] == [True, True, False, True, True, True]
    assert resumed["steps"][1]["kept"] == "3 of 3 logs kept from the interrupted run"
    assert not (out / "unfinished.log").exists()
    assert chain.run(tmp_path / "once")[0] == code
    once = json.loads(capsys.readouterr().out)
    assert not any(step["resumed"] for step in once["steps"])
    for key in ("status", "checks", "rows", "seed"):
        assert json.dumps(resumed[key]) == json.dumps(once[key])


def test_only_exactly_the_same_work_goes_on(chain, tmp_path, capsys, monkeypatch):
    out = tmp_path / "demo"
    assert chain.run(out, stop="before")[0] == 130
    code, calls = chain.run(out, "--seed", "1")
    captured = capsys.readouterr()
    assert (code, calls, captured.out) == (2, [], "")
    assert "other work" in captured.err
    with monkeypatch.context() as other:
        other.setattr(elevon, "__version__", "0.0.1", raising=False)
        _, calls = chain.run(out, "--force", stop="bench")
        assert calls == ["backlash", "bench"]
    _, calls = chain.run(out, "--force", stop="after")
    assert calls == ["backlash", "bench", "bench", "bench", "calibration", "before", "after"]
    text = (out / "logs" / "sine.csv").read_text()
    (out / "logs" / "sine.csv").write_text(text[:-40])
    (out / "backlash.html").unlink()
    _, calls = chain.run(out, stop="after")
    assert calls == ["backlash", "bench", "after"]
    assert (out / "logs" / "sine.csv").read_text() == text


def test_a_complete_page_is_refused_without_force_and_made_anew_with_it(chain, tmp_path, capsys):
    out = tmp_path / "demo"
    chain.run(out)
    page = (out / "report.html").read_bytes()
    capsys.readouterr()
    code, calls = chain.run(out)
    assert (code, calls) == (2, [])
    assert "--force" in capsys.readouterr().err
    code, calls = chain.run(out, "--force", stop="calibration")
    assert calls == ["backlash", "bench", "bench", "bench", "calibration"]
    assert (out / "report.html").read_bytes() == page
    capsys.readouterr()
    code, calls = chain.run(out)
    assert (code, calls) == (2, [])
    assert "report.html" in capsys.readouterr().err
    _, calls = chain.run(out, "--force")
    assert calls == ["calibration", "before", "after", "report"]


def test_files_of_someone_else_are_refused_before_any_work(chain, tmp_path, capsys):
    out = tmp_path / "demo"
    for name in ("logs/sine.csv", "truth.json"):
        path = out / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("mine")
        assert chain.run(out) == (2, [])
        assert path.name in capsys.readouterr().err
        assert path.read_text() == "mine"
        path.unlink()
    assert not (out / "unfinished.log").exists()


def test_the_library_raises_what_stopped_it(chain, tmp_path):
    chain.stop = "after"
    with pytest.raises(KeyboardInterrupt):
        run_demo(tmp_path / "demo")
    chain.stop, chain.calls = None, []
    run_demo(tmp_path / "demo")
    assert chain.calls == ["after", "report"]


@pytest.mark.long
def test_the_whole_chain_interrupted_by_signals(tmp_path):
    """SIGINT to the group: while a log is made, within the calibration, while the page is drawn.

    Work is known by the package's files, so the package is a copy that nobody edits meanwhile.
    """
    copy = tmp_path / "package"
    shutil.copytree(Path(elevon.__file__).parent, copy / "elevon")
    out = tmp_path / "demo"
    state, unfinished = out / "logs" / "bench-demo.log", out / "unfinished.log"

    def has(name):
        return lambda: unfinished.is_file() and f'"item":"{name}"' in unfinished.read_text()

    moments = [
        (lambda: state.is_file() and '"sine"' in state.read_text(), 0.3, "of 4 logs"),
        (has("before"), 0.3, "the calibration"),
        (has("after"), 0.5, "of the calibrated values"),
    ]
    command = [
        sys.executable,
        "-m",
        "elevon.cli",
        "demo",
        "--part",
        "bench",
        "--out",
        str(out),
        "--json",
    ]
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
    assert [step["resumed"] for step in result["steps"]] == [True, True, False, True, True, True]
    assert "kept from the interrupted run" in (out / "report.html").read_text("utf-8")
