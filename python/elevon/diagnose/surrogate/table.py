"""What a surrogate learns from: the runs of a test, what was wrong in each and what it showed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats

#: Procedures of the bench that are learned; the first trace of each, with the unit's own backlash.
TESTS = ("backlash", "loaded")
HEALTHY_DAYS = 3
FAULTY_DAYS = 7
#: Severities at which a fault on its own is to be named, by test; SI. What units are judged at.
SINGLE_FAULTS: Mapping[str, Mapping[str, float]] = {
    test: {
        "backlash@transmission": math.radians(0.13),
        "friction@transmission": 0.25,
        "short@motor.phase_a": 0.10 if test == "loaded" else 0.20,
        "eccentricity_static@motor": 0.05 if test == "loaded" else 0.10,
        "gain_drift@control.position": 0.02,
    }
    for test in TESTS
}


@dataclass(frozen=True)
class TrainingTable:
    """What the runs of one test showed.

    Attributes
    ----------
    unit : ndarray of int, shape (n,)
        Number of the unit.
    baseline : ndarray of bool, shape (n,)
        The first `HEALTHY_DAYS` days of a unit, healthy all.
    severity : ndarray, shape (n, f)
        By `FAULTS`; zero where absent.
    values : ndarray, shape (n, k)
        By `NAMES`.
    about : ndarray, shape (n, 2)
        Travel and speed of `SurrogateFeatures`.
    """

    unit: npt.NDArray[np.int64]
    baseline: npt.NDArray[np.bool_]
    severity: Floats
    values: Floats
    about: Floats

    @staticmethod
    def joined(parts: Sequence[TrainingTable]) -> TrainingTable:
        """Stack tables."""
        names = ("unit", "baseline", "severity", "values", "about")
        return TrainingTable(*(np.concatenate([getattr(p, n) for p in parts]) for n in names))
