"""An interrupted life goes on with what is finished, and ends as if it had not been interrupted."""

import json
from functools import partial

import numpy as np
import pytest

import elevon
from elevon import Actuator
from elevon.calibrate.outcome import Calibration
from elevon.cli import main
from elevon.demo import run as life_run
from elevon.demo.unit import demo_mission
from elevon.diagnose.engine.answer import Cause, Diagnosis
from elevon.plain import plain, read_plain
from elevon.prognose import ResponseTables
from elevon.prognose.future import Life
from elevon.prognose.predict import prognosis
from elevon.prognose.requirement import Requirement
from elevon.prognose.response import Grid
from elevon.report import Report
from tests.patches import put

KEY = "backlash@transmission"


def tables():
    laws = demo_mission().laws()
    grid = Grid(tuple(np.array([0.0, law.highest]) for law in laws))
    names = dict.fromkeys(name for law in laws for name in law.drivers)
    drivers = {name: np.full(4, 30000.0 if name == "friction_work" else 300.0) for name in names}
    requirements = (Requirement(name="backlash", measure="severity", fault=KEY, limit=0.015),)
    return ResponseTables(
        laws, requirements, (0.015,), ("rad",), grid, drivers, np.zeros((4, 1)), 4, "low"
    )


def answer(severity):
    """Return a diagnosis of a backlash."""
    spread = (0.9 * severity, 1.1 * severity)
    cause = Cause("backlash", "transmission", "rad", 0.9, severity, spread)
    return Diagnosis(
        logs=("log",), status="faulty", p_fault=0.9, false_alarm=0.05, chance=0.01,
        faults=(cause,), best=(KEY,), p_best=0.9, unobservable=(), detectable={}, features=(),
        findings=(), seconds=0.1,
    )  # fmt: skip


class Story:
    """The demonstration with its costly functions replaced; one of them presses Ctrl-C."""

    def __init__(self, monkeypatch):
        self.calls, self.stop = [], None
        usage = np.array([0.0, 750.0, 1500.0])
        severity = np.column_stack((1e-5 * usage, 1e-4 * usage))
        replaced = {
            "elevon.demo.run.live": self.step("life", Life(usage, severity, 1500.0, 0)),
            "elevon.demo.run._log": self.log,
            "elevon.bench": self.bench,
            "elevon.calibrate": self.calibrate,
            "elevon.demo.run.respond": self.step("tables", tables()),
            "elevon.diagnose": self.diagnose,
            "elevon.demo.page.life_report": self.step("report", Report("life")),
            "elevon.demo.page.prognosis_page": lambda *_args, **_options: Report("prognosis"),
            "elevon.demo.page.moving_picture": lambda _demo: "<svg/>",
            "elevon.demo.page.cone_figure": lambda _demo: None,
            "elevon.report.figures.save_figure": lambda *_args, **_options: None,
            "elevon.prognose.predict.prognosis": partial(prognosis, particles=50),
        }
        for name, function in replaced.items():
            put(monkeypatch, name, function)

    def step(self, name, result=None):
        def work(*_args, **_options):
            self.calls.append(name)
            if self.stop == name:
                raise KeyboardInterrupt
            return result

        return work

    def bench(self, _procedure, _actuator, out, **_options):
        out.mkdir(parents=True, exist_ok=True)
        for name in ("sine", "chirp", "loaded"):
            (out / f"{name}.csv").write_text(name)

    def log(self, demo, name, usage, _number):
        path = demo.folder / "logs" / name / "log.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{usage}")
        return path

    def calibrate(self, _logs, base, **_options):
        self.step("calibration")()
        fitted = base.with_values({"backlash.total": 0.001}, source="calibration")
        return Calibration(actuator=fitted, before=base, logs=(), parameters={})

    def diagnose(self, log, _actuator, *, baselines):
        assert len(baselines) == 2
        usage = float(log.read_text())
        number = 1 + sum(call.startswith("diagnosis") for call in self.all)
        self.step(f"diagnosis {number}")()
        self.all.append(f"diagnosis {number}")
        return answer(1e-5 * usage)

    def run(self, out, *options, stop=None, fresh=False):
        if fresh:
            self.all = []
        self.stop, self.calls = stop, []
        return main(["demo", "--out", str(out), *options, "--json"]), self.calls


@pytest.fixture
def story(monkeypatch):
    return Story(monkeypatch)


