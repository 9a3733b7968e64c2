"""Population searches on a monitor's misfit against diagnosis by the model.

The literature on these actuators finds severities by making the misfit of a monitoring model small
with a genetic algorithm, differential evolution, a particle swarm or grey wolves. Here they get
the reduced-order model, its test's command and start to the last bit, and a budget of runs; ours
get the log as the bench writes it and one healthy log of the same test.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.replay import _RECENT
from elevon.report import Check, verdict
from elevon.worklog import finished
from studies.common import Row, student_interval
from studies.optimisers import CAUSES, METHODS, MonitoringModel, search
from studies.optimisers.cost import limits
from studies.side_by_side import side_by_side

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.bench.rig import Setup
    from elevon.diagnose.engine.answer import Diagnosis
    from elevon.logs.log import Log
    from elevon.progress import Progress

__all__ = ["CASES", "OURS", "OptimisersResult", "study_optimisers"]

#: Faults that are diagnosed, on the no-load run of the bench: those the project must see there.
CASES: Mapping[str, Mapping[str, float]] = {
    "backlash 0.13 deg": {"backlash@transmission": math.radians(0.13)},
    "friction +25 %": {"friction@transmission": 0.25},
    "short 20 %": {"short@motor.phase_a": 0.20},
    "eccentricity 0.10": {"eccentricity_static@motor": 0.10},
    "position gain +2 %": {"gain_drift@control.position": 0.02},
    "backlash and friction": {
        "backlash@transmission": math.radians(0.13),
        "friction@transmission": 0.25,
    },
}
OURS = "model"
BUDGET = 2000
"""Evaluations of a search: fifty generations of forty. ASSUMED: of the literature's order."""
_PROCEDURE = "backlash"


@dataclass(frozen=True)
class SearchOutcome(Row):
    """One method on one log.

    Attributes
    ----------
    case, method : str
        What, by which.
    error : float
        RMS over the causes of severity error over range.
    evaluations : int
        Model runs.
    seconds : float
        Of processor time.
    reached : float
        Processor time until the error was that of the model's diagnosis; NaN: never.
    """

    case: str
    method: str
    error: float
    evaluations: int
    seconds: float
    reached: float

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {**vars(self), "reached": self.reached if math.isfinite(self.reached) else None}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> SearchOutcome:
        """Return what `to_dict` wrote."""
        return super().from_dict(
            data | {"reached": math.nan if data["reached"] is None else data["reached"]}
        )


@dataclass(frozen=True)
class OptimisersResult:
    """The table.

    Attributes
    ----------
    outcomes : tuple of SearchOutcome
        Every log by every method.
    """

    outcomes: tuple[SearchOutcome, ...]

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each method and fault, and one over all faults."""
        methods = list(dict.fromkeys(o.method for o in self.outcomes))
        cases = list(dict.fromkeys(o.case for o in self.outcomes))
        every = [(m, [case]) for m in methods for case in cases]
        every += [(m, cases) for m in methods]
        return [self._row(m, among) for m, among in every]

    def _row(self, method: str, cases: Sequence[str]) -> dict[str, Any]:
        rows = [o for o in self.outcomes if o.method == method and o.case in cases]
        error, low, high = student_interval([100.0 * o.error for o in rows])
        seconds, early, late = student_interval([o.seconds for o in rows])
        reached = [o.reached for o in rows if math.isfinite(o.reached)]
        return {
            "method": method,
            "fault": cases[0] if len(cases) == 1 else "all",
            "logs": len(rows),
            "error_percent_of_range": error,
            "error_interval": [low, high],
            "evaluations": float(np.mean([o.evaluations for o in rows])),
            "seconds": seconds,
            "seconds_interval": [early, late],
            "reached_our_error": len(reached),
        }

    def checks(self) -> list[Check]:
        """Return what must hold: the model's error and time against each."""
        over = {row["method"]: row for row in self.rows() if row["fault"] == "all"}
        ours = over[OURS]
        out = []
        for name in METHODS:
            error = ours["error_percent_of_range"] / over[name]["error_percent_of_range"]
            out.append(Check(f"error, model over {name}", error, 1.0, ""))
            seconds = ours["seconds"] / over[name]["seconds"]
            out.append(Check(f"processor time, model over {name}", seconds, 1.0, ""))
            pairs = self._paired(name)
            text = f"error of {name} less the model's, lower end of 95 %"
            out.append(Check(text, student_interval(pairs)[1], 0.0, "% of range", at_least=True))
        return out

    def _paired(self, name: str) -> list[float]:
        ours = [o for o in self.outcomes if o.method == OURS]
        theirs = [o for o in self.outcomes if o.method == name]
        return [100.0 * (b.error - a.error) for a, b in zip(ours, theirs, strict=True)]

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        checks = self.checks()
        return {
            **verdict(checks),
            "causes": {key: list(ends) for key, ends in limits().items()},
            "rows": self.rows(),
        }


