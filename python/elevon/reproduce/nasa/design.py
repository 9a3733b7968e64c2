"""Design of experiments: two-level factors, replicates in blocks, randomised order, effects.

A response is fitted by least squares: one offset a block, every factor at -1 or +1, every product
of two factors. The effect of a factor is the response's change from its low to its high level.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats

LEVEL = 0.95


@dataclass(frozen=True, slots=True)
class TwoLevelFactor:
    """A factor and its two levels, as shown."""

    name: str
    low: str
    high: str


@dataclass(frozen=True, slots=True)
class FactorEffect:
    """Change of a response from a factor's low to its high level (of a pair: their interaction).

    Attributes
    ----------
    term : str
        Factor, or two of them joined by " x ".
    effect, low, high : float
        In the response's unit, with the interval.
    p : float
        Probability of so large an effect without any, corrected over the response's terms (Holm).
    """

    term: str
    effect: float
    low: float
    high: float
    p: float


def shuffled_blocks(runs: int, blocks: int, seed: int) -> npt.NDArray[np.int64]:
    """Return the order of the runs of each block, shape (blocks, runs); every block has its own."""
    return np.array([np.random.default_rng([seed, b]).permutation(runs) for b in range(blocks)])


def terms(factors: Sequence[TwoLevelFactor]) -> list[tuple[int, ...]]:
    """Return the factors' indices of every term: one, then two at a time."""
    places = range(len(factors))
    return [*((i,) for i in places), *combinations(places, 2)]


def model_matrix(
    factors: Sequence[TwoLevelFactor], levels: Floats, block: npt.NDArray[np.int64]
) -> Floats:
    """Return the columns of the model: blocks, then the terms.

    Parameters
    ----------
    factors : sequence of TwoLevelFactor
        In the order of the levels.
    levels : ndarray, shape (runs, factors)
        -1 or +1.
    block : ndarray of int, shape (runs,)
        Block of each run, from 0.
    """
    offsets = np.eye(int(block.max()) + 1)[block]
    columns = [np.prod(levels[:, list(term)], axis=1) for term in terms(factors)]
    return np.column_stack([offsets, *columns])


def fit_effects(
    factors: Sequence[TwoLevelFactor],
    levels: Floats,
    block: npt.NDArray[np.int64],
    response: Floats,
) -> list[FactorEffect]:
    """Return the effect of every term with its interval.

    Parameters
    ----------
    factors, levels, block
        As for `model_matrix`.
    response : ndarray, shape (runs,)
        Any unit.
    """
    from scipy.stats import t as student

    matrix = model_matrix(factors, levels, block)
    names = [" x ".join(factors[i].name for i in term) for term in terms(factors)]
    first = matrix.shape[1] - len(names)
    weights, *_ = np.linalg.lstsq(matrix, response, rcond=None)
    free = response.size - matrix.shape[1]
    variance = float(np.sum((response - matrix @ weights) ** 2)) / free
    spread = np.sqrt(variance * np.diag(np.linalg.inv(matrix.T @ matrix)))[first:]
    # From -1 to +1 is twice the slope.
    effect, spread = 2.0 * weights[first:], 2.0 * spread
    half = float(student.ppf(0.5 + 0.5 * LEVEL, free)) * spread
    p = _holm(2.0 * student.sf(np.abs(effect) / np.maximum(spread, np.finfo(float).tiny), free))
    return [
        FactorEffect(name, float(e), float(e - h), float(e + h), float(q))
        for name, e, h, q in zip(names, effect, half, p, strict=True)
    ]


def _holm(p: Floats) -> Floats:
    """Holm's correction of several probabilities."""
    order = np.argsort(p)
    scaled = np.maximum.accumulate(p[order] * np.arange(p.size, 0, -1))
    corrected = np.empty_like(p)
    corrected[order] = np.minimum(scaled, 1.0)
    return corrected


def coverage(
    factors: Sequence[TwoLevelFactor],
    levels: Floats,
    block: npt.NDArray[np.int64],
    truth: Mapping[str, Any],
    *,
    campaigns: int = 400,
    seed: int = 0,
) -> tuple[float, float]:
    """Fit campaigns whose effects are known and count the intervals that hold them.

    Parameters
    ----------
    factors, levels, block
        The design, as for `model_matrix`.
    truth : mapping
        ``effects`` (one a term), ``block`` and ``scatter`` (standard deviations).
    campaigns, seed
        How many, and of the random numbers.

    Returns
    -------
    tuple of float
        Share of the intervals that hold their effect, and the mean error of the effects over
        their standard deviation.
    """
    rng = np.random.default_rng(seed)
    matrix = model_matrix(factors, levels, block)
    effects = np.asarray(truth["effects"], dtype=float)
    first = matrix.shape[1] - effects.size
    within, errors = [], []
    for _ in range(campaigns):
        offsets = truth["block"] * rng.standard_normal(first)
        scatter = truth["scatter"] * rng.standard_normal(block.size)
        response = matrix @ np.concatenate([offsets, 0.5 * effects]) + scatter
        fitted = fit_effects(factors, levels, block, response)
        within.append([f.low <= e <= f.high for f, e in zip(fitted, effects, strict=True)])
        errors.append([f.effect - e for f, e in zip(fitted, effects, strict=True)])
    error = np.array(errors)
    return float(np.mean(within)), float(np.abs(error.mean(axis=0) / error.std(axis=0)).max())