def test_every_interruption_keeps_what_is_finished(story, tmp_path, capsys):
    out = tmp_path / "demo"
    tail = [f"diagnosis {n}" for n in (1, 2, 3, 4)]
    done = [
        ("life", ["life"], "no step is finished"),
        ("calibration", ["life", "calibration"], "the unit's life"),
        (
            "diagnosis 3",
            ["calibration", "tables", *tail[:3]],
            "the unit's life, the calibration, 2 diagnoses",
        ),
        (
            "report",
            ["tables", *tail[2:], "report"],
            "the unit's life, the calibration, 4 diagnoses",
        ),
    ]
    for k, (place, calls, text) in enumerate(done):
        assert story.run(out, stop=place, fresh=k == 0) == (130, calls)
        captured = capsys.readouterr()
        assert captured.out == ""
        assert text in captured.err.splitlines()[-1]
        assert not (out / "report.html").exists()
    code, calls = story.run(out)
    resumed = json.loads(capsys.readouterr().out)
    assert calls == ["tables", "report"]
    assert not (out / "unfinished.log").exists()
    assert [s["resumed"] for s in resumed["steps"] if s["name"].startswith("diagnosis")] == [True]
    once_code, calls = story.run(tmp_path / "once", fresh=True)
    once = json.loads(capsys.readouterr().out)
    assert calls == ["life", "calibration", "tables", *tail, "report"]
    assert not any(step["resumed"] for step in once["steps"])
    assert once_code == code
    for key in ("status", "checks", "rows", "end"):
        assert json.dumps(resumed[key]) == json.dumps(once[key])


@pytest.mark.long
def test_an_edited_log_is_diagnosed_anew(story, tmp_path, monkeypatch):
    out = tmp_path / "demo"
    story.run(out, stop="report", fresh=True)
    story.all = []
    monkeypatch.setattr(
        life_run, "_log", lambda *args: (path := story.log(*args), path.write_text("400"))[0]
    )
    _, calls = story.run(out, stop="report")
    assert [call for call in calls if call.startswith("diagnosis")] == [
        f"diagnosis {n}" for n in (1, 2, 3, 4)
    ]


def test_what_a_diagnosis_says_comes_back_from_json():
    statement = answer(0.01)
    again = read_plain(Diagnosis, json.loads(json.dumps(plain(statement))), "diagnosis")
    assert again == statement
    assert (again.status, again.best, again.headline) == ("faulty", (KEY,), statement.headline)


def test_other_work_is_refused(story, tmp_path, capsys):
    out = tmp_path / "demo"
    assert story.run(out, stop="calibration", fresh=True)[0] == 130
    capsys.readouterr()
    story.calls = []
    assert main(["demo", "--out", str(out), "--seed", "1", "--json"]) == 2
    assert story.calls == []
    assert "other work" in capsys.readouterr().err
    assert Actuator.load("torino-rotary").hash


def test_a_complete_page_is_refused_without_force_and_made_anew_with_it(story, tmp_path, capsys):
    out = tmp_path / "demo"
    story.run(out, fresh=True)
    page = (out / "report.html").read_bytes()
    capsys.readouterr()
    assert story.run(out) == (2, [])
    assert "--force" in capsys.readouterr().err
    _, calls = story.run(out, "--force", stop="calibration")
    assert calls == ["life", "calibration"]
    assert (out / "report.html").read_bytes() == page
    capsys.readouterr()
    assert story.run(out) == (2, [])
    assert "report.html" in capsys.readouterr().err
    story.all = []
    _, calls = story.run(out, "--force")
    assert calls[:2] == ["calibration", "tables"]
    assert calls[-1] == "report"


def test_another_version_does_not_go_on(story, tmp_path, monkeypatch):
    out = tmp_path / "demo"
    assert story.run(out, stop="calibration", fresh=True)[0] == 130
    monkeypatch.setattr(elevon, "__version__", "0.0.1", raising=False)
    assert story.run(out) == (2, [])
    assert story.run(out, "--force", stop="calibration")[1] == ["life", "calibration"]


def test_files_of_someone_else_are_refused_before_any_work(story, tmp_path, capsys):
    out = tmp_path / "demo"
    for name in ("logs/sine.csv", "truth.json"):
        path = out / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("mine")
        assert story.run(out) == (2, [])
        assert path.parent.name in capsys.readouterr().err
        assert path.read_text() == "mine"
        path.unlink()
    assert not (out / "unfinished.log").exists()


def test_the_library_raises_what_stopped_it(story, tmp_path):
    story.stop, story.all = "tables", []
    with pytest.raises(KeyboardInterrupt):
        life_run.run_life(tmp_path / "demo")
    story.stop, story.calls = None, []
    life_run.run_life(tmp_path / "demo")
    assert story.calls[0] == "tables"
    assert story.calls[-1] == "report"
