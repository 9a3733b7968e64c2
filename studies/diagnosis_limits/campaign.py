"""The campaign: units drawn, calibrated on a healthy log a test, the other logs diagnosed."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from elevon.errors import ElevonWarning, InputError
from elevon.progress import Progress, part
from elevon.worklog import WorkLog, finished
from studies.common import advance
from studies.diagnosis_limits.judge import Injected, Row, judged
from studies.diagnosis_limits.logs import TESTS, Trial, bench_logs
from studies.diagnosis_limits.plan import Planned, planned, trials_of
from studies.diagnosis_limits.unit import BASE, BenchUnit, draw_unit

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

__all__ = ["Campaign", "calibrated", "calibrated_on", "run_campaign"]

BLOCK = 16  # logs that are simulated together


@dataclass(frozen=True)
class Campaign:
    """What was measured.

    Attributes
    ----------
    seed, units : int
        Of the draws.
    rows : tuple of Row
        One a log.
    """

    seed: int
    units: int
    rows: tuple[Row, ...]


def run_campaign(
    *, seed: int = 0, units: int = 8, folder: Path | None = None, progress: Progress | None = None
) -> Campaign:
    """Make the logs and diagnose them.

    Parameters
    ----------
    seed : int
        Of everything.
    units : int
        Benches; 95 logs each.
    folder : path, optional
        Where finished logs are noted, so that an interrupted campaign goes on; default: nowhere.
    progress : callable, optional
        As everywhere.

    Raises
    ------
    InputError
        Fewer than one unit.
    Interrupted
        `progress` returned False.
    """
    if units < 1:
        raise InputError(f"--runs {units}: at least one unit")
    rows: list[Row] = []
    with finished(folder, f"diagnosis-limits seed {seed}") as done:
        for number in range(units):
            share = part(progress, number / units, (number + 1) / units)
            rows += _unit_rows(seed, number, done, share)
    return Campaign(seed, units, tuple(rows))


def _unit_rows(
    seed: int, number: int, done: WorkLog | None, progress: Progress | None
) -> list[Row]:
    wanted = planned(seed, number)
    rows = {name: _read(item.data) for name, item in done.items.items()} if done else {}
    missing = [p for p in wanted if p.trial.name not in rows]
    if missing:
        unit = draw_unit(seed, number)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ElevonWarning)
            actuator, baselines = calibrated(unit, seed, part(progress, 0.0, 0.2))
            for k in range(0, len(missing), BLOCK):
                block = missing[k : k + BLOCK]
                share = part(progress, *(0.2 + 0.8 * x / len(missing) for x in (k, k + len(block))))
                for row in _block_rows(unit, block, actuator, baselines, share):
                    rows[row.name] = row
                    if done is not None:
                        done.note(row.name, [], row=row.to_dict())
    return [rows[p.trial.name] for p in wanted]


def calibrated(unit: BenchUnit, seed: int, progress: Progress | None) -> tuple[Actuator, list[Log]]:
    """One healthy log a test, each of a day of its own: calibration, then baselines."""
    key = (seed * 1000 + unit.number) * 1000
    trials = [trials_of(test, key + k, f"base-{test}") for k, test in enumerate(TESTS)]
    return calibrated_on(unit, trials, len(trials), progress)


def calibrated_on(
    unit: BenchUnit, trials: Sequence[Trial], first: int, progress: Progress | None
) -> tuple[Actuator, list[Log]]:
    """Calibrate on the first of some healthy trials; all of them are baselines."""
    from elevon.actuator import Actuator
    from elevon.calibrate.calibration import calibrate
    from elevon.diagnose.positions.log import prepared

    with tempfile.TemporaryDirectory() as folder:
        logs = bench_logs(unit, trials, Path(folder), part(progress, 0.0, 0.3))
    result = calibrate(logs[:first], Actuator.load(BASE), progress=part(progress, 0.3, 1.0))
    return result.actuator, [prepared(log, result.actuator) for log in logs]


def _block_rows(
    unit: BenchUnit,
    block: Sequence[Planned],
    actuator: Actuator,
    baselines: Sequence[Log],
    progress: Progress | None,
) -> Iterator[Row]:
    from elevon.diagnose.by_model import diagnose

    with tempfile.TemporaryDirectory() as folder:
        trials = [p.trial for p in block]
        logs = bench_logs(unit, trials, Path(folder), part(progress, 0.0, 0.6))
    for k, (item, log) in enumerate(zip(block, logs, strict=True)):
        result = diagnose([log], actuator, baselines=baselines)
        yield judged(
            result, item.trial.name, test=item.trial.test, group=item.group, unit=unit.number,
            truth=item.truth,
        )  # fmt: skip
        advance(progress, 0.6 + 0.4 * (k + 1) / len(block), "diagnosis-limits")


def _read(data: dict[str, Any]) -> Row:
    """Return a row from what was noted."""
    row = dict(data["row"])
    faults = row.pop("faults")
    truth = []
    for text in faults:
        name, severity = text.split("=")
        kind, place = name.split("@")
        truth.append(Injected(kind, place, float(severity)))
    row["causes"] = tuple(row["causes"])
    row["severities"] = tuple(None if s is None else tuple(s) for s in row["severities"])
    return Row(truth=tuple(truth), **row)
