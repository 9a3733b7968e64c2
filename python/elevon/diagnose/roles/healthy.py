"""What a healthy unit's numbers are in one test: the model's, or its baselines'."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.healthy import DEGREES, Healthy
from elevon.diagnose.positions.features import FeatureVector
from elevon.diagnose.roles.numbers import KINDS, floors
from elevon.diagnose.roles.runs import RoleReplay

#: Of Student's distribution, nearly Gaussian. The least deviations are generous, so most numbers
#: stand closer than stated; with few degrees that would count as a day of small spread, and what
#: does vary would be called a fault.
_FREE = 200.0


def healthy_of(model: RoleReplay, names: Sequence[str], same: Sequence[FeatureVector]) -> Healthy:
    """Return the unit's expectation: the baselines' mean where there are any, else the model's.

    Two and more baselines also tell how far the stated spread holds: it is worth `DEGREES` of
    them.
    """
    at = [model.healthy.names.index(n) for n in names]
    mean = np.median(model.draws[:, at], axis=0)  # rare days are drawn more often than they are
    if same:
        mean = np.array([e.only(names).values for e in same]).mean(axis=0)
    least = floors(model.numbers, names, mean)
    spread = model.spread[np.ix_(at, at)] + np.diag(least**2)
    scale = _scale(spread, mean, [e.only(names).values for e in same])
    spread = spread * np.outer(scale, scale)
    if same:
        noise = np.array([e.only(names).std for e in same])
        more = (spread + np.diag(np.mean(noise**2, axis=0))) / len(same)
    else:
        # The stated stiffness is seldom measured: its compliance is uncertain by its own size. It
        # moves all numbers of a log at once, in proportion.
        more = np.diag((_mismatch(model, names) * least) ** 2) + np.outer(
            model.compliance[at], model.compliance[at]
        )
    return Healthy(tuple(names), mean, spread + more, _FREE, len(same), scale)


def _mismatch(model: RoleReplay, names: Sequence[str]) -> Floats:
    return np.array([KINDS[model.numbers.kinds[name]].mismatch for name in names])


def _scale(spread: Floats, mean: Floats, rows: Sequence[Floats]) -> Floats:
    """Spread over the stated one, number by number, by what several baselines scatter."""
    if len(rows) < 2:
        return np.ones(len(mean))
    square = np.sum((np.array(rows) - mean) ** 2, axis=0) / np.diag(spread)
    return np.asarray(np.sqrt((DEGREES + square) / (DEGREES + len(rows) - 1)), dtype=np.float64)
