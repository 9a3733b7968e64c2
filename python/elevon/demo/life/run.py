"""The demonstration's steps: a life, its inspections, and the end as it was foreseen."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.demo.finished import FinishedSteps, inputs_of, work_key
from elevon.demo.life.unit import (
    INSPECTED,
    demo_mission,
    faults_at,
    hidden_unit,
    live,
    mission_file,
    of_day,
)
from elevon.demo.results import Recovered
from elevon.demo.steps import Story, Work
from elevon.errors import Interrupted
from elevon.prognose.metrics import Track, cumulative_relative_accuracy
from elevon.progress import Progress, part
from elevon.report.checks import Check, all_passed

if TYPE_CHECKING:
    from elevon.diagnose.bymodel import Diagnosis, TestLog
    from elevon.prognose import Inspection, Prognosis, Response
    from elevon.prognose.life import Life

__all__ = ["LifeDemo", "Visit", "life_files", "run_life"]

_PAGES = (
    "report.html",
    "calibrated.toml",
    "mission.toml",
    "truth.json",
    "cone.svg",
    "mechanism.svg",
)
_UNIT = "torino-rotary SN 0042"
_TEST = "backlash"


@dataclass(frozen=True)
class Said:
    """What a diagnosis says, as it is kept.

    Attributes
    ----------
    data : dict
        Its JSON form.
    text : str
        In words.
    """

    data: dict[str, Any]
    text: str

    @classmethod
    def of(cls, answer: Diagnosis) -> Said:
        """Take it from the whole answer."""
        from elevon.diagnose.bymodel.words import sentence

        return cls(answer.to_dict(), sentence(answer))

    @classmethod
    def from_json(cls, data: Any) -> Said:
        """Return it again."""
        return cls(dict(data["data"]), str(data["text"]))

    @property
    def status(self) -> str:
        """``healthy`` or ``faulty``."""
        return str(self.data["status"])

    @property
    def best(self) -> list[str]:
        """Faults of the best explanation, ``KIND@PLACE``."""
        return list(self.data["best"]["faults"])


@dataclass(frozen=True)
class Visit:
    """One inspection.

    Attributes
    ----------
    usage : float
        Flights.
    log : Path
        What the bench wrote.
    diagnosis : Said
        Of it.
    inspection : Inspection
        As the filter takes it.
    prognosis : Prognosis
        From all inspections up to this one.
    """

    usage: float
    log: Path
    diagnosis: Said
    inspection: Inspection
    prognosis: Prognosis


@dataclass
class LifeDemo(Story):
    """Everything the report shows.

    Attributes
    ----------
    life : Life
        The true course.
    calibration : Recovered
        The healthy unit as its logs show it.
    response : Response
        The calibrated unit's tables.
    visits : list of Visit
        In the order of flights.
    """

    life: Life = field(init=False)
    calibration: Recovered = field(init=False)
    response: Response = field(init=False)
    healthy: list[Path] = field(default_factory=list)
    visits: list[Visit] = field(default_factory=list)

    @property
    def track(self) -> Track:
        """The predictions against the end that came."""
        rows = [(v.usage, v.prognosis.median, *v.prognosis.interval) for v in self.visits]
        usage, median, low, high = np.array(rows).T
        return Track(usage, median, low, high, self.life.end)

    @property
    def accuracy(self) -> float:
        """Mean relative accuracy over 50 to 90 % of life."""
        return cumulative_relative_accuracy(self.track, (0.5, 0.6, 0.7, 0.8, 0.9))

    @property
    def inside(self) -> float:
        """Share of the predictions whose 90 % interval holds the true end of life."""
        track = self.track
        return float(np.mean((track.low <= track.true) & (track.true <= track.high)))

    @property
    def checks(self) -> list[Check]:
        """What must hold of any one life; how well it was predicted is shown, and judged by many.

        `elevon reproduce prognosis` asks for accuracy and coverage, of sixty lives.
        """
        track = self.track
        named = np.mean([v.diagnosis.status == "faulty" for v in self.visits[1:]])
        width = (track.high - track.low)[[len(track.usage) // 3, -1]]
        return [
            Check("last interval's width over that at a third of the inspections",
                  float(width[1] / width[0]), 1.0),
            Check("inspections after the first that name a fault", float(named), 0.8,
                  at_least=True),
        ]  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "status": "pass" if all_passed(self.checks) else "fail",
            "checks": [check.to_dict() for check in self.checks],
            "seed": self.seed,
            "end": self.life.end,
            "cumulative_relative_accuracy": self.accuracy,
            "inside": self.inside,
            "rows": [
                {
                    "usage": v.usage,
                    "status": v.diagnosis.status,
                    "faults": v.diagnosis.best,
                    "rul": v.prognosis.median,
                    "low": v.prognosis.interval[0],
                    "high": v.prognosis.interval[1],
                    "truth": self.life.end - v.usage,
                }
                for v in self.visits
            ],
            "steps": [step.to_dict() for step in self.steps],
            "wall_s": self.seconds,
            "report": str(self.folder / "report.html"),
        }


def life_files(out: str | Path) -> list[Path]:
    """Return the files the demonstration writes beside its logs and its history."""
    return [Path(out).expanduser() / name for name in _PAGES]


def run_life(
    out: str | Path = "out/demo",
    *,
    seed: int = 0,
    force: bool = False,
    progress: Progress | None = None,
) -> LifeDemo:
    """Run the demonstration and write its report.

    A run that was interrupted goes on where it stopped when it is started again with the same
    arguments, as `elevon.demo.run.run_demo` does.

    Parameters
    ----------
    out : path
        Folder.
    seed : int
        Of the unit, its life and its bench.
    force : bool
        Whether what an earlier, complete run or other work left may be replaced.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    OutputExistsError
        Something is there and `force` is false.
    Interrupted
        `progress` returned False.
    """
    from elevon.actuator import Actuator

    base = Actuator.load("torino-rotary")
    folder = Path(out).expanduser()
    hidden = hidden_unit(base, seed)
    demo = LifeDemo(seed, base, hidden, folder, FinishedSteps(folder, work_key(seed, base, hidden)))
    _claim(demo, force=force)
    demo.life = demo.resumed(
        "the unit flies until it fails (high-fidelity snapshots)",
        Work(
            "life",
            lambda: live(hidden, seed, part(progress, 0.0, 0.15)),
            _life_to_json,
            _life_from_json,
        ),
    )
    _calibrate(demo, part(progress, 0.15, 0.4))
    _tables(demo, part(progress, 0.4, 0.5))
    _inspect(demo, part(progress, 0.5, 0.97))
    _finish(demo, force=force)
    demo.finished.clear()
    if progress is not None:
        progress(1.0)
    return demo


def _life_to_json(life: Life) -> dict[str, Any]:
    data = asdict(life)
    return {**data, "usage": life.usage.tolist(), "severity": life.severity.tolist()}


def _life_from_json(data: Any) -> Life:
    from elevon.prognose.life import Life

    usage, severity = np.array(data["usage"]), np.array(data["severity"])
    return Life(usage, severity, float(data["end"]), int(data["first"]))


def _claim(demo: LifeDemo, *, force: bool) -> None:
    """Refuse what may not be replaced; clear what earlier work left; or go on with this work."""
    from elevon.errors import OutputExistsError
    from elevon.files import check_output

    if demo.finished.begun(force=force):
        check_output(demo.folder / "report.html", force=force)
        return
    for path in life_files(demo.folder):
        check_output(path, force=force)
    for name in ("logs", "history"):
        place = demo.folder / name
        if place.exists() and any(place.iterdir()):
            if not force:
                raise OutputExistsError(f"{place}: is there; use force (--force) to replace it")
            shutil.rmtree(place)
    demo.finished.begin()


def _log(demo: LifeDemo, name: str, usage: float, number: int) -> Path:
    """Put the unit on the bench as it is at a use; return the log."""
    from elevon.bench.procedure import load_procedure
    from elevon.bench.run import run_procedure

    rng = np.random.default_rng([demo.seed, 10, number])
    result = run_procedure(
        load_procedure(_TEST),
        of_day(demo.hidden, rng),
        demo.folder / "logs" / name,
        faults=faults_at(demo.life, usage),
        seed=1000 * demo.seed + number,
    )
    return next(path for path in result.logs[0].files if path.suffix == ".csv")


def _calibrate(demo: LifeDemo, progress: Progress | None) -> None:
    """Take the healthy logs and calibrate on three of them."""
    from elevon.bench.run import run_procedure
    from elevon.calibrate import calibrate
    from elevon.calibrate.log import bench_log
    from elevon.calibrate.write import write_calibration
    from elevon.demo.procedure import HELD_OUT, demo_procedure
    from elevon.logs.importing import import_log

    logs = demo.folder / "logs" / "healthy"

    def bench() -> None:
        run_procedure(
            demo_procedure(), demo.hidden, logs, seed=demo.seed, progress=part(progress, 0.0, 0.4)
        )
        demo.healthy = [_log(demo, f"healthy-{k}", 0.0, 900 + k) for k in (1, 2)]

    demo.timed("virtual bench: logs of the new unit", bench)

    target = demo.folder / "calibrated.toml"
    names = [trace.name for trace in demo_procedure().traces if trace.name != HELD_OUT]
    files = [logs / f"{name}.csv" for name in names]

    def work() -> Recovered:
        used = [bench_log(import_log(path)) for path in files]
        result = calibrate(used, demo.base, progress=part(progress, 0.4, 1.0))
        write_calibration(target, result, force=True)
        return Recovered.of(result)

    demo.calibration = demo.resumed(
        "calibration on the first healthy logs",
        Work(
            "calibration",
            work,
            lambda calibration: calibration.to_json(demo.base),
            lambda data: Recovered.from_json(data, demo.base),
            inputs_of(files),
            [target],
        ),
    )


def _tables(demo: LifeDemo, progress: Progress | None) -> None:
    from elevon.prognose import respond

    demo.response = demo.timed(
        "model runs: what severities do to the mission and its requirements",
        lambda: respond(
            demo.calibration.actuator, demo_mission(), snapshots=True, progress=progress
        ),
    )


def _inspect(demo: LifeDemo, progress: Progress | None) -> None:
    """Inspect, diagnose and predict, at irregular uses, until the unit has failed."""
    from elevon.diagnose.bymodel import read_test_logs
    from elevon.prognose import ParticleFilter, Process

    rng = np.random.default_rng([demo.seed, 11])
    baselines = read_test_logs(demo.healthy)
    flt = ParticleFilter(Process(demo.response), seed=demo.seed)
    usage, number = 0.0, 0
    while True:
        number += 1
        usage += round(INSPECTED * rng.uniform(0.7, 1.3), -1)
        if usage >= demo.life.end:
            return
        _visit(demo, baselines, flt, usage, number)
        if progress is not None and progress(min(usage / demo.life.end, 1.0)) is False:
            raise Interrupted("interrupted between two inspections")


def _visit(demo: LifeDemo, baselines: list[TestLog], flt: Any, usage: float, number: int) -> None:
    from elevon.diagnose.bymodel import diagnose, read_test_logs
    from elevon.prognose.history import write_stamp
    from elevon.prognose.observation import inspection
    from elevon.prognose.predict import prognosis

    log = demo.timed(
        "virtual bench: a log at each inspection",
        lambda: _log(demo, f"flight-{usage:05.0f}", usage, number),
    )
    actuator = demo.calibration.actuator
    said = demo.resumed(
        "diagnosis of each log",
        Work(
            f"inspection-{number}",
            lambda: Said.of(diagnose(read_test_logs([log]), actuator, baselines=baselines)),
            asdict,
            Said.from_json,
            inputs_of([log, *demo.healthy], actuator.hash),
        ),
    )
    seen = inspection(said.data, demo.response.laws, usage=usage, name=log.parent.name)

    def look() -> Prognosis:
        flt.update(seen)
        past = [visit.inspection for visit in demo.visits]
        return prognosis(flt, demo_mission(), [*past, seen], seed=demo.seed, serial=_UNIT)

    result = demo.timed("prediction at each inspection", look)
    demo.visits.append(Visit(usage, log, said, seen, result))
    stamp = demo.folder / "history" / f"flight-{usage:05.0f}.json"
    write_stamp(stamp, said.data, usage=usage, unit="flights", serial=_UNIT, force=True)


def _finish(demo: LifeDemo, *, force: bool) -> None:
    """Write what a user goes on with, the truth, and the page; `_claim` has asked for leave."""
    from elevon.demo.life.figures import cone_figure
    from elevon.demo.life.page import life_report, moving_picture
    from elevon.files import write_text
    from elevon.report.figures import save_figure

    write_text(demo.folder / "mission.toml", mission_file().read_text("utf-8"), force=True)
    truth = {
        "end": demo.life.end,
        "usage": demo.life.usage.tolist(),
        "severity": demo.life.severity.tolist(),
        "faults": [law.key for law in demo.response.laws],
    }
    write_text(demo.folder / "truth.json", json.dumps(truth) + "\n", force=True)
    report = demo.timed("drawing the page", lambda: life_report(demo))
    save_figure(cone_figure(demo), demo.folder / "cone.svg", force=True)
    write_text(demo.folder / "mechanism.svg", str(moving_picture(demo)), force=True)
    # Last: where it stands, the demonstration is complete.
    report.save(demo.folder / "report.html", force=force)
