"""Robust regressions over several logs, with deviations that hold for coloured residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.blocks import block_covariance, stroke_blocks

__all__ = ["Regression", "robust_cost", "robust_regression", "with_deviations"]

_HUBER = 1.345


@dataclass(frozen=True)
class Regression:
    """A regression's answer.

    Attributes
    ----------
    names : tuple of str
        Coefficients.
    value : ndarray, shape (p,)
        Their values, SI (per ampere of set-point or measured current, peak).
    covariance : ndarray, shape (p, p)
        For coloured residuals.
    degrees : float
        Degrees of freedom of the covariance.
    explained : float
        Share of the current's variance explained.
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


def with_deviations(
    names: tuple[str, ...],
    value: Floats,
    design: Floats,
    residual: Floats,
    weight: Floats,
    *,
    times: Sequence[tuple[Floats, Floats, float]],
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
    times : sequence of (ndarray, ndarray, float)
        Instants and speeds of each log's samples in their order, and its period.
    """
    scores, blocks, at = [], [], 0
    for time, speed, period in times:
        part = slice(at, at + len(time))
        at += len(time)
        if not len(time):
            continue
        clipped = residual[part] * weight[part]
        scores.append(design[part] * clipped[:, None])
        blocks.append(stroke_blocks(time, speed, clipped, period))
    # Huber's score stands still for outliers: they carry no information.
    inner = weight >= 1.0
    normal = design[inner].T @ design[inner]
    covariance, degrees = block_covariance(normal, scores, blocks)
    # Columns beyond the linear ones (the lag's) move nothing at the solution.
    linear = len(value) - int("lag" in names)
    data = residual + design[:, :linear] @ value[:linear]
    spread = float(np.sum((data - data.mean()) ** 2))
    explained = 1.0 - float(residual @ residual) / spread if spread > 0.0 else 0.0
    return Regression(names, value, covariance, degrees, explained, len(residual))


def robust_regression(design: Floats, data: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Robust regression: coefficients, residuals, weights, design."""
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0.0] = 1.0
    scaled = design / scale
    weight = np.ones(len(data))
    beta = np.zeros(design.shape[1])
    for _ in range(20):
        heavy = weight[:, None] * scaled
        fresh, *_ = np.linalg.lstsq(heavy.T @ scaled, heavy.T @ data, rcond=1e-12)
        residual = data - scaled @ fresh
        spread = 1.4826 * float(np.median(np.abs(residual))) or 1e-300
        weight = np.minimum(1.0, _HUBER * spread / np.maximum(np.abs(residual), 1e-300))
        done = np.abs(fresh - beta).max() <= 1e-7 * max(float(np.abs(fresh).max()), 1e-300)
        beta = fresh
        if done:
            break
    return beta / scale, data - scaled @ beta, weight, design


def robust_cost(residual: Floats) -> float:
    """Huber's cost at a fixed fraction of the spread: smooth in whatever moves the residual."""
    bound = _HUBER * 1.4826 * float(np.median(np.abs(residual)))
    size = np.abs(residual)
    inner = size <= bound
    return float(np.sum(np.where(inner, 0.5 * size**2, bound * (size - 0.5 * bound))))
