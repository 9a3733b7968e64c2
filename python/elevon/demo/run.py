"""The demonstration: a unit lives, is inspected and diagnosed, and its end is predicted.

The unit that nobody knows has values of its own, grows worse by laws that the prediction has not,
and shows nothing but the logs of its drive.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np

import elevon
from elevon.actuator import Actuator
from elevon.calibrate.outcome import Calibration
from elevon.demo.story import Story
from elevon.demo.unit import (
    INSPECTED,
    demo_file,
    demo_mission,
    faults_at,
    hidden_unit,
    live,
    of_day,
)
from elevon.diagnose.engine.answer import Diagnosis
from elevon.errors import Interrupted, OutputExistsError
from elevon.files import check_output, write_text
from elevon.plain import WORKING, Plain
from elevon.prognose import (
    Inspection,
    Prognosis,
    ResponseTables,
    inspection,
    respond,
)  # fmt: skip
from elevon.prognose.future import Life
from elevon.prognose.history import write_stamp
from elevon.prognose.metrics import Track, cumulative_relative_accuracy
from elevon.prognose.predict import predict_by_tables
from elevon.progress import Progress, part
from elevon.report.checks import Check, verdict

_FILES = (
    "report.html", "prognosis.html", "diagnosis.html", "calibrated.toml", "mission.toml",
    "truth.json", "cone.svg", "mechanism.svg",
)  # fmt: skip
_UNIT = "SN 0042"
_TEST = "backlash"
_TRACES = ("sine", "chirp", "loaded")


@dataclass(frozen=True)
class InspectionVisit(Plain):
    """One inspection.

    Attributes
    ----------
    usage : float
        Flights until then.
    status : str
        Of the diagnosis.
    faults : tuple of str
        ``KIND@PLACE`` of its best explanation.
    rul, low, high : float
        Remaining flights by all inspections so far: median and 90 % interval.
    truth : float
        Remaining flights as they came.
    diagnosis, inspection, prognosis
        The answers themselves.
    """

    usage: float
    status: str
    faults: tuple[str, ...]
    rul: float
    low: float
    high: float
    truth: float
    diagnosis: Annotated[Diagnosis, WORKING]
    inspection: Annotated[Inspection, WORKING]
    prognosis: Annotated[Prognosis, WORKING]


@dataclass
class LifeDemo:
    """Everything the page shows.

    Attributes
    ----------
    seed : int
        Of the hidden values and of chance.
    base, hidden : Actuator
        The published set, and the unit on the bench.
    folder : Path
        Of the outputs.
    story : Story
        The steps, with their times.
    life : Life
        The true course.
    calibration : Calibration
        The healthy unit as its logs show it.
    response : ResponseTables
        What severities do to the calibrated unit.
    healthy : list of Path
        Logs of the new unit by the test of the inspections.
    visits : list of InspectionVisit
        In the order of flights.
    """

    seed: int
    base: Actuator
    hidden: Actuator
    folder: Path
    story: Story
    life: Life = field(init=False)
    calibration: Calibration = field(init=False)
    response: ResponseTables = field(init=False)
    healthy: list[Path] = field(default_factory=list)
    visits: list[InspectionVisit] = field(default_factory=list)

    @property
    def track(self) -> Track:
        """The predictions against the end that came."""
        rows = [(v.usage, v.rul, v.low, v.high) for v in self.visits]
        usage, median, low, high = np.array(rows).T
        return Track(usage, median, low, high, self.life.end)

    @property
    def checks(self) -> list[Check]:
        """What must hold of any one life; how well it was predicted is shown, and judged by many.

        `python -m studies prognosis` requests accuracy and coverage, of sixty lives.
        """
        track = self.track
        named = np.mean([v.status == "faulty" for v in self.visits[1:]])
        width = (track.high - track.low)[[len(track.usage) // 3, -1]]
        return [
            Check("last interval's width over that at a third of the inspections",
                  float(width[1] / width[0]), 1.0),
            Check("inspections after the first that name a fault", float(named), 0.8,
                  at_least=True),
        ]  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        track = self.track
        return {
            **verdict(self.checks),
            "seed": self.seed,
            "steps": [step.to_dict() for step in self.story.steps],
            "wall_s": self.story.seconds,
            "report": str(self.folder / "report.html"),
            "end": self.life.end,
            "cumulative_relative_accuracy": cumulative_relative_accuracy(
                track, (0.5, 0.6, 0.7, 0.8, 0.9)
            ),
            "inside": float(np.mean((track.low <= track.true) & (track.true <= track.high))),
            "rows": [visit.to_dict() for visit in self.visits],
        }


def run_life(
    out: str | Path = "out/demo",
    *,
    seed: int = 0,
    force: bool = False,
    progress: Progress | None = None,
) -> LifeDemo:
    """Run the demonstration and write its page.

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
    base = Actuator.load("torino-rotary")
    hidden, folder = hidden_unit(base, seed), Path(out).expanduser()
    story = Story(folder, f"{elevon.__version__} {seed} {base.hash} {hidden.hash}")
    demo = LifeDemo(seed, base, hidden, folder, story)
    _claim(demo, force=force)
    demo.life = story.resumable(
        "the unit flies until it fails (high-fidelity snapshots)", "life", Life,
        lambda: live(hidden, seed, part(progress, 0.0, 0.15)),
    )  # fmt: skip
    _calibrate(demo, part(progress, 0.15, 0.4))
    tables = part(progress, 0.4, 0.5)
    demo.response = story.timed(
        "model runs: what severities do to the mission and its requirements",
        lambda: respond(demo.calibration.actuator, demo_mission(), snapshots=True, progress=tables),
    )
    _inspect(demo, part(progress, 0.5, 0.97))
    _finish(demo, force=force)
    story.clear()
    if progress is not None:
        progress(1.0)
    return demo


