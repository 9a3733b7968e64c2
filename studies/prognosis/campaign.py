"""Sixty lives on the switching model, each predicted from its inspections."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.prognose import (
    GrowthFilter,
    Inspection,
    Mission,
    Process,
    ResponseTables,
    respond,
)
from elevon.prognose.future import MODEL_ERROR, look_ahead
from elevon.prognose.metrics import Track
from elevon.prognose.predict import LEVEL
from elevon.prognose.process import UnitPopulation
from elevon.progress import Progress
from elevon.worklog import finished
from studies.prognosis.result import SHARES, PrognosisResult, UnitResult
from studies.prognosis.truth import (
    FAULTS,
    Inspector,
    UnitTruth,
    true_unit,
)
from studies.side_by_side import side_by_side

__all__ = ["campaign_mission", "study_prognosis"]

_BASE = "torino-rotary"
_INTERVAL = 0.02  # of the life that the model expects, between inspections: some hundred flights
_OF_THE_REST = 0.1  # of the least life that is left, after which the next inspection is due
_SOONEST = 0.002  # of the life that the model expects, between inspections: some ten flights
_SAMPLES = 1000


def campaign_mission() -> Mission:
    """Return the histories' mission."""
    return Mission.load(Path(str(files("studies.prognosis") / "mission.toml")))


def study_prognosis(
    *,
    histories: int = 60,
    seed: int = 0,
    processes: int | None = None,
    folder: Path | None = None,
    measured: bool = False,
    progress: Progress | None = None,
) -> PrognosisResult:
    """Let units live and predict their ends.

    Parameters
    ----------
    histories : int
        Lives, shared evenly by the laws of `FAULTS`.
    seed : int
        Of everything; a history is the same whatever their number.
    processes : int, optional
        That work side by side, a history each; default: one for each processor.
    folder : path, optional
        Where finished histories are noted; the same work goes on from there. Default: nowhere.
    measured : bool
        Whether inspections carry what the unit showed of its requirements, too.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    InputError
        Fewer histories than laws.
    Interrupted
        `progress` returned False; finished histories stay noted.
    """
    if histories < len(FAULTS):
        raise InputError(f"{histories} histories: at least {len(FAULTS)}, one a law, are needed")
    begin = clock.perf_counter()
    numbers = range(histories)
    work = f"prognosis seed {seed}{' measured' if measured else ''}"
    with finished(folder, work) as done:
        known = {n: done.items[str(n)].data for n in numbers if done and str(n) in done.items}
        missing = [n for n in numbers if n not in known]
        expected = _expected() if missing else {}
        calls = {str(n): partial(_history, n, seed, expected, measured=measured) for n in missing}
        for name, data in side_by_side(calls, processes=processes, progress=progress):
            known[int(name)] = data
            if done is not None:
                done.note(name, [], **data)
    rows = [known[n] for n in numbers]
    return PrognosisResult(
        tuple(UnitResult.of(row["unit"]) for row in rows if "unit" in row),
        seed,
        clock.perf_counter() - begin,
        tuple(row["left_out"] for row in rows if "left_out" in row),
        measured,
    )


def _history(
    number: int, seed: int, expected: Mapping[str, float], *, measured: bool
) -> dict[str, Any]:
    """Return one life with its predictions as it is noted; or why it cannot be judged."""
    base, mission = Actuator.load(_BASE), campaign_mission()
    law = FAULTS[number % len(FAULTS)]
    truth = true_unit(base, mission, law, number, seed)
    unit = predicted(truth, mission, InspectionPlan.of(expected[law]), seed, measured=measured)
    if unit is None:
        return {"left_out": f"history {number}: no inspection before half of its life"}
    return {"unit": unit.noted()}


def _expected() -> dict[str, float]:
    """Return the median life that the model expects of a unit in which one law acts alone."""
    base, mission, out = Actuator.load(_BASE), campaign_mission(), {}
    for law in mission.laws():
        requirements = tuple(
            item for item in mission.requirement if item.fault is None or item.fault == law.key
        )
        alone = mission.model_copy(update={"requirement": requirements})
        process = Process(respond(base, alone, laws=[replace(law, dormant=0.0)]))
        rng = np.random.default_rng(0)
        future = look_ahead(process, process.start(500, rng), mission.usage, rng)
        out[law.name] = float(np.median(future.end))
    return out


