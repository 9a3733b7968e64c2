"""Lives: units used until they fail, with their course on the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.prognose.future import crossing
from elevon.prognose.process import Process, UnitPopulation

_STEPS = 400  # a life, about
_MOST = 4000


@dataclass(frozen=True)
class Life:
    """One unit's life.

    Attributes
    ----------
    usage : ndarray, shape (s,)
        From 0 to the end of life.
    severity : ndarray, shape (s, k)
        Of each law's fault.
    end : float
        Use at the end of life.
    first : int
        Requirement that failed.
    """

    usage: Floats
    severity: Floats
    end: float
    first: int

    def at(self, usage: float) -> Floats:
        """Return the severities at a use, shape (k,)."""
        return np.array([np.interp(usage, self.usage, column) for column in self.severity.T])


def run_to_failure(process: Process, unit: UnitPopulation, rng: np.random.Generator) -> Life:
    """Use one unit until it fails.

    Parameters
    ----------
    process : Process
        How it grows, and what it must hold.
    unit : UnitPopulation
        One unit.
    rng : Generator
        Of chance.

    Raises
    ------
    InputError
        It does not fail within ten times its expected life.
    """
    if len(unit) != 1:
        raise InputError("a life is that of one unit")
    usage, severity = [unit.usage], [process.severity(unit.damage)[0]]
    before = process.response.reserve(process.severity(unit.damage))
    one = np.ones(1)
    for _ in range(_MOST):
        rate = process.rate(unit, unit.damage, one)[0]
        with np.errstate(divide="ignore"):
            step = float(np.min(process.range / (_STEPS * rate)))
        if not np.isfinite(step):
            break
        unit = process.advance(unit, step, rng)
        severities = process.severity(unit.damage)
        after = process.response.reserve(severities)
        usage.append(unit.usage)
        severity.append(severities[0])
        if after.min() < 0.0:
            return _ended(usage, severity, before, after)
        before = after
    raise InputError("the unit does not fail: no law brings it to a requirement's limit")


def _ended(usage: list[float], severity: list[Floats], before: Floats, after: Floats) -> Life:
    """Cut the last step where the first requirement fails."""
    share, first = crossing(before, after)
    end = usage[-2] + float(share[0]) * (usage[-1] - usage[-2])
    last = severity[-2] + share[0] * (severity[-1] - severity[-2])
    return Life(np.array([*usage[:-1], end]), np.array([*severity[:-1], last]), end, int(first[0]))
