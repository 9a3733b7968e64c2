"""Which faults no log of this test separates, as far as the model is to be believed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.answer import FaultPlace
from elevon.diagnose.engine.case import LogCase, joined, shift_of

if TYPE_CHECKING:
    from elevon.diagnose.engine.answer import Cause, Diagnosis
    from elevon.diagnose.engine.candidates import CandidateFault

ALIKE = 2.0  # deviations between two faults' shifts, the model's error among them
_POINTS = 101


def with_ambiguous(
    result: Diagnosis, cases: Sequence[LogCase], candidates: Sequence[CandidateFault]
) -> Diagnosis:
    """Return the answer with causes joined that stand within `ALIKE` of each other.

    What a fault does is known to the model's error only, so two faults are not separated where
    some severity of the one lies within that error of the other's shift.
    """
    _, covariance = joined(cases)
    errors = np.concatenate([case.errors for case in cases])
    out: list[Cause] = []
    covered: set[tuple[str, str]] = set()
    for cause in result.faults:
        if (cause.kind, cause.place) in covered:
            continue
        others = [
            other
            for other in _close(cause, cases, candidates, covariance, errors)
            if other.key not in result.best  # a second fault beside it is no name for it
        ]
        known = {(cause.kind, cause.place), *cause.ambiguous_with}
        more = [
            FaultPlace(other.kind, place)
            for other in others
            for place in (other.place, *other.same)
            if (other.kind, place) not in known
        ]
        joint = [c for c in result.faults if (c.kind, c.place) in more]
        covered |= {(c.kind, c.place) for c in joint}
        total = min(1.0, cause.probability + sum(c.probability for c in joint))
        names = (*cause.ambiguous_with, *more)
        out.append(_there(replace(cause, probability=total, ambiguous_with=names), candidates))
    return replace(result, faults=tuple(out))


def _there(cause: Cause, candidates: Sequence[CandidateFault]) -> Cause:
    """What is there or not has a severity of one."""
    if any(c.switched for c in candidates if (c.kind, c.place) == (cause.kind, cause.place)):
        return replace(cause, severity=1.0, interval=(1.0, 1.0))
    return cause


def _close(
    cause: Cause,
    cases: Sequence[LogCase],
    candidates: Sequence[CandidateFault],
    covariance: Floats,
    errors: Floats,
) -> list[CandidateFault]:
    """Candidates with a severity at which they shift the features as this cause does."""
    candidate = next(c for c in candidates if (c.kind, c.place) == (cause.kind, cause.place))
    moved = shift_of(cases, candidate.key, np.array([cause.severity]))[0]
    loose = (
        covariance + np.diag((errors * moved) ** 2) + candidate.error**2 * np.outer(moved, moved)
    )
    root = np.linalg.inv(np.linalg.cholesky(loose))
    out = []
    for other in candidates:
        if other.key == candidate.key:
            continue
        grid = np.linspace(other.low, other.high, _POINTS)
        grid = np.sort(np.concatenate((grid, 0.05 * grid)))
        apart = (shift_of(cases, other.key, grid) - moved) @ root.T
        if float(np.linalg.norm(apart, axis=1).min()) < ALIKE:
            out.append(other)
    return out
