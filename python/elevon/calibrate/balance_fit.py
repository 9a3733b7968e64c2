"""Balances not linear in what is sought: robust Gauss and Newton, deviations from blocks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.blocks import stroke_blocks

__all__ = ["Balanced", "Sought", "fit_balance"]

_ROUNDS = 25
_STEP = 0.3  # of the first value, in one round
_SMALL = 1e-6  # of the first value, for differences
_LEAST = 0.02  # of the first value: none of what is sought changes its sign
_SOFT = 2.0  # deviations beyond which a residual weighs less


@dataclass(frozen=True)
class Sought:
    """What a balance seeks.

    Attributes
    ----------
    names : tuple of str
        Of the numbers.
    first : ndarray, shape (p,)
        First values, not zero.
    belief : ndarray, shape (p,)
        What is believed before the logs: a deviation as a share of `first`.
    signed : tuple of str
        Names that may change their sign.
    """

    names: tuple[str, ...]
    first: Floats
    belief: Floats
    signed: tuple[str, ...] = ()

    @property
    def least(self) -> Floats:
        """Smallest share of `first` of each number."""
        return np.array([-np.inf if name in self.signed else _LEAST for name in self.names])


@dataclass(frozen=True)
class Balanced:
    """The fit: shares of the first values, their covariance, degrees of freedom, residual's RMS."""

    x: Floats
    covariance: Floats
    degrees: float
    residual: float

    @property
    def std(self) -> Floats:
        """Deviations of the shares."""
        return np.sqrt(np.diag(self.covariance))


def fit_balance(
    sought: Sought,
    data: Floats,
    model: Callable[[Floats], Floats],
    times: Sequence[tuple[Floats, Floats, float]],
    *,
    scale: float,
) -> Balanced:
    """Fit ``model(values)`` to `data`.

    Parameters
    ----------
    sought : Sought
        Names, first values, beliefs.
    data : ndarray, shape (n,)
        What the balance must give.
    model : callable
        From the values of `sought.names`, shape (p,), to shape (n,).
    times : sequence of (ndarray, ndarray, float)
        Instants and speeds of each log's samples in their order, and its period.
    scale : float
        First deviation of the residual.
    """
    x = np.ones(len(sought.names))
    prior = np.diag(sought.belief**-2.0)
    for number in range(_ROUNDS):
        misfit = data - model(x * sought.first)
        if number > 2:
            scale = max(1.4826 * float(np.median(np.abs(misfit))), 1e-12)
        slope = _slope(sought, model, x)
        weight = 1.0 / np.maximum(1.0, np.abs(misfit) / (_SOFT * scale))
        heavy = slope * (weight / scale**2)[:, None]
        step = np.linalg.solve(heavy.T @ slope + prior, heavy.T @ misfit - prior @ (x - 1.0))
        x = np.maximum(x + np.clip(step, -_STEP, _STEP), sought.least)
        if number > 3 and np.max(np.abs(step)) < 1e-8:
            break
    misfit = data - model(x * sought.first)
    slope = _slope(sought, model, x)
    # Huber's score stands still for outliers: they carry no information.
    inner = slope[np.abs(misfit) <= _SOFT * scale]
    inverse = np.linalg.inv(inner.T @ inner / scale**2 + prior)
    clipped = np.clip(misfit, -_SOFT * scale, _SOFT * scale)
    total = _block_sums(slope * (clipped / scale**2)[:, None], misfit, times)
    degrees = float(max(len(total) - 3, 2))
    meat = total.T @ total * (len(total) / degrees) + prior
    return Balanced(x, inverse @ meat @ inverse, degrees, float(np.std(misfit)))


def _slope(sought: Sought, model: Callable[[Floats], Floats], x: Floats) -> Floats:
    """Derivatives by the shares, shape (n, p), by central differences."""
    columns = []
    for unit in np.eye(len(x)):
        up, down = (
            model((x + direction * _SMALL * unit) * sought.first) for direction in (1.0, -1.0)
        )
        columns.append((up - down) / (2.0 * _SMALL))
    return np.stack(columns, axis=1)


def _block_sums(
    score: Floats, misfit: Floats, times: Sequence[tuple[Floats, Floats, float]]
) -> Floats:
    rows, at = [], 0
    for time, speed, period in times:
        part = slice(at, at + len(time))
        at += len(time)
        block = stroke_blocks(time, speed, misfit[part], period)
        total = np.zeros((int(block.max()) + 1, score.shape[1]))
        np.add.at(total, block, score[part])
        rows.append(total[np.bincount(block, minlength=len(total)) > 0])
    return np.vstack(rows)
