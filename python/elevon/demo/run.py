"""The demonstration: a unit lives, is inspected and diagnosed, and its end is predicted."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from elevon.calibrate.outcome import Calibration
from elevon.demo.story import FinishedSteps, Story, Work, inputs_of, work_key
from elevon.demo.unit import (
    HELD_OUT,
    INSPECTED,
    demo_mission,
    demo_procedure,
    faults_at,
    hidden_unit,
    live,
    mission_file,
    of_day,
)
from elevon.diagnose.engine.answer import Diagnosis
from elevon.errors import Interrupted, OutputExistsError
from elevon.logs.log import Log
from elevon.prognose import (
    GrowthFilter,
    Inspection,
    Process,
    Prognosis,
    ResponseTables,
    respond,
)
from elevon.prognose.future import Life
from elevon.prognose.metrics import Track, cumulative_relative_accuracy
from elevon.progress import Progress, part
from elevon.report.checks import Check

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
class Statement:
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
    def of(cls, answer: Diagnosis) -> Statement:
        """Take it from the whole answer."""
        from elevon.diagnose.engine.page import sentence

        return cls(answer.to_dict(), sentence(answer))

    @property
    def status(self) -> str:
        """``healthy`` or ``faulty``."""
        return str(self.data["status"])

    @property
    def best(self) -> list[str]:
        """Faults of the best explanation, ``KIND@PLACE``."""
        return list(self.data["best"]["faults"])


@dataclass(frozen=True)
class InspectionVisit:
    """One inspection.

    Attributes
    ----------
    usage : float
        Flights.
    log : Path
        What the bench wrote.
    diagnosis : Statement
        Of it.
    inspection : Inspection
        As the filter takes it.
    prognosis : Prognosis
        From all inspections up to this one.
    """

    usage: float
    log: Path
    diagnosis: Statement
    inspection: Inspection
    prognosis: Prognosis


@dataclass
class LifeDemo(Story):
    """Everything the report shows.

    Attributes
    ----------
    life : Life
        The true course.
    calibration : Calibration
        The healthy unit as its logs show it.
    response : ResponseTables
        The calibrated unit's tables.
    visits : list of InspectionVisit
        In the order of flights.
    """

    life: Life = field(init=False)
    calibration: Calibration = field(init=False)
    response: ResponseTables = field(init=False)
    healthy: list[Path] = field(default_factory=list)
    visits: list[InspectionVisit] = field(default_factory=list)

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

        `python -m studies prognosis` requests accuracy and coverage, of sixty lives.
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
            **self.summary(self.checks),
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
    arguments, with what is finished.

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
            Life,
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


def _claim(demo: LifeDemo, *, force: bool) -> None:
    """Refuse what may not be replaced; clear what earlier work left; or go on with this work."""
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
    from elevon.calibrate.write import write_calibration
    from elevon.logs.read import read_drive_logs

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

    def work() -> Calibration:
        used = read_drive_logs(files, one_rate=False)
        result = calibrate(used, demo.base, progress=part(progress, 0.4, 1.0))
        write_calibration(target, result, force=True)
        return result

    demo.calibration = demo.resumed(
        "calibration on the first healthy logs",
        Work("calibration", work, Calibration, inputs_of(files), [target]),
    )


def _tables(demo: LifeDemo, progress: Progress | None) -> None:
    demo.response = demo.timed(
        "model runs: what severities do to the mission and its requirements",
        lambda: respond(
            demo.calibration.actuator, demo_mission(), snapshots=True, progress=progress
        ),
    )


def _inspect(demo: LifeDemo, progress: Progress | None) -> None:
    """Inspect, diagnose and predict, at irregular uses, until the unit has failed."""
    from elevon.logs.read import read_drive_logs

    rng = np.random.default_rng([demo.seed, 11])
    baselines = read_drive_logs(demo.healthy, one_rate=False)
    flt = GrowthFilter(Process(demo.response), seed=demo.seed)
    usage, number = 0.0, 0
    while True:
        number += 1
        usage += round(INSPECTED * rng.uniform(0.7, 1.3), -1)
        if usage >= demo.life.end:
            return
        _visit(demo, baselines, flt, usage, number)
        if progress is not None and progress(min(usage / demo.life.end, 1.0)) is False:
            raise Interrupted("interrupted between two inspections")


def _visit(demo: LifeDemo, baselines: list[Log], flt: Any, usage: float, number: int) -> None:
    from elevon.diagnose.by_model import diagnose
    from elevon.logs.read import read_drive_logs
    from elevon.prognose.history import write_stamp
    from elevon.prognose.observation import inspection
    from elevon.prognose.predict import prognosis

    log = demo.timed(
        "virtual bench: a log at each inspection",
        lambda: _log(demo, f"flight-{usage:05.0f}", usage, number),
    )
    actuator = demo.calibration.actuator
    statement = demo.resumed(
        "diagnosis of each log",
        Work(
            f"inspection-{number}",
            lambda: Statement.of(diagnose(read_drive_logs([log]), actuator, baselines=baselines)),
            Statement,
            inputs_of([log, *demo.healthy], actuator.hash),
        ),
    )
    seen = inspection(statement.data, demo.response.laws, usage=usage, name=log.parent.name)

    def look() -> Prognosis:
        flt.update(seen)
        past = [visit.inspection for visit in demo.visits]
        return prognosis(flt, demo_mission(), [*past, seen], seed=demo.seed, serial=_UNIT)

    result = demo.timed("prediction at each inspection", look)
    demo.visits.append(InspectionVisit(usage, log, statement, seen, result))
    stamp = demo.folder / "history" / f"flight-{usage:05.0f}.json"
    write_stamp(stamp, statement.data, usage=usage, unit="flights", serial=_UNIT, force=True)


def _finish(demo: LifeDemo, *, force: bool) -> None:
    """Write what a user goes on with, the truth, and the page; `_claim` has checked first."""
    from elevon.demo.page import cone_figure, life_report, moving_picture
    from elevon.files import write_text
    from elevon.report.figures import on_white, save_figure

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
    write_text(demo.folder / "mechanism.svg", on_white(moving_picture(demo)), force=True)
    # Last: where it stands, the demonstration is complete.
    report.save(demo.folder / "report.html", force=force)
