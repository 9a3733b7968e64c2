"""The demonstration's steps, each timed, each kept for a run that is interrupted."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from elevon.actuator import Actuator
from elevon.bench.hidden import RECOVERED, hidden_actuator
from elevon.calibrate import Validation, calibrate, validate
from elevon.calibrate.outcome import Calibration
from elevon.demo.finished import FinishedSteps, inputs_of, work_key
from elevon.demo.procedure import HELD_OUT, LOADED, demo_procedure
from elevon.demo.results import Backlashes
from elevon.demo.steps import Story, Work
from elevon.logs.importing import ImportedLog, import_log, same_rate
from elevon.logs.log import Log
from elevon.parameters.relations import motor_torque_constant
from elevon.progress import Progress, part
from elevon.report.checks import Check

_PAGES = ("report.html", "backlash.html", "calibrated.toml", "truth.json")


@dataclass
class Demo(Story):
    """Everything the report shows.

    Attributes
    ----------
    backlash, imported, calibration : Backlashes, list of ImportedLog, Calibration
        Results.
    before, after : Validation
        Published and calibrated values against all logs, the held-out one among them.
    truth : dict
        True value by estimate.
    """

    backlash: Backlashes = field(init=False)
    imported: list[ImportedLog] = field(init=False)
    logs: list[Log] = field(init=False)
    calibration: Calibration = field(init=False)
    before: Validation = field(init=False)
    after: Validation = field(init=False)
    truth: dict[str, float] = field(default_factory=dict)
    bench_truth: dict[str, Any] = field(default_factory=dict)

    @property
    def checks(self) -> list[Check]:
        """What must hold: the published table, the hidden values, the held-out log."""
        results = [
            replace(check, name=f"backlash table, {check.name}") for check in self.backlash.checks
        ]
        count = encoder_count(self.base)
        for path, limit in RECOVERED.items():
            true = self.truth[path]
            name = f"{path}: estimate against the hidden truth"
            allowed = limit * abs(true) + (count if path == "backlash.total" else 0.0)
            error = abs(self.calibration[path].value - true)
            results.append(Check(name, 100.0 * error / abs(true), 100.0 * allowed / abs(true), "%"))
        return [*results, *self._held_out()]

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
        return self.summary(self.checks) | {"rows": self.rows()}


def encoder_count(actuator: Actuator) -> float:
    """Angle of one encoder edge at the output [rad]."""
    from elevon.calibrate.zeros import encoder_count as count

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

    A run that was interrupted goes on where it stopped when it is started again with the same
    arguments: what is kept in ``unfinished.log`` is used, as long as it belongs to exactly
    this work, done by exactly this package.

    Parameters
    ----------
    out : path
        Folder.
    seed : int
        Of the hidden values.
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
    hidden = hidden_actuator(base, seed)
    folder = Path(out).expanduser()
    store = FinishedSteps(folder, work_key(seed, base, hidden))
    demo = Demo(seed, base, hidden, folder, store)
    _claim(demo, force=force)
    _backlash(demo, part(progress, 0.0, 0.25))
    logs = _bench(demo, part(progress, 0.25, 0.5))
    _read(demo)
    _calibrate(demo, part(progress, 0.5, 0.85), logs)
    _validate(demo, part(progress, 0.85, 0.97), logs)
    _report(demo, force=force)
    store.clear()
    if progress is not None:
        progress(1.0)
    return demo


def _claim(demo: Demo, *, force: bool) -> None:
    """Refuse what may not be replaced, before any work; name the work, or go on with it."""
    from elevon.bench.run import claim_bench
    from elevon.files import check_output

    if demo.finished.begun(force=force):
        check_output(demo.folder / "report.html", force=force)
        return
    for path in demo_files(demo.folder):
        check_output(path, force=force)
    claim_bench(demo_procedure(), demo.hidden, demo.folder / "logs", seed=demo.seed, force=force)
    demo.finished.begin()


def _backlash(demo: Demo, progress: Progress | None) -> None:
    from elevon.reproduce.backlash.campaign import reproduce_backlash
    from elevon.reproduce.case_page import case_page

    page = demo.folder / "backlash.html"

    def work() -> Backlashes:
        result = reproduce_backlash(progress=progress)
        case_page("torino-backlash", result).save(page, force=True, links=False)
        return Backlashes.of(result)

    demo.backlash = demo.resumed(
        "published backlash table, fifteen backlashes",
        Work("backlash", work, Backlashes, files=[page]),
    )


def _bench(demo: Demo, progress: Progress | None) -> list[Path]:
    """Make the logs that are missing; return the files of all."""
    from elevon.bench.run import BenchResult, run_procedure
    from elevon.files import write_text

    folder, truth = demo.folder / "logs", demo.folder / "truth.json"

    def work() -> BenchResult:
        return run_procedure(
            demo_procedure(), demo.hidden, folder, seed=demo.seed, progress=progress
        )

    def reused(result: BenchResult) -> str:
        old = sum(log.resumed for log in result.logs)
        return f"{old} of {len(result.logs)} logs kept from the interrupted run" if old else ""

    result = demo.timed("virtual bench: four logs of 20 s", work, reused)
    text = json.dumps(result.hidden, indent=1, default=str) + "\n"
    write_text(truth, text, force=True)
    demo.bench_truth = json.loads(text)
    return [path for log in result.logs for path in log.files]


def _read(demo: Demo) -> None:
    from elevon.logs.drive import drive_log
    from elevon.logs.read import log_of

    def work() -> None:
        names = [log["name"] for log in demo.bench_truth["logs"]]
        demo.imported = [import_log(demo.folder / "logs" / f"{name}.csv") for name in names]
        same_rate(demo.imported)
        demo.logs = [drive_log(log_of(item)) for item in demo.imported]

    demo.timed("import and synchronisation of the two clocks", work)


def _calibrate(demo: Demo, progress: Progress | None, logs: Sequence[Path]) -> None:
    from elevon.calibrate.write import write_calibration

    used = [log for log in demo.logs if log.name != f"{HELD_OUT}.csv"]
    target = demo.folder / "calibrated.toml"

    def work() -> Calibration:
        result = calibrate(used, demo.base, progress=progress)
        write_calibration(target, result, force=True)
        return result

    demo.calibration = demo.resumed(
        "calibration on three logs",
        Work("calibration", work, Calibration, inputs_of(logs), [target]),
    )
    demo.truth = _truth(demo)


def _truth(demo: Demo) -> dict[str, float]:
    """True values by the names of the estimates; combinations from their own definitions."""
    value = demo.hidden.parameters.value
    truth = {
        item.path: value(item.path)
        for item in demo.calibration.estimates
        if item.path in demo.hidden.parameters
    }
    constant, inertia = motor_torque_constant(demo.hidden.parameters), value("motor.inertia")
    truth["derived.torque_constant"] = constant
    truth["derived.inertia"] = inertia + value("gear.inertia")
    truth["derived.integral_gain"] = value("control.speed_gain") / value("control.integral_time")
    for log in demo.bench_truth["logs"]:
        zero = log["conditions"]["zero"] * log["parameters"]["backlash.total"]
        truth[f"initial.lead[{log['name']}.csv]"] = zero
    for log in (log for log in demo.bench_truth["logs"] if log["name"] == LOADED):
        cell, rig = log["conditions"]["cell"], log["brake"]
        middle = 0.5 * (demo.logs[0].duration - log["conditions"]["trigger"])
        offset = cell["offset"] + cell["drift"] * middle
        truth["sensor.load_cell_offset"] = offset * rig["arm"] / rig["chain_ratio"]
    return truth


def _validate(demo: Demo, progress: Progress | None, logs: Sequence[Path]) -> None:
    def validated(piece: str, actuator: Actuator, share: Progress | None) -> Validation:
        what = "published" if piece == "before" else "calibrated"
        return demo.resumed(
            f"validation of the {what} values on all four logs",
            Work(
                piece,
                lambda: validate(demo.logs, actuator, progress=share),
                Validation,
                inputs_of(logs, actuator.hash),
            ),
        )

    demo.before = validated("before", demo.base, part(progress, 0.0, 0.5))
    demo.after = validated("after", demo.calibration.actuator, part(progress, 0.5, 1.0))


def _report(demo: Demo, *, force: bool) -> None:
    from elevon.demo.page import demo_report

    demo_report(demo).save(demo.folder / "report.html", force=force)