def study_optimisers(
    *,
    seed: int = 0,
    seeds: int = 4,
    budget: int = BUDGET,
    cases: Sequence[str] = tuple(CASES),
    processes: int | None = None,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> OptimisersResult:
    """Diagnose logs of the switching model by every method.

    Parameters
    ----------
    seed : int
        Of logs and searches.
    seeds : int
        Logs of every case, each with a healthy log of its own.
    budget : int
        Evaluations of a search.
    cases : sequence of str
        Of `CASES`.
    processes : int, optional
        That work side by side, a log each; default: one for each processor.
    folder : path, optional
        Where finished logs are noted; the same work goes on from there. Default: nowhere.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    Interrupted
        `progress` returned False; finished logs stay noted.
    """
    from elevon.actuator import Actuator

    unit = Actuator.load("torino-rotary").with_values(
        {"drive.kind": "pwm", "motor.eccentricity_law": "published"}, request=False
    )
    names = [f"{case} {k}" for k in range(seeds) for case in cases]
    with finished(folder, f"diagnosis-optimisers seed {seed} budget {budget}") as done:
        known = {n: done.items[n].data["rows"] for n in names if done and n in done.items}
        missing = [n for n in names if n not in known]
        jobs = dict(zip(names, _logs(unit, cases, seed, seeds) if missing else (), strict=False))
        # The seeds do not depend on which are missing.
        numbers = {name: seed + k for k, name in enumerate(jobs)}
        calls = {n: partial(_one, unit, *jobs[n], budget=budget, seed=numbers[n]) for n in missing}
        for name, rows in side_by_side(calls, processes=processes, progress=progress):
            known[name] = [row.to_dict() for row in rows]
            if done is not None:
                done.note(name, [], rows=known[name])
    return OptimisersResult(tuple(SearchOutcome.from_dict(row) for n in names for row in known[n]))


Job = tuple[str, "Setup", "Log", "Log"]


def _logs(unit: Actuator, cases: Sequence[str], seed: int, seeds: int) -> list[Job]:
    from elevon.bench.procedure import load_procedure
    from elevon.bench.rig import setups
    from elevon.bench.traces import first_trace
    from elevon_cases.torino.bench_unit import logs_of

    procedure = first_trace(load_procedure(_PROCEDURE))
    pairs: list[tuple[str, Setup]] = []
    for k in range(seeds):
        for number, case in enumerate(("", *cases)):
            texts = [_text(key, s, k) for key, s in CASES[case].items()] if case else []
            run_seed = 1000 * seed + 100 * k + number
            pairs.append((case, setups(procedure, unit, faults=texts, seed=run_seed)[0]))
    logs = logs_of([setup for _, setup in pairs], "high", None, whole=False)
    width = 1 + len(cases)
    return [
        (case, setup, logs[n], logs[n - n % width]) for n, (case, setup) in enumerate(pairs) if case
    ]


def _text(key: str, severity: float, k: int) -> str:
    place = "motor.phase_" + "abc"[k % 3]
    return f"short@{place}={severity!r}" if key.startswith("short") else f"{key}={severity!r}"


def _one(
    unit: Actuator,
    case: str,
    setup: Setup,
    log: Log,
    base: Log,
    *,
    budget: int,
    seed: int,
) -> list[SearchOutcome]:
    from elevon.diagnose.by_model import diagnose

    runs = _model_runs(unit, log)
    _RECENT.clear()  # every log pays for its own model runs
    begin = clock.process_time()
    answer = diagnose([log], unit, baselines=[base], faults=list(CAUSES))
    seconds = clock.process_time() - begin
    error = _error(_named(answer), case)
    ours = SearchOutcome(case, OURS, error, runs, seconds, math.nan)
    searches = (_searched(setup, log, case, m, error, budget=budget, seed=seed) for m in METHODS)
    return [ours, *searches]


def _model_runs(unit: Actuator, log: Log) -> int:
    """Runs of the reduced-order model that diagnosis by the model makes for one log."""
    from elevon.diagnose.engine.candidates import chosen
    from elevon.diagnose.engine.replay import replay
    from elevon.diagnose.positions.reading import PositionReading

    return replay(PositionReading(log, unit), chosen(list(CAUSES))).runs


def _named(result: Diagnosis) -> dict[str, float]:
    """Severities of the faults that are said to be there."""
    there = {f"{c.kind}@{c.place}": c.severity for c in result.faults}
    return {key: there[key] for key in result.best}


def _error(severities: Mapping[str, float], case: str) -> float:
    """RMS over the causes of the severity's error over the cause's range."""
    true = CASES[case]
    parts = [
        (severities.get(key, 0.0) - true.get(key, 0.0)) / (high - low)
        for key, (low, high) in limits().items()
    ]
    return float(np.sqrt(np.mean(np.square(parts))))


def _searched(
    setup: Setup, log: Log, case: str, method: str, goal: float, *, budget: int, seed: int
) -> SearchOutcome:
    begin = clock.process_time()
    monitor = MonitoringModel(setup, log)
    best, reached = math.inf, math.nan

    def costs(vectors: Floats) -> Floats:
        nonlocal best, reached
        values = monitor.costs(vectors)
        if values.min() < best:
            best = float(values.min())
            error = _error(monitor.severities(vectors[int(values.argmin())]), case)
            now = clock.process_time() - begin
            reached = math.nan if error > goal else reached if math.isfinite(reached) else now
        return values

    result = search(method, costs, monitor.size, budget=budget, seed=seed)
    error = _error(monitor.severities(result.vector), case)
    seconds = clock.process_time() - begin
    return SearchOutcome(case, method, error, monitor.evaluations, seconds, reached)
