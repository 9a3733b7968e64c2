"""How many runs a plan asks for, by its numbers alone: checked before anything is built."""

from __future__ import annotations

import math
from typing import Any

from elevon.campaign.plan import Plan
from elevon.errors import InputError

#: Runs of a plan. ASSUMED: the table of ten million runs takes some 2 GB while a plan is resolved;
#: a larger experiment is split into several plans.
MOST_RUNS = 10_000_000
#: Axes of the product of all that varies: NumPy's arrays have 64 dimensions at most.
_MOST_AXES = 60
#: Kinds of a design whose points are all combinations of the factors' levels.
_ALL_LEVELS = {"full_factorial"}


def check_counts(plan: Plan, place: str) -> int:
    """Return an upper bound of the number of runs.

    Raises
    ------
    InputError
        More than `MOST_RUNS`, or one number alone is; it is named. More axes than arrays have.
    """
    if len(plan.vary) > _MOST_AXES:
        raise InputError(f"{place}: {len(plan.vary)} axes in 'vary'; the limit is {_MOST_AXES}")
    counts = dict(_counts(plan))
    total = math.prod(counts.values())
    if total > MOST_RUNS:
        listed = " x ".join(f"{count} {name}" for name, count in counts.items() if count > 1)
        raise InputError(f"{place}: {listed} = {total} runs; the limit is {MOST_RUNS}")
    return total


def _counts(plan: Plan) -> dict[str, int]:
    counts = {"seeds": max(len(plan.seeds), 1), "cases": max(len(plan.case or ()), 1)}
    if plan.population is not None:
        counts["units"] = plan.population.units
        counts["ages"] = len(plan.population.ages or ()) or plan.population.points or 1
    for k, axis in enumerate(plan.vary):
        counts[f"values of vary[{k}]"] = len(axis.values or ()) or axis.count or 1
    if plan.random is not None:
        counts["random draws"] = max(plan.random.count, 1)
    if plan.design is not None:
        counts["points of the design"] = _points(plan.design)
    return counts


def _points(design: Any) -> int:
    """Return an upper bound of a design's points, replicates and centre points among them."""
    if design.kind in _ALL_LEVELS:
        points = math.prod(_levels(factor) for factor in design.factor)
    else:
        points = design.runs or design.count or 1
    return int(points * design.replicates + design.centre * design.blocks)


def _levels(factor: Any) -> int:
    return len(factor.values or ()) or 2
