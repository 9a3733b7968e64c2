"""What each assumption of a prediction costs: its interval with the assumption and without it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.plain import Plain
from elevon.prognose.future import MODEL_ERROR, look_ahead
from elevon.prognose.growth import GrowthFilter
from elevon.prognose.mission import Usage
from elevon.prognose.process import Process

if TYPE_CHECKING:
    from elevon.prognose.observation import Inspection
    from elevon.prognose.response import ResponseTables


_SAMPLES = 1000


@dataclass(frozen=True)
class Assumed(Plain):
    """Remaining life where something is taken for certain; null: no end in sight."""

    name: str
    median: float | None
    low: float | None
    high: float | None


def assumptions(
    inspections: Sequence[Inspection],
    tables: ResponseTables,
    usage: Usage,
    *,
    level: float,
    seed: int = 0,
) -> tuple[Assumed, ...]:
    """Predict again, with one thing at a time taken for certain.

    Parameters
    ----------
    inspections : sequence of Inspection
        Of the unit.
    tables : ResponseTables
        Of actuator and mission.
    usage : Usage
        Of the future.
    level : float
        Of the intervals.
    seed : int
        Of chance.
    """
    alone = replace(tables, laws=tuple(replace(law, only=True) for law in tables.laws))
    steady = {"wander": False}
    cases: tuple[tuple[str, ResponseTables, dict[str, bool], float, Usage], ...] = (
        ("as it stands", tables, {}, MODEL_ERROR, usage),
        ("growth is by the laws alone", alone, {}, MODEL_ERROR, usage),
        ("rates stay as they are now", tables, steady, MODEL_ERROR, usage),
        ("the model has no error", tables, {}, 0.0, usage),
        ("loads are the mission's", tables, {}, MODEL_ERROR, Usage()),
    )
    out = []
    for name, of, how, error, future in cases:
        if name.startswith("loads") and usage == future:
            continue
        flt = GrowthFilter(Process(of, **how), seed=seed)
        for item in inspections:
            flt.update(item)
        rng = np.random.default_rng([25, seed])
        units = flt.drawn(_SAMPLES, rng)
        outlook = look_ahead(flt.process, units, future, rng, model_error=error, course=False)
        out.append(_assumed(name, outlook.remaining, level))
    return tuple(out)


def _assumed(name: str, lives: Floats, level: float) -> Assumed:
    ranked, tail = np.sort(lives), 0.5 * (1.0 - level)
    ends = (float(ranked[int(share * len(ranked))]) for share in (0.5, tail, 1.0 - tail))
    return Assumed(name, *(value if np.isfinite(value) else None for value in ends))
