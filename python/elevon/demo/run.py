"""The demonstration's steps, each timed."""

from __future__ import annotations

import json
import time as clock
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from elevon.demo.hidden import RECOVERED, hidden_actuator
from elevon.progress import Progress, part
from elevon.report.checks import Check, all_passed

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.bench.logs.importing import ImportedLog
    from elevon.calibrate import BenchLog, Calibration, Validation
    from elevon.reproduce.backlash import BacklashResult

__all__ = ["Demo", "demo_files", "run_demo"]

Result = TypeVar("Result")
HELD_OUT = "held-out"
_PAGES = ("report.html", "backlash.html", "calibrated.toml", "truth.json")


@dataclass
class Demo:
    """Everything the report shows.

    Attributes
    ----------
    seed : int
        Of the hidden values and of chance.
    base, hidden : Actuator
        The published set, and the one on the bench.
    folder : Path
        Of the outputs.
    steps : list of (str, float)
        What was done, and the seconds it took.
    backlash, imported, calibration : BacklashResult, list of ImportedLog, Calibration
        Results.
    before, after : Validation
        Published and calibrated values against all logs, the held-out one among them.
    truth : dict
        True value by estimate.
    """

    seed: int
    base: Actuator
    hidden: Actuator
    folder: Path
    steps: list[tuple[str, float]] = field(default_factory=list)
    backlash: BacklashResult = field(init=False)
    imported: list[ImportedLog] = field(init=False)
    logs: list[BenchLog] = field(init=False)
    calibration: Calibration = field(init=False)
    before: Validation = field(init=False)
    after: Validation = field(init=False)
    truth: dict[str, float] = field(default_factory=dict)
    bench_truth: dict[str, Any] = field(default_factory=dict)

    def timed(self, name: str, work: Callable[[], Result]) -> Result:
        """Do a step and note its time."""
        begin = clock.perf_counter()
        result = work()
        self.steps.append((name, clock.perf_counter() - begin))
        return result

    @property
    def seconds(self) -> float:
        """Time of all steps so far."""
        return sum(seconds for _, seconds in self.steps)

    @property
    def checks(self) -> list[Check]:
        """What must hold: the published table, the hidden values, the held-out log."""
        found = list(self.backlash.checks)
        count = encoder_count(self.base)
        for path, limit in RECOVERED.items():
            true = self.truth[path]
            name = f"{path}: estimate against the hidden truth"
            allowed = limit * abs(true) + (count if path == "play.total" else 0.0)
            error = abs(self.calibration[path].value - true)
            found.append(Check(name, 100.0 * error / abs(true), 100.0 * allowed / abs(true), "%"))
        return [*found, *self._held_out()]

    def _held_out(self) -> list[Check]:
        old = {e.signal: e.rms for e in self.before.errors if e.log == f"{HELD_OUT}.csv"}
        new = {e.signal: e.rms for e in self.after.errors if e.log == f"{HELD_OUT}.csv"}
        return [
            Check(f"held-out log, {signal}: RMS error after over before", rms / old[signal], 1.0)
            for signal, rms in new.items()
        ]

    def rows(self) -> list[dict[str, Any]]:
        """Return estimates beside the truth, those that have one."""
        return [
            {
                "path": item.path,
                "unit": item.unit,
                "before": item.old,
                "truth": self.truth[item.path],
                "value": item.value,
                "low": item.interval[0],
                "high": item.interval[1],
                "inside": item.interval[0] <= self.truth[item.path] <= item.interval[1],
            }
            for item in self.calibration.estimates
            if item.path in self.truth
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        checks = self.checks
        return {
            "status": "pass" if all_passed(checks) else "fail",
            "checks": [check.to_dict() for check in checks],
            "seed": self.seed,
            "rows": self.rows(),
            "steps": [{"name": name, "seconds": seconds} for name, seconds in self.steps],
            "wall_s": self.seconds,
            "report": str(self.folder / "report.html"),
        }


def encoder_count(actuator: Actuator) -> float:
    """Angle of one encoder edge at the user [rad]."""
    from elevon.calibrate.positions import encoder_count as count

    return count(actuator)


def demo_files(out: str | Path) -> list[Path]:
    """Return the files the demonstration writes beside its logs."""
    return [Path(out).expanduser() / name for name in _PAGES]


def run_demo(
    out: str | Path = "out/demo",
    *,
    seed: int = 0,
    force: bool = False,
    progress: Progress | None = None,
) -> Demo:
    """Run the demonstration and write its report.

    Parameters
    ----------
    out : path
        Folder.
    seed : int
        Of the hidden values.
    force : bool
        Whether what is there may be replaced.
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
    from elevon.files import check_output

    for path in demo_files(out):
        check_output(path, force=force)
    base = Actuator.load("torino-rotary")
    demo = Demo(seed, base, hidden_actuator(base, seed), Path(out).expanduser())
    _backlash(demo, part(progress, 0.0, 0.25), force=force)
    _bench(demo, part(progress, 0.25, 0.5), force=force)
    _read(demo)
    _calibrate(demo, part(progress, 0.5, 0.85), force=force)
    _validate(demo, part(progress, 0.85, 0.97))
    _report(demo, force=force)
    if progress is not None:
        progress(1.0)
    return demo


def _backlash(demo: Demo, progress: Progress | None, *, force: bool) -> None:
    from elevon.reproduce.backlash import reproduce_backlash
    from elevon.reproduce.backlash.page import backlash_report

    def work() -> BacklashResult:
        result = reproduce_backlash(progress=progress)
        backlash_report(result).save(demo.folder / "backlash.html", force=force)
        return result

    demo.backlash = demo.timed("published backlash table, fifteen plays", work)


def _bench(demo: Demo, progress: Progress | None, *, force: bool) -> None:
    from elevon.bench.procedure import load_procedure
    from elevon.bench.run import run_procedure

    procedure = load_procedure(Path(str(files("elevon.demo") / "bench.toml")))
    demo.timed(
        "virtual bench: four logs of 20 s",
        lambda: run_procedure(
            procedure,
            demo.hidden,
            demo.folder / "logs",
            seed=demo.seed,
            truth=demo.folder / "truth.json",
            force=force,
            progress=progress,
        ),
    )
    demo.bench_truth = json.loads((demo.folder / "truth.json").read_text("utf-8"))


def _read(demo: Demo) -> None:
    from elevon.bench.logs.importing import import_log, same_rate
    from elevon.calibrate.log import bench_log

    def work() -> None:
        names = [log["name"] for log in demo.bench_truth["logs"]]
        demo.imported = [import_log(demo.folder / "logs" / f"{name}.csv") for name in names]
        same_rate(demo.imported)
        demo.logs = [bench_log(item) for item in demo.imported]

    demo.timed("import and synchronisation of the two clocks", work)


def _calibrate(demo: Demo, progress: Progress | None, *, force: bool) -> None:
    from elevon.calibrate import calibrate
    from elevon.calibrate.write import write_calibration

    used = [log for log in demo.logs if log.name != f"{HELD_OUT}.csv"]
    demo.calibration = demo.timed(
        "calibration on three logs", lambda: calibrate(used, demo.base, progress=progress)
    )
    write_calibration(demo.folder / "calibrated.toml", demo.calibration, force=force)
    demo.truth = _truth(demo)


def _truth(demo: Demo) -> dict[str, float]:
    """True values by the names of the estimates; combinations from their own definitions."""
    value = demo.hidden.parameters.value
    truth = {
        item.path: value(item.path)
        for item in demo.calibration.estimates
        if item.path in demo.hidden.parameters
    }
    constant, inertia = 1.5 * value("motor.emf_constant"), value("motor.inertia")
    truth["derived.torque_constant"] = constant
    truth["derived.inertia"] = inertia + value("gear.inertia")
    return truth


def _validate(demo: Demo, progress: Progress | None) -> None:
    from elevon.calibrate import validate

    def work() -> None:
        demo.before = validate(demo.logs, demo.base, progress=part(progress, 0.0, 0.5))
        demo.after = validate(
            demo.logs, demo.calibration.actuator, progress=part(progress, 0.5, 1.0)
        )

    demo.timed("validation, before and after, held-out log among the four", work)


def _report(demo: Demo, *, force: bool) -> None:
    from elevon.demo.page import demo_report

    demo_report(demo).save(demo.folder / "report.html", force=force)
