"""Methods that know no law: what a prediction by laws must not fall behind.

Each takes what inspections have seen so far and the limit, and draws remaining lives.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from elevon.arrays import Floats

Rng = np.random.Generator
#: Use, severity and deviation of inspections that saw the fault, shape (n, 3).
Rows = Floats
_COUNT = 400
_DIFFUSIONS = (0.01, 0.02, 0.05, 0.1, 0.2)  # deviation of the path over a life, of the limit
_WANDERS = (0.0, 0.3, 1.0)  # deviation of the drift over a life, of its mean
_FAR = 1e3  # lives: no end in sight


def wiener(rows: Rows, limit: float, expected: float, rng: Rng) -> Floats:
    """Return remaining lives by a Wiener process with drift, tracked by a Kalman filter.

    Diffusion and wander of the drift are the likeliest of `_DIFFUSIONS` and `_WANDERS`; the end is
    the inverse Gaussian's.
    """
    fits = [
        (_tracked(rows, limit, expected, share, wander), share)
        for share in _DIFFUSIONS
        for wander in _WANDERS
    ]
    (_, mean, cov), share = max(fits, key=lambda fit: fit[0][0])
    level, drift = rng.multivariate_normal(mean, cov, size=_COUNT, method="eigh").T
    left = np.maximum(limit - level, 1e-6 * limit)
    diffusion = share * limit / np.sqrt(expected)
    mean_end = left / np.maximum(drift, limit / (_FAR * expected))
    ends = rng.wald(np.minimum(mean_end, _FAR * expected), (left / diffusion) ** 2)
    return np.asarray(np.where(level >= limit, 0.0, ends))


def _tracked(
    rows: Rows, limit: float, expected: float, share: float, wander: float
) -> tuple[float, Floats, Floats]:
    """Return log likelihood, mean and covariance of level and drift after the last inspection."""
    slope = limit / expected
    mean = np.array([0.0, slope])
    cov = np.diag([(0.1 * limit) ** 2, (3.0 * slope) ** 2])
    score, before = 0.0, 0.0
    for usage, value, deviation in rows:
        step = np.array([[1.0, usage - before], [0.0, 1.0]])
        mean, cov, before = step @ mean, step @ cov @ step.T, usage
        cov[1, 1] += (wander * slope) ** 2 * step[0, 1] / expected
        cov[0, 0] += (share * limit) ** 2 * step[0, 1] / expected
        variance = cov[0, 0] + deviation**2
        off = value - mean[0]
        score -= 0.5 * (np.log(variance) + off**2 / variance)
        gain = cov[:, 0] / variance
        mean = mean + gain * off
        cov = cov - np.outer(gain, cov[0])
    return score, mean, cov


def _fitted(x: Floats, y: Floats, weight: Floats, rng: Rng) -> tuple[Floats, Floats]:
    """Return draws of intercept and slope of a weighted line, by the scatter about it."""
    basis = np.column_stack((np.ones(len(x)), x)) * weight[:, None]
    inverse = np.linalg.pinv(basis.T @ basis)
    best = inverse @ basis.T @ (y * weight)
    freedom = max(len(x) - 2, 1)
    scale = max(float(np.sum((y * weight - basis @ best) ** 2)) / freedom, 1.0)
    a, b = rng.multivariate_normal(best, scale * inverse, size=_COUNT, method="svd").T
    return a, b


def _ends(left: Floats, slope: Floats, expected: float, usage: float) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        at = np.where(slope > 0.0, left / slope, np.inf)
    return np.asarray(np.clip(at - usage, 0.0, _FAR * expected))


def line(rows: Rows, limit: float, expected: float, rng: Rng) -> Floats:
    """Return remaining lives by a straight line of least squares."""
    if len(rows) < 2:
        return wiener(rows, limit, expected, rng)
    usage, value, deviation = rows.T
    a, b = _fitted(usage, value, 1.0 / deviation, rng)
    return _ends(limit - a, b, expected, usage[-1])


def exponential(rows: Rows, limit: float, expected: float, rng: Rng) -> Floats:
    """Return remaining lives by a straight line through the logarithms."""
    rows = rows[rows[:, 1] > 0.0]
    if len(rows) < 2:
        return wiener(rows, limit, expected, rng)
    usage, value, deviation = rows.T
    a, b = _fitted(usage, np.log(value), value / deviation, rng)
    return _ends(np.log(limit) - a, b, expected, usage[-1])


def power(rows: Rows, limit: float, expected: float, rng: Rng) -> Floats:
    """Return remaining lives by s = c u^b, b on either side of 1, on a grid of b and c."""
    if len(rows) < 2:
        return wiener(rows, limit, expected, rng)
    usage, value, deviation = rows.T
    exponents = np.linspace(0.3, 4.0, 75)
    lives = expected * np.exp(np.linspace(np.log(0.1), np.log(10.0), 161))
    b, life = (grid.ravel() for grid in np.meshgrid(exponents, lives))
    model = limit * (usage[:, None] / life) ** b
    misfit = np.sum(((value[:, None] - model) / deviation[:, None]) ** 2, axis=0)
    scale = max(float(misfit.min()) / max(len(rows) - 2, 1), 1.0)
    weight = np.exp(-0.5 * (misfit - misfit.min()) / scale)
    drawn = rng.choice(len(b), size=_COUNT, p=weight / weight.sum())
    return np.asarray(np.maximum(life[drawn] - usage[-1], 0.0))


BASELINES: dict[str, Callable[[Rows, float, float, Rng], Floats]] = {
    "Wiener, Kalman filter": wiener,
    "line, least squares": line,
    "exponential fit": exponential,
    "power law, two-sided": power,
}
"""Name to method: rows, limit, expected life and chance to remaining lives, shape (n,)."""
