"""Main effects and two-factor interactions of a design; which cannot be separated."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats

#: Columns whose correlation differs from 0 or 1 by less than this are not, or wholly, aliased.
_EQUAL = 1e-9


@dataclass
class TermColumn:
    """One term of the model.

    Attributes
    ----------
    factors : tuple of int
        One, or two of an interaction.
    values : ndarray, shape (runs,)
        Coded -1 to +1.
    aliases : list
        Terms that have the same column, each with its sign.
    """

    factors: tuple[int, ...]
    values: Floats
    aliases: list[tuple[tuple[int, ...], float]] = field(default_factory=list)


def blocks_matrix(block: npt.NDArray[np.int64]) -> Floats:
    """Return the mean and the blocks as orthonormal columns."""
    indicators = (block[:, None] == np.unique(block)[None, :]).astype(np.float64)
    matrix: Floats = indicators / np.sqrt(indicators.sum(axis=0))
    return matrix


def separate(
    coded: Sequence[Floats], head: Floats
) -> tuple[list[TermColumn], list[tuple[int, ...]], list[tuple[int, ...]]]:
    """Return the terms that can be estimated together.

    Parameters
    ----------
    coded : sequence of ndarray, shape (runs,)
        The factors.
    head : ndarray, shape (runs, blocks)
        Orthonormal: the mean and the blocks.

    Returns
    -------
    terms : list of Column
        Each with the terms it is aliased with.
    blocked : list of tuple
        Terms that are confounded with the blocks.
    partial : list of tuple
        Interactions that are left out: partly aliased with terms, too many to estimate together.
    """
    names = [(k,) for k in range(len(coded))]
    pairs = list(itertools.combinations(range(len(coded)), 2))
    terms: list[TermColumn] = []
    blocked: list[tuple[int, ...]] = []
    partial: list[tuple[int, ...]] = []
    for name in [*names, *pairs]:
        values = np.prod([coded[k] for k in name], axis=0)
        residual = values - head @ (head.T @ values)
        if np.linalg.norm(residual) < 1e-6 * np.linalg.norm(values):
            blocked.append(name)
        elif (same := _same(residual, terms, head)) is not None:
            same[0].aliases.append((name, same[1]))
        else:
            terms.append(TermColumn(name, values))
    whole = np.column_stack([head, *(term.values for term in terms)])
    if np.linalg.matrix_rank(whole) < whole.shape[1]:
        partial = [term.factors for term in terms if len(term.factors) > 1]
        terms = [term for term in terms if len(term.factors) == 1]
    return terms, blocked, partial


def _same(
    residual: Floats, terms: Sequence[TermColumn], head: Floats
) -> tuple[TermColumn, float] | None:
    for term in terms:
        other = term.values - head @ (head.T @ term.values)
        cosine = float(residual @ other / (np.linalg.norm(residual) * np.linalg.norm(other)))
        if abs(abs(cosine) - 1.0) < _EQUAL:
            return term, float(np.sign(cosine))
    return None


def further_contrasts(fitted: Floats, coded: Sequence[Floats]) -> list[Floats]:
    """Return contrasts that the model leaves: interactions of more factors, then any others.

    Parameters
    ----------
    fitted : ndarray, shape (runs, p)
        The model: mean, blocks, terms.
    coded : sequence of ndarray, shape (runs,)
        The factors.

    Returns
    -------
    list of ndarray, shape (runs,)
        Orthogonal to the model and to each other, of length sqrt(runs).
    """
    basis, _ = np.linalg.qr(fitted)
    further: list[Floats] = []
    orders = range(3, len(coded) + 1)
    words = itertools.chain.from_iterable(
        itertools.combinations(range(len(coded)), order) for order in orders
    )
    columns = (np.prod([coded[k] for k in word], axis=0) for word in words)
    unit = iter(np.eye(len(fitted)))
    for values in itertools.chain(columns, unit):
        if basis.shape[1] == len(fitted):
            break
        residual = values - basis @ (basis.T @ values)
        residual -= basis @ (basis.T @ residual)
        if (length := np.linalg.norm(residual)) > 1e-6 * np.linalg.norm(values):
            basis = np.column_stack([basis, residual / length])
            further.append(residual / length * np.sqrt(len(fitted)))
    return further
