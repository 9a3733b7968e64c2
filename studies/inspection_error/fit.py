"""What inspections err by: alike in all units, alike within a unit, and from one to the next.

The error of inspection i of a unit, at a true severity s of level k, is normal:

    r_i = b_k + z_0 c_a + z_1 c_r s_i + e_i,  e_i ~ N(0, a^2 + (r s_i)^2),  z ~ N(0, 1) of the unit

b_k is the mean error of the level over all units (the diagnosing model's own); a, r, c_a and c_r
are those of greatest likelihood of what remains (a mixed model: Pinheiro and Bates 2000, 1.1, with
two independent effects of the unit; c is widened by what the units' own mean takes of it).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats

__all__ = ["Scatter", "fitted", "fitted_interval", "stated"]

Group = tuple[Floats, Floats]
"""True severities and errors of one unit's inspections, the errors less their level's mean."""

_LEAST = 1e-4  # of the largest error: a part below counts as none
_DRAWS = 40  # of the bootstrap


@dataclass(frozen=True)
class Scatter:
    """Deviations of an inspection's severity: shares of it, and in its unit.

    Attributes
    ----------
    relative, absolute : float
        From one inspection of a unit to the next.
    common_relative, common_absolute : float
        Of what all inspections of a unit err by alike.
    """

    relative: float
    absolute: float
    common_relative: float
    common_absolute: float

    def per_visit(self, severity: Floats) -> Floats:
        """Return the deviation from one inspection to the next."""
        return np.hypot(self.relative * severity, self.absolute)

    def common(self, severity: Floats) -> Floats:
        """Return the deviation of what is common to a unit."""
        return np.hypot(self.common_relative * severity, self.common_absolute)


def fitted(groups: Sequence[Group], counts: Floats | None = None) -> Scatter:
    """Return the likeliest deviations of units' inspections, less the levels' means.

    Parameters
    ----------
    groups : sequence of (ndarray, ndarray)
        Severities and errors, shape (n,), one pair a unit.
    counts : ndarray, shape (u,), optional
        How often each unit counts; default: once.
    """
    from scipy.optimize import minimize

    size = max(float(np.abs(r).max()) for _, r in groups)
    reach = max(float(s.max()) for s, _ in groups)
    scale = np.array([size / reach, size, size / reach, size])
    bounds = [(np.log(_LEAST), np.log(3.0))] * 4
    weights = np.ones(len(groups)) if counts is None else counts

    def surprise(x: Floats) -> float:
        return float(weights @ _surprise(np.exp(x) * scale, groups))

    starts = [np.log([0.3, 0.3, 0.3, 0.3]), np.log([0.5, 0.05, 0.3, 0.01])]
    if counts is not None:
        starts.pop()
    results = [
        minimize(surprise, start, bounds=bounds, options={"maxiter": 60}) for start in starts
    ]
    best = min(results, key=lambda item: float(item.fun))
    values = np.where(best.x <= bounds[0][0] + 1.0, 0.0, np.exp(best.x)) * scale
    values[2:] *= np.sqrt(len(groups) / max(len(groups) - 1, 1))
    return Scatter(*(float(v) for v in values))


def _surprise(values: Floats, groups: Sequence[Group]) -> Floats:
    """Return the negative logarithm of each unit's likelihood, but for a constant.

    A unit's covariance is diagonal but for two outer products, so that its determinant and inverse
    are those of a matrix of two rows (Woodbury).
    """
    relative, absolute, c_r, c_a = values
    s = np.concatenate([severity for severity, _ in groups])
    r = np.concatenate([error for _, error in groups])
    first = np.cumsum([0, *[len(error) for _, error in groups[:-1]]])
    v = (relative * s) ** 2 + absolute**2
    parts = np.array([np.log(v), r * r / v, 1.0 / v, s / v, s * s / v, r / v, s * r / v])
    log_variance, square, aa, ar, rr, ba, br = np.add.reduceat(parts, first, axis=1)
    aa, rr, ar, ba, br = 1.0 + c_a**2 * aa, 1.0 + c_r**2 * rr, c_a * c_r * ar, c_a * ba, c_r * br
    det = aa * rr - ar**2
    square = square - (rr * ba**2 - 2.0 * ar * ba * br + aa * br**2) / det
    return np.asarray(0.5 * (log_variance + np.log(det) + square))


def fitted_interval(groups: Sequence[Group], seed: int) -> tuple[Scatter, Scatter]:
    """Return the ends of 90 % of each deviation, over units drawn anew from these (bootstrap)."""
    rng = np.random.default_rng([seed, 105])
    drawn = rng.multinomial(len(groups), np.full(len(groups), 1.0 / len(groups)), size=_DRAWS)
    draws = [list(fitted(groups, counts.astype(float)).__dict__.values()) for counts in drawn]
    low, high = np.quantile(np.array(draws), [0.05, 0.95], axis=0)
    return Scatter(*map(float, low)), Scatter(*map(float, high))


def stated(estimates: Floats, deviation: Floats) -> tuple[float, float]:
    """Return share and absolute part of the deviations stated, hypot(share estimated, absolute).

    Least squares of their logarithms.
    """
    from scipy.optimize import minimize

    def misfit(x: Floats) -> float:
        share, absolute = np.exp(x)
        return float(np.sum(np.log(np.hypot(share * estimates, absolute) / deviation) ** 2))

    start = np.log([float(np.median(deviation / estimates)), float(deviation.min())])
    best = minimize(misfit, start, method="Nelder-Mead")
    share, absolute = np.exp(best.x)
    return float(share), float(absolute)
