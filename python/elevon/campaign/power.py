"""The power of a design: how likely an effect of a given size is to be seen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.campaign.grammar import Power
from elevon.errors import unknown


def power_rows(
    request: Power,
    coded: Floats,
    blocks: npt.NDArray[np.int64],
    names: Sequence[str],
    place: str,
) -> list[dict[str, object]]:
    """Return the power of each effect of interest.

    The model has a mean, the blocks, every factor and the interactions of interest; the effect is
    tested by Student's t, two-sided. Under the alternative t is noncentral with
    effect / (2 sd sqrt(v)), v the effect's diagonal entry of (X' X)^-1 (Montgomery, Design and
    Analysis of Experiments, ch. 3 and 10).

    Parameters
    ----------
    request : Power
        Size of the effect, spread, level, terms.
    coded : ndarray, shape (runs, factors)
        The design, -1 to +1.
    blocks : ndarray, shape (runs,)
        Block of each run.
    names : sequence of str
        The factors' letters.
    place : str
        Named in errors.

    Returns
    -------
    list of dict
        ``term``, ``power`` (None where it cannot be computed), ``df`` and ``note``.
    """
    terms = list(request.terms or names)
    interactions = [term for term in terms if term not in names]
    columns = {name: coded[:, k] for k, name in enumerate(names)}
    for term in interactions:
        columns[term] = _interaction(term, coded, names, place)
    head = [np.ones(len(coded)), *((blocks == b).astype(float) for b in np.unique(blocks)[1:])]
    matrix = np.column_stack([*head, *columns.values()])
    rank = int(np.linalg.matrix_rank(matrix))
    freedom = len(coded) - rank
    inverse = np.linalg.pinv(matrix.T @ matrix)
    places = {name: len(head) + k for k, name in enumerate(columns)}
    return [_row(request, term, places[term], matrix, inverse, freedom) for term in terms]


def _interaction(term: str, coded: Floats, names: Sequence[str], place: str) -> Floats:
    parts = term.split(":") if ":" in term else list(term)
    for part in parts:
        if part not in names:
            raise unknown("factor", part, names, place)
    product: Floats = coded[:, [list(names).index(part) for part in parts]].prod(axis=1)
    return product


def _row(  # noqa: PLR0917 - one line of a table, all of it needed
    request: Power, term: str, column: int, matrix: Floats, inverse: Floats, freedom: int
) -> dict[str, Any]:
    from scipy.stats import nct, t

    others = np.delete(matrix, column, axis=1)
    aliased = np.linalg.matrix_rank(others) == np.linalg.matrix_rank(matrix)
    if aliased or freedom < 1:
        note = "aliased with other terms" if aliased else "no degrees of freedom for the spread"
        return {"term": term, "power": None, "df": freedom, "note": note}
    error = request.sd * np.sqrt(inverse[column, column])
    shift = 0.5 * request.effect / error
    limit = t.ppf(1.0 - 0.5 * request.alpha, freedom)
    power = nct.sf(limit, freedom, shift) + nct.cdf(-limit, freedom, shift)
    return {"term": term, "power": float(power), "df": freedom, "note": ""}
