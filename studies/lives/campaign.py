"""Remaining lives of every kind, predicted and judged: what runs, and how it is kept."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from elevon.errors import InputError
from elevon.progress import Progress
from elevon.worklog import finished
from studies.lives.fleets import learned_rows, plan_rows
from studies.lives.judge import OURS, Scored, drawn_rows, remaining, scored
from studies.lives.own_law import knowing, own_inspections, own_life
from studies.lives.real import crack_history, public_histories, real_rows
from studies.lives.result import LivesResult
from studies.lives.truth import drawn_life
from studies.prognosis.truth import FAULTS
from studies.side_by_side import side_by_side

_CRACKS = 68
_POPULATIONS = 3
_PLAN = "fleet of units"


def study_lives(
    *,
    lives: int = 300,
    by_law: int = 60,
    units: int = 200,
    public: Sequence[str | Path] | None = None,
    seed: int = 0,
    processes: int | None = None,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> LivesResult:
    """Judge predictions on lives drawn at random, by own laws, of fleets, and on real ones.

    Parameters
    ----------
    lives : int
        Drawn at random.
    by_law : int
        By each law that the filter is told, at 2, at 3 and at any number of inspections.
    units : int
        Of the fleet that is kept for five years.
    public : sequence of path, optional
        Folders of public run-to-failure sets, see `studies.lives.real`.
    seed : int
        Of everything.
    processes : int, optional
        That work side by side; default: one for each processor.
    folder : path, optional
        Where finished work is noted; the same work goes on from there. Default: nowhere.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    InputError
        No lives; a public set that is none.
    Interrupted
        `progress` returned False; what is finished stays noted.
    """
    if lives < 3:
        raise InputError(f"{lives} lives: at least 3 are needed")
    begin = clock.perf_counter()
    works = _works(lives, by_law, units, tuple(map(Path, public or ())), seed)
    with finished(folder, f"lives seed {seed}") as done:
        known: dict[str, Any] = {
            name: done.items[name].data["rows"] for name in works if done and name in done.items
        }
        calls = {name: call for name, call in works.items() if name not in known}
        for name, rows in side_by_side(calls, processes=processes, progress=progress):
            known[name] = rows
            if done is not None:
                done.note(name, [], rows=rows)
    judged = tuple(
        Scored(**row) for name in works if not name.startswith(_PLAN) for row in known[name]
    )
    plans = tuple(known[name] for name in works if name.startswith(_PLAN))
    return LivesResult(judged, plans[0] if plans else {}, seed, clock.perf_counter() - begin)


def _works(
    lives: int, by_law: int, units: int, public: tuple[Path, ...], seed: int
) -> dict[str, partial[Any]]:
    out: dict[str, partial[Any]] = {}
    for k in range(lives):
        out[f"drawn {k}"] = partial(_drawn, k, seed)
    for law in FAULTS:
        for k in range(by_law // len(FAULTS)):
            for looks in (0, 2, 3):
                out[f"{law} {k} {looks}"] = partial(_by_law, law, k, looks, seed)
    for k in range(_CRACKS):
        out[f"crack {k}"] = partial(_crack, k, seed)
    for place in public:
        for k, unit in enumerate(public_histories(place)):
            out[f"{place.name} {k}"] = partial(real_rows, place.name, k, unit, seed)
    for k in range(_POPULATIONS if by_law else 0):
        out[f"population {k}"] = partial(learned_rows, k, seed)
    if units:
        out[f"{_PLAN} {units}"] = partial(plan_rows, seed, units=units)
    return out


def _drawn(number: int, seed: int) -> list[dict[str, Any]]:
    return drawn_rows(drawn_life(number, seed), seed)


def _crack(number: int, seed: int) -> list[dict[str, Any]]:
    return real_rows("Virkler", number, crack_history(number, seed), seed)


def _by_law(law: str, number: int, looks: int, seed: int) -> list[dict[str, Any]]:
    """Predict a life by its own law, as told it and as one that knows law and spread."""
    life = own_life(law, number, seed)
    seen = own_inspections(life, number, seed, looks=looks or None)
    true = life.end - seen[-1].usage
    group = f"own law, {looks} inspections" if looks else "own law"
    answers = {
        OURS: remaining(life.given.tables, seen, number),
        "knows the law": knowing(life.given, seen, np.random.default_rng([74, seed, number])),
    }
    return [
        asdict(
            scored(
                name, group, 1000 * FAULTS.index(law) + number, left, true=true, life=life.end,
                far=20.0 * life.given.expected, looks=len(seen),
            )
        )
        for name, left in answers.items()
    ]  # fmt: skip