def _claim(demo: LifeDemo, *, force: bool) -> None:
    """Go on with this very work, or refuse what may not be replaced and clear the rest."""
    for name in _FILES[:1] if demo.story.resumes else _FILES:
        check_output(demo.folder / name, force=force)
    if demo.story.resumes:
        return
    for place in (demo.folder / "logs", demo.folder / "history"):
        if place.exists() and any(place.iterdir()):
            if not force:
                raise OutputExistsError(f"{place}: is there, of other work")
            shutil.rmtree(place)
    demo.story.begin()


def _log(demo: LifeDemo, name: str, usage: float, number: int) -> Path:
    """Put the unit on the bench as it is at a use; return the log."""
    unit = of_day(demo.hidden, np.random.default_rng([demo.seed, 10, number]))
    faults, seed = faults_at(demo.life, usage), 1000 * demo.seed + number
    result = elevon.bench(_TEST, unit, demo.folder / "logs" / name, faults=faults, seed=seed)
    return result.paths[0]


def _calibrate(demo: LifeDemo, progress: Progress | None) -> None:
    """Put the new unit on the bench and calibrate on its logs."""
    logs, target = demo.folder / "logs" / "healthy", demo.folder / "calibrated.toml"
    files = [logs / f"{name}.csv" for name in _TRACES]

    def bench() -> list[Path]:
        elevon.bench(demo_file("bench.toml"), demo.hidden, logs, seed=demo.seed,
                     progress=part(progress, 0.0, 0.4))  # fmt: skip
        return [_log(demo, f"healthy-{k}", 0.0, 900 + k) for k in (1, 2)]

    def work() -> Calibration:
        result = elevon.calibrate(files, demo.base, progress=part(progress, 0.4, 1.0))
        result.write_actuator(target, force=True)
        return result

    demo.healthy = demo.story.timed("virtual bench: logs of the new unit", bench)
    name = "calibration on the first healthy logs"
    demo.calibration = demo.story.resumable(
        name, "calibration", Calibration, work, [*files, target]
    )


def _inspect(demo: LifeDemo, progress: Progress | None) -> None:
    """Inspect, diagnose and predict, at irregular uses, until the unit has failed."""
    rng = np.random.default_rng([demo.seed, 11])
    usage = 0.0
    while True:
        usage += round(INSPECTED * rng.uniform(0.7, 1.3), -1)
        if usage >= demo.life.end:
            return
        demo.visits.append(_visit(demo, usage))
        if progress is not None and progress(usage / demo.life.end) is False:
            raise Interrupted("interrupted between two inspections")


def _visit(demo: LifeDemo, usage: float) -> InspectionVisit:
    """Inspect the unit once."""
    number, name = len(demo.visits) + 1, f"flight-{usage:05.0f}"
    actuator = demo.calibration.actuator
    log = demo.story.timed(
        "virtual bench: a log at each inspection", lambda: _log(demo, name, usage, number)
    )
    diagnosis = demo.story.resumable(
        "diagnosis of each log", f"inspection-{number}", Diagnosis,
        lambda: elevon.diagnose(log, actuator, baselines=demo.healthy),
        [log, *demo.healthy, demo.folder / "calibrated.toml"],
    )  # fmt: skip
    data = diagnosis.to_dict(stored=False)
    seen = inspection(data, demo.response.laws, usage=usage, name=name)
    every = [*(visit.inspection for visit in demo.visits), seen]
    result = demo.story.timed(
        "prediction at each inspection",
        lambda: predict_by_tables(
            every, demo_mission(), demo.response, seed=demo.seed, serial=_UNIT
        ),
    )
    stamp = demo.folder / "history" / f"{name}.json"
    write_stamp(stamp, data, usage=usage, unit="flights", serial=_UNIT, force=True)
    return InspectionVisit(
        usage, diagnosis.status, diagnosis.best, result.median, *result.interval,
        demo.life.end - usage, diagnosis, seen, result,
    )  # fmt: skip


def _finish(demo: LifeDemo, *, force: bool) -> None:
    """Write what a user goes on with, the truth, and the page; `_claim` has checked first."""
    from elevon.demo.page import cone_figure, moving_picture, save_pages
    from elevon.report.figures import save_figure

    mission = demo_file("mission.toml").read_text("utf-8")
    write_text(demo.folder / "mission.toml", mission, force=True)
    truth = {
        "end": demo.life.end,
        "usage": demo.life.usage.tolist(),
        "severity": demo.life.severity.tolist(),
        "faults": [law.key for law in demo.response.laws],
    }
    write_text(demo.folder / "truth.json", json.dumps(truth) + "\n", force=True)
    save_figure(cone_figure(demo), demo.folder / "cone.svg", force=True)
    write_text(demo.folder / "mechanism.svg", moving_picture(demo), force=True)
    # Last: where it stands, the demonstration is complete.
    demo.story.timed("drawing the pages", lambda: save_pages(demo, force=force))
