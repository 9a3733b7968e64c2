"""Robust linear regression over several logs, with deviations that hold for coloured residuals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from elevon.arrays import Floats, Ints
from elevon.estimate.covariance import Strokes, block_covariance, numbered_strokes
from elevon.estimate.number import Estimate

_HUBER = 1.345  # deviations beyond which a residual weighs less: 95 % efficient without outliers
_ROUNDS = 20
_SPREAD = 1.4826  # deviation over median size, of a normal distribution


@dataclass(frozen=True)
class Regression:
    """A regression's answer.

    Attributes
    ----------
    names : tuple of str
        Coefficients.
    value : ndarray, shape (p,)
        Their values, SI.
    covariance : ndarray, shape (p, p)
        For coloured residuals.
    degrees : float
        Degrees of freedom of the covariance.
    explained : float
        Share of the data's variance explained.
    samples : int
        Samples used.
    """

    names: tuple[str, ...]
    value: Floats
    covariance: Floats
    degrees: float
    explained: float
    samples: int

    def __getitem__(self, name: str) -> float:
        return float(self.value[self.names.index(name)])

    def std(self, name: str) -> float:
        """Return the deviation of one coefficient."""
        k = self.names.index(name)
        return float(np.sqrt(max(self.covariance[k, k], 0.0)))

    def estimate(self, name: str) -> Estimate:
        """Return one coefficient with its deviation."""
        return Estimate(self[name], self.std(name), self.degrees)

    def open_to(self, others: Iterable[Floats]) -> Regression:
        """Return it with what other choices, which no log settles, make of the coefficients."""
        if not np.isfinite(self.covariance).all():
            return self
        gaps = [other - self.value for other in others]
        more = np.sum([np.outer(gap, gap) for gap in gaps], axis=0)
        return replace(self, covariance=self.covariance + more)

    def of(self, function: Callable[[Floats], float]) -> Estimate:
        """Return a function of the coefficients, its deviation to first order."""
        gradient = np.zeros(len(self.value))
        for k, step in enumerate(1e-3 * np.sqrt(np.maximum(np.diag(self.covariance), 0.0))):
            if step > 0.0:
                shift = step * np.eye(len(self.value))[k]
                up, down = function(self.value + shift), function(self.value - shift)
                gradient[k] = (up - down) / (2.0 * step)
        variance = float(gradient @ self.covariance @ gradient)
        return Estimate(float(function(self.value)), max(variance, 0.0) ** 0.5, self.degrees)


def huber(design: Floats, data: Floats) -> tuple[Floats, Floats, Floats]:
    """Huber's regression by reweighting; the spread is the residuals' own.

    Parameters
    ----------
    design : ndarray, shape (n, p)
        Columns; one that the others make up gets no weight of its own.
    data : ndarray, shape (n,)
        What is explained.

    Returns
    -------
    (ndarray, ndarray, ndarray)
        Coefficients (p,), residuals (n,), weights (n,) from 0 to 1.
    """
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0.0] = 1.0
    scaled = design / scale
    weight, beta = np.ones(len(data)), np.zeros(design.shape[1])
    for _ in range(_ROUNDS):
        heavy = weight[:, None] * scaled
        fresh, *_ = np.linalg.lstsq(heavy.T @ scaled, heavy.T @ data, rcond=1e-12)
        residual = data - scaled @ fresh
        bound = _HUBER * _SPREAD * (float(np.median(np.abs(residual))) or 1e-300)
        weight = np.minimum(1.0, bound / np.maximum(np.abs(residual), 1e-300))
        done = np.abs(fresh - beta).max() <= 1e-7 * max(float(np.abs(fresh).max()), 1e-300)
        beta = fresh
        if done:
            break
    return beta / scale, data - scaled @ beta, weight


def robust_cost(residual: Floats) -> float:
    """Huber's cost at a fixed fraction of the spread: smooth in whatever moves the residual."""
    bound = _HUBER * _SPREAD * float(np.median(np.abs(residual)))
    size = np.abs(residual)
    inner = size <= bound
    return float(np.sum(np.where(inner, 0.5 * size**2, bound * (size - 0.5 * bound))))


def regressed(
    names: tuple[str, ...],
    rows: Sequence[Floats],
    data: Sequence[Floats],
    strokes: Sequence[Strokes] | Ints,
    *,
    robust: bool = True,
) -> Regression:
    """Regress the data of several logs on their columns.

    Parameters
    ----------
    names : tuple of str
        Of the columns.
    rows, data : sequence of ndarray, shape (n, p) and (n,)
        One a log.
    strokes : sequence of (ndarray, ndarray, float), or ndarray of int, shape (n,)
        Instants and speeds of each log's samples in their order, and its period; or the blocks.
    robust : bool
        Whether outliers weigh less (Huber).
    """
    design, target = np.vstack(rows), np.concatenate(data)
    if robust:
        value, residual, weight = huber(design, target)
    else:
        scale = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
        value = np.asarray(np.linalg.lstsq(design / scale, target, rcond=None)[0] / scale)
        residual, weight = target - design @ value, np.ones(len(target))
    return with_deviations(names, value, design, residual, weight, strokes=strokes)


def with_deviations(
    names: tuple[str, ...],
    value: Floats,
    design: Floats,
    residual: Floats,
    weight: Floats,
    *,
    strokes: Sequence[Strokes] | Ints,
) -> Regression:
    """Give a robust regression its covariance, from the spread of its scores over strokes.

    Parameters
    ----------
    names : tuple of str
        Coefficients; ``lag``, if there, comes last and is no linear one.
    value : ndarray, shape (p,)
        Their values.
    design : ndarray, shape (n, p)
        Derivatives of the prediction.
    residual, weight : ndarray, shape (n,)
        Residuals and robust weights.
    strokes : sequence of (ndarray, ndarray, float)
        As `regressed`.
    """
    clipped = residual * weight
    # Huber's score stands still for outliers: they carry no information.
    inner = design[weight >= 1.0]
    blocks = strokes if isinstance(strokes, np.ndarray) else numbered_strokes(strokes, clipped)
    covariance, degrees = block_covariance(inner.T @ inner, design * clipped[:, None], blocks)
    # Columns beyond the linear ones (the lag's) move nothing at the solution.
    linear = len(value) - int("lag" in names)
    data = residual + design[:, :linear] @ value[:linear]
    spread = float(np.sum((data - data.mean()) ** 2))
    explained = 1.0 - float(residual @ residual) / spread if spread > 0.0 else 0.0
    return Regression(names, value, covariance, degrees, explained, len(residual))
