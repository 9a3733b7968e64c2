"""Slopes of regressions over a log, and how well the log determines them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.roles.series import noise_deviation

_APART = 0.4  # of a regressor that those before it do not make up
_BLOCKS = 12  # of a log, whose residuals count as independent of each other


class Slope(NamedTuple):
    """One slope.

    Attributes
    ----------
    value : float
        By least squares.
    size : float
        What it would be if y were of this column alone.
    noise : float
        Its deviation by what of the residual changes from sample to sample.
    misfit : float
        Its deviation by the residual as it stands, correlated within blocks of the log: a column
        that moves little on a day leaves its slope to what the columns do not explain.
    """

    value: float
    size: float
    noise: float = 0.0
    misfit: float = 0.0


def slopes(y: Floats, columns: Mapping[str, Floats], *, doubted: bool = False) -> dict[str, Slope]:
    """Return slopes of y, shape (n,), by least squares; with their deviations where `doubted`.

    Columns count in their order: one that those before it nearly make up is left out, since its
    slope would be chance.
    """
    names: list[str] = []
    basis: list[Floats] = []
    for name, x in columns.items():
        residual = x - sum((q * float(q @ x) for q in basis), np.zeros(len(x)))
        size = float(np.linalg.norm(residual))
        if size > _APART * float(np.linalg.norm(x)):
            names.append(name)
            basis.append(residual / size)
    if not names or len(y) < 4 * (len(names) + 1):
        return {}
    design = np.column_stack([columns[n] for n in names])
    norms = np.sqrt(np.mean(design**2, axis=0))
    scaled = design / norms
    values = np.linalg.lstsq(scaled, y, rcond=None)[0]
    errors = _errors(scaled, y - scaled @ values) if doubted else np.zeros((len(names), 2))
    sizes = float(np.sqrt(np.mean(y**2))) / norms
    rows = np.column_stack([values / norms, sizes, errors / norms[:, None]]).tolist()
    return {name: Slope(*row) for name, row in zip(names, rows, strict=True)}


def _errors(design: Floats, residual: Floats) -> Floats:
    """Deviations of slopes by noise, and by residuals correlated within blocks, shape (k, 2).

    The second is the covariance of a regression with clustered residuals (Liang and Zeger, 1986).
    """
    inverse = np.linalg.pinv(design.T @ design)
    noise = noise_deviation(residual) * np.sqrt(np.maximum(np.diag(inverse), 0.0))
    blocks = np.array_split(np.arange(len(residual)), _BLOCKS)
    pulls = np.array([residual[b] @ design[b] for b in blocks]) @ inverse
    return np.column_stack([noise, np.sqrt(np.sum(pulls**2, axis=0))])
