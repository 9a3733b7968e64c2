"""Lives of foreign growth and Virkler's cracks, predicted by all methods."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.prognose import GrowthFilter, Inspection, Process
from elevon.prognose.future import MODEL_ERROR, look_ahead
from elevon.progress import Progress
from elevon.worklog import finished
from studies.foreign.judge import Judged, Predict, judged_life
from studies.foreign.result import ForeignResult
from studies.foreign.truth import FORMS, NAMED_LAW, Case, ForeignLife, case, foreign_life, inspected
from studies.foreign.virkler import EXPONENTS, crack, crack_case, crack_inspections, cracks
from studies.prognosis.truth import FAULTS
from studies.side_by_side import side_by_side

_SAMPLES = 500
_DENSITIES = (1.0, 4.0)  # inspections in 4 % of the expected life


def study_foreign(
    *,
    lives: int = 7,
    specimens: int = 68,
    seed: int = 0,
    processes: int | None = None,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> ForeignResult:
    """Predict lives that no law of the filter describes.

    Parameters
    ----------
    lives : int
        Of each form and fault.
    specimens : int
        Of Virkler's, evenly from the shortest life to the longest, with each exponent.
    seed : int
        Of lives and inspections.
    processes : int, optional
        That work side by side; default: one for each processor.
    folder : path, optional
        Where finished lives are noted; the same work goes on from there. Default: nowhere.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    InputError
        No life of a form.
    Interrupted
        `progress` returned False; finished lives stay noted.
    """
    if lives < 1:
        raise InputError(f"{lives} lives: at least 1 of each form is needed")
    begin, works = clock.perf_counter(), _works(lives, specimens, seed)
    with finished(folder, f"foreign seed {seed}") as done:
        known: dict[str, list[dict[str, Any]]] = {
            name: done.items[name].data["rows"] for name in works if done and name in done.items
        }
        calls = {name: call for name, call in works.items() if name not in known}
        for name, rows in side_by_side(calls, processes=processes, progress=progress):
            known[name] = rows
            if done is not None:
                done.note(name, [], rows=rows)
    judged = tuple(Judged(**row) for name in works for row in known[name])
    return ForeignResult(judged, seed, clock.perf_counter() - begin)


def _works(lives: int, specimens: int, seed: int) -> dict[str, partial[list[dict[str, Any]]]]:
    out: dict[str, partial[list[dict[str, Any]]]] = {}
    every = len(cracks()[1])
    chosen = np.unique(np.linspace(0, every - 1, min(specimens, every)).round().astype(int))
    for exponent in EXPONENTS:
        for n in chosen.tolist():
            out[f"crack {n}, {exponent:g}"] = partial(_crack, n, exponent, seed)
    # All forms once, then all again: work that is stopped has seen each of them.
    for n, form, law, density in product(range(lives), (NAMED_LAW, *FORMS), FAULTS, _DENSITIES):
        out[f"{form}, {law} {n}, {density:g}"] = partial(_foreign, law, form, n, density, seed)
    return out


def _foreign(law: str, form: str, number: int, density: float, seed: int) -> list[dict[str, Any]]:
    life, given = foreign_life(law, form, number, seed), case(law)
    every = inspected(life, density, seed)
    return _rows(life, given, every, density, seed)


def _crack(number: int, exponent: float, seed: int) -> list[dict[str, Any]]:
    life, given = crack(number, exponent), crack_case(exponent)
    every = crack_inspections(life, given, 1.0, seed)
    return _rows(life, given, every, 1.0, seed)


def _rows(
    life: ForeignLife, given: Case, every: Sequence[Inspection], density: float, seed: int
) -> list[dict[str, Any]]:
    predict = _predictor(given)
    judged = judged_life(life, given, every, density=density, seed=seed, predict=predict)
    return [asdict(r) for r in judged]


def _predictor(given: Case) -> Predict:
    """Return what predicts one life as `elevon predict` does, inspection by inspection."""
    flt = GrowthFilter(Process(given.tables))
    taken = 0

    def predict(seen: Sequence[Inspection], _given: Case) -> tuple[Floats, str]:
        nonlocal taken
        for item in seen[taken:]:
            flt.update(item)
        taken = len(seen)
        rng = np.random.default_rng(36)
        units = flt.drawn(_SAMPLES, rng)
        future = look_ahead(
            flt.process, units, given.mission.usage, rng, model_error=MODEL_ERROR, course=False
        )
        return future.remaining, "off_law" if flt.contradictions() else "ok"

    return predict
