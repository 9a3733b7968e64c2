"""Runs of two fidelities at the same points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.analysis.response import CampaignResponse, VariedFactor, read_response
from elevon.arrays import Floats
from elevon.campaign import Dataset
from elevon.errors import InputError


@dataclass(frozen=True)
class Samples:
    """A response at points of the factors.

    Attributes
    ----------
    names : list of str
        Of the factors.
    points : ndarray, shape (n, factors)
        Coded: -1 and +1 are the bounds.
    values : ndarray, shape (n,)
        Of the response.
    bounds : ndarray, shape (factors, 2)
        SI.
    """

    names: list[str]
    points: Floats
    values: Floats
    bounds: Floats


@dataclass(frozen=True)
class Pairs:
    """Two fidelities at common points.

    Attributes
    ----------
    high, low : Samples
        Coded alike; `low` may have further points.
    partner : ndarray of int, shape (n of high,)
        The low sample of each high one.
    correlation : float
        Of the responses over the pairs.
    """

    high: Samples
    low: Samples
    partner: npt.NDArray[np.int64]
    correlation: float


def samples_of(response: CampaignResponse, bounds: Floats | None = None) -> Samples:
    """Return a response over its numeric factors, each point once (mean of its repeats)."""
    for factor in response.factors:
        if factor.levels and isinstance(factor.levels[0], str):
            raise InputError(f"{factor.name}: {factor.levels[0]!r} is no number to krige over")
    raw = np.column_stack([factor.values for factor in response.factors])
    limits = _bounds(response.factors) if bounds is None else bounds
    points, place = np.unique(raw, axis=0, return_inverse=True)
    place = place.reshape(-1)
    values = np.bincount(place, response.values) / np.bincount(place)
    coded = (2.0 * points - limits.sum(axis=1)) / (limits[:, 1] - limits[:, 0])
    return Samples([factor.name for factor in response.factors], coded, values, limits)


def pair(high: Dataset, low: Dataset, response: str) -> Pairs:
    """Pair the runs of two campaigns that stand at the same points.

    Raises
    ------
    InputError
        Other factors, or fewer than four points in common.
    """
    above, below = read_response(high, response), read_response(low, response)
    names = [factor.name for factor in above.factors]
    if names != [factor.name for factor in below.factors]:
        raise InputError(
            f"{low.folder}: varies {', '.join(f.name for f in below.factors)}, and {high.folder} "
            f"{', '.join(names)}: their runs cannot be paired"
        )
    bounds = _bounds(below.factors)
    limits = _bounds(above.factors)
    bounds = np.column_stack([np.minimum(bounds, limits)[:, 0], np.maximum(bounds, limits)[:, 1]])
    upper, lower = samples_of(above, bounds), samples_of(below, bounds)
    known = {row.tobytes(): index for index, row in enumerate(lower.points)}
    partner = np.array([known.get(row.tobytes(), -1) for row in upper.points], dtype=np.int64)
    common = int((partner >= 0).sum())
    if common < 4:
        raise InputError(
            f"{low.folder}: {common} of its points are points of {high.folder}; use one plan with "
            "fidelity = 'high' and 'low'"
        )
    both = partner >= 0
    correlation = float(np.corrcoef(upper.values[both], lower.values[partner[both]])[0, 1])
    return Pairs(upper, lower, partner, correlation)


def _bounds(factors: list[VariedFactor]) -> Floats:
    return np.array([[f.values.min(), f.values.max()] for f in factors])
