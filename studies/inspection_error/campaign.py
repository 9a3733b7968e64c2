"""The inspections: units drawn, calibrated, each inspection's three logs diagnosed together.

What an inspection says is read as `elevon predict` reads it, from the JSON of a diagnosis.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from elevon.errors import ElevonWarning, InputError
from elevon.prognose.law import LAWS
from elevon.prognose.observation import inspection
from elevon.progress import Progress, part
from elevon.worklog import WorkLog, finished
from studies.common import Row, advance
from studies.diagnosis_limits.campaign import calibrated_on
from studies.diagnosis_limits.logs import TESTS, Trial, bench_logs
from studies.diagnosis_limits.unit import BenchUnit, draw_unit, of_the_day
from studies.inspection_error.plan import FAULTS, DayVisit, healthy_trials, visits

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

    _Bench = tuple[BenchUnit, Actuator, list[Log], int]  # unit, calibrated set, baselines, seed

__all__ = ["OF_THE_DAY", "Inspected", "friction_of", "inspect_units"]

OF_THE_DAY = "lubricant_loss"
"""The law whose fault changes from day to day also while it does not grow: dry friction."""


@dataclass(frozen=True)
class Inspected(Row):
    """One inspection: what was true, what was said.

    Attributes
    ----------
    name : str
        Of the inspection.
    unit : int
        Of the bench.
    law : str
        Whose fault it had.
    level : int
        As in `DayVisit`.
    severity : float
        True.
    days : int
        On which its logs were taken: 1, or one for each test.
    day : float
        Dry friction of its days over that of the baselines' days, on the bench. Friction alone is
        said against it; 1 for other faults.
    estimate : float or None
        Median severity; None where the fault was not seen.
    low, high : float
        Deviations stated below and above it.
    detectable : float
        Least severity that the diagnosis says it can see.
    others : tuple of str
        Faults of the other laws that were seen and not there.
    """

    name: str
    unit: int
    law: str
    level: int
    severity: float
    days: int
    day: float
    estimate: float | None
    low: float
    high: float
    detectable: float
    others: tuple[str, ...]

    @property
    def error(self) -> float:
        """Of the severity said, less what the days' own friction makes of it; NaN: not seen."""
        if self.estimate is None:
            return float("nan")
        return (1.0 + self.estimate) / self.day - 1.0 - self.severity


def inspect_units(
    *, seed: int = 0, units: int = 6, folder: Path | None = None, progress: Progress | None = None
) -> list[Inspected]:
    """Make the logs and diagnose them.

    Parameters
    ----------
    seed : int
        Of everything.
    units : int
        Benches; 40 inspections of three logs of one day, 4 of three days.
    folder : path, optional
        Where finished inspections are noted, so that an interrupted run goes on; default: nowhere.
    progress : callable, optional
        As everywhere.

    Raises
    ------
    InputError
        Fewer than two units: what is common to a unit shows between units only.
    Interrupted
        `progress` returned False.
    """
    if units < 2:
        raise InputError(
            f"--units {units}: at least two, since a unit's own error shows only between units"
        )
    out: list[Inspected] = []
    with finished(folder, f"inspection-error seed {seed}") as done:
        for number in range(units):
            share = part(progress, number / units, (number + 1) / units)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ElevonWarning)
                out += _unit(seed, number, done, share)
    return out


def _unit(
    seed: int, number: int, done: WorkLog | None, progress: Progress | None
) -> Iterator[Inspected]:
    """Yield a unit's inspections, a severity at a time."""
    groups = [list(v) for _, v in groupby(visits(seed, number), lambda v: (v.law, v.level))]
    noted = done.items if done is not None else {}
    ready: _Bench | None = None
    for k, group in enumerate(groups):
        key = group[0].name
        if key in noted:
            yield from (Inspected.from_dict(row) for row in noted[key].data["rows"])
            continue
        if ready is None:
            unit = draw_unit(seed, number)
            trials = healthy_trials(seed, number)
            ready = (unit, *calibrated_on(unit, trials, len(TESTS), part(progress, 0.0, 0.2)), seed)
        rows = _severity(number, group, ready)
        if done is not None:
            done.note(key, [], rows=[row.to_dict() for row in rows])
        yield from rows
        advance(progress, 0.2 + 0.8 * (k + 1) / len(groups), "inspection-error")


def _severity(number: int, group: Sequence[DayVisit], bench: _Bench) -> list[Inspected]:
    """Inspect one severity, a day at a time; friction also by one log of each of three days."""
    with tempfile.TemporaryDirectory() as folder:
        trials = [trial for visit in group for trial in visit.trials]
        logs = bench_logs(bench[0], trials, Path(folder))
    width = len(TESTS)
    days = [logs[k : k + width] for k in range(0, len(logs), width)]
    rows = [
        _inspected(number, [v], bench, day_logs) for v, day_logs in zip(group, days, strict=True)
    ]
    if group[0].law == OF_THE_DAY and len(days) == width:
        spread = [day_logs[k] for k, day_logs in enumerate(days)]
        rows.append(_inspected(number, group, bench, spread))
    return rows


def _inspected(
    number: int, group: Sequence[DayVisit], bench: _Bench, logs: Sequence[Log]
) -> Inspected:
    """Diagnose logs of one severity together; they are of the days of a group of visits."""
    from elevon.diagnose.by_model import diagnose

    visit = group[0]
    laws = [LAWS[fault.law] for fault in FAULTS]
    answer = diagnose(logs, bench[1], baselines=bench[2]).to_dict()
    seen = inspection(answer, laws, usage=0.0).seen
    key = LAWS[visit.law].key
    estimate = seen[key]
    others = tuple(k for k, s in seen.items() if k != key and s.severity is not None)
    days = [trial for v in group for trial in v.trials]
    return Inspected(
        visit.name if len(group) == 1 else f"{visit.name}-spread", number, visit.law, visit.level,
        visit.severity, len(group),
        friction_of(bench[0], days) / friction_of(bench[0], healthy_trials(bench[3], number))
        if visit.law == OF_THE_DAY else 1.0,
        estimate.severity, estimate.low, estimate.high,
        float(answer["detectable"].get(key, float("nan"))), others,
    )  # fmt: skip


def friction_of(unit: BenchUnit, trials: Sequence[Trial]) -> float:
    """Return the dry friction of a unit, a mean over the days of trials [N m]."""
    days = [of_the_day(unit, t.seed if t.day is None else t.day).parameters for t in trials]
    return sum(day.value("friction.dynamic") for day in days) / len(days)