@dataclass(frozen=True)
class InspectionPlan:
    """When units are inspected: at even intervals, sooner where the end may be near.

    Attributes
    ----------
    interval : float
        Use between inspections at most.
    soonest : float
        At least.
    """

    interval: float
    soonest: float

    @classmethod
    def of(cls, expected: float) -> InspectionPlan:
        """Return the campaign's, for a life that is expected."""
        return cls(_INTERVAL * expected, _SOONEST * expected)

    def wait(self, least: float) -> float:
        """Return the use until the next inspection, from the least remaining life predicted."""
        return min(max(_OF_THE_REST * least, self.soonest), self.interval)


def predicted(
    truth: UnitTruth, mission: Mission, plan: InspectionPlan, seed: int, *, measured: bool = False
) -> UnitResult | None:
    """Predict a unit's end at each inspection, on tables of its own calibrated model.

    None where it failed before it was inspected in the first half of its life.
    """
    response = respond(truth.calibrated, mission, snapshots=True)
    inspector = Inspector(truth, mission.laws(), seed, measured=measured)
    seen, track, seconds = tracked(response, mission, inspector, plan, seed)
    if not seen or seen[0].usage > SHARES[0] * truth.life.end:
        return None
    return UnitResult(
        truth.number,
        truth.law,
        mission.requirement[_first(truth, mission)].name,
        track,
        _unaided(response, mission, seen, truth, seed),
        seconds,
    )


def _first(truth: UnitTruth, mission: Mission) -> int:
    """Index among all requirements of the one that failed."""
    key = next(law.key for law in mission.laws() if law.name == truth.law)
    indices = [k for k, r in enumerate(mission.requirement) if r.fault is None or r.fault == key]
    return indices[truth.life.first]


def tracked(
    response: ResponseTables,
    mission: Mission,
    inspector: Inspector,
    plan: InspectionPlan,
    seed: int,
) -> tuple[list[Inspection], Track, float]:
    """Inspect a unit until its end and predict it each time.

    Returns
    -------
    seen : list of Inspection
        What the inspections said.
    track : Track
        The predictions; empty where there was no inspection.
    seconds : float
        Longest processor time of one.
    """
    flt = GrowthFilter(Process(response), seed=seed)
    seen: list[Inspection] = []
    rows: list[list[float]] = []
    longest, wait, end = 0.0, plan.interval, inspector.truth.life.end
    while True:
        usage = (seen[-1].usage if seen else 0.0) + wait * inspector.rng.uniform(0.6, 1.4)
        if usage >= end:
            return seen, _track(seen, rows, end), longest
        seen.append(inspector.at(usage))
        begin = clock.process_time()
        flt.update(seen[-1])
        rng = np.random.default_rng([20, seed])
        units = flt.drawn(_SAMPLES, rng)
        rows.append(_remaining(flt.process, units, mission, rng))
        longest = max(longest, clock.process_time() - begin)
        wait = plan.wait(rows[-1][0])


def _remaining(
    process: Process, units: UnitPopulation, mission: Mission, rng: np.random.Generator
) -> list[float]:
    """Return low, median, high of the remaining life, as `elevon predict` draws it."""
    future = look_ahead(process, units, mission.usage, rng, model_error=MODEL_ERROR, course=False)
    return _quantiles(future.remaining)


def _track(seen: Sequence[Inspection], rows: Sequence[Sequence[float]], end: float) -> Track:
    low, median, high = np.array(rows).reshape(-1, 3).T
    return Track(np.array([item.usage for item in seen]), median, low, high, end)


def _quantiles(remaining: Floats) -> list[float]:
    tail = 0.5 * (1.0 - LEVEL)
    ranked = np.sort(np.minimum(remaining, 1e7))
    return [
        float(ranked[min(int(q * len(ranked)), len(ranked) - 1)]) for q in (tail, 0.5, 1 - tail)
    ]


def _unaided(
    response: ResponseTables,
    mission: Mission,
    seen: Sequence[Inspection],
    truth: UnitTruth,
    seed: int,
) -> Track:
    """Return what the laws alone say: the same life for every unit, less what was used.

    They know which law will end the unit, which flatters them.
    """
    process = Process(response)
    rng = np.random.default_rng([21, seed])
    units = process.start(_SAMPLES, rng)
    others = [k for k, law in enumerate(process.laws) if law.name != truth.law]
    units.active[:, others] = False
    units = replace(units, damage=np.where(units.active, units.damage, 0.0))
    life = _quantiles(look_ahead(process, units, mission.usage, rng).end)
    rows = [[max(value - item.usage, 0.0) for value in life] for item in seen]
    return _track(seen, rows, truth.life.end)
