"""Methods that know no law and no form: what a prediction must not fall behind.

Each takes what inspections have seen so far, relative to the limit and to the expected life, and
draws remaining lives.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from elevon.arrays import Floats

Rng = np.random.Generator
#: Use, severity and deviation of inspections that saw the fault, shape (n, 3).
Rows = Floats
COUNT = 400
_DIFFUSIONS = (0.01, 0.02, 0.05, 0.1, 0.2)  # deviation of the path over a life, of the limit
_WANDERS = (0.0, 0.3, 1.0)  # deviation of the drift over a life, of its mean
FAR = 100.0  # expected lives: no end is seen


def _tracked(
    rows: Rows, share: float, wander: float, *, gamma: bool
) -> tuple[float, Floats, Floats]:
    """Return log likelihood, mean and covariance of level and drift by a Kalman filter.

    The variance of the path is that of a Wiener process, or for `gamma` in proportion to growth.
    """
    mean, cov = np.array([0.0, 1.0]), np.diag([0.1**2, 3.0**2])
    score, before = 0.0, 0.0
    for usage, value, deviation in rows:
        time = usage - before
        step = np.array([[1.0, time], [0.0, 1.0]])
        mean, cov, before = step @ mean, step @ cov @ step.T, usage
        cov[1, 1] += wander**2 * time
        cov[0, 0] += share**2 * time * (max(mean[1], 0.01) if gamma else 1.0)
        variance = cov[0, 0] + deviation**2
        off = value - mean[0]
        score -= 0.5 * (np.log(variance) + off**2 / variance)
        gain = cov[:, 0] / variance
        mean = mean + gain * off
        cov = cov - np.outer(gain, cov[0])
    return score, mean, cov


def _best(rows: Rows, rng: Rng, *, gamma: bool) -> tuple[Floats, Floats, float]:
    """Return levels, drifts and diffusion of the likeliest diffusion and wander."""
    fits = [
        (_tracked(rows, share, wander, gamma=gamma), share)
        for share in _DIFFUSIONS
        for wander in _WANDERS
    ]
    (_, mean, cov), share = max(fits, key=lambda fit: fit[0][0])
    level, drift = rng.multivariate_normal(mean, cov, size=COUNT, method="eigh").T
    return level, np.maximum(drift, 1.0 / FAR), share


def wiener(rows: Rows, rng: Rng) -> Floats:
    """Return remaining lives by a Wiener process with drift; the end is the inverse Gaussian's."""
    level, drift, share = _best(rows, rng, gamma=False)
    left = np.maximum(1.0 - level, 1e-6)
    ends = rng.wald(np.minimum(left / drift, FAR), (left / share) ** 2)
    return np.asarray(np.where(level >= 1.0, 0.0, ends))


def gamma(rows: Rows, rng: Rng) -> Floats:
    """Return remaining lives by a gamma process with drift: growth that never heals."""
    level, drift, share = _best(rows, rng, gamma=True)
    left, grain = np.maximum(1.0 - level, 0.0), share**2
    step = left / 100.0
    steps = grain * rng.standard_gamma(np.tile((step / grain)[:, None], (1, 400)) + 1e-12)
    reached = np.cumsum(steps, axis=1) >= left[:, None]
    number = np.where(reached.any(axis=1), reached.argmax(axis=1) + 1, 400)
    return np.asarray(number * step / drift)


def line(rows: Rows, rng: Rng) -> Floats:
    """Return remaining lives by a straight line of least squares, with its scatter."""
    if len(rows) < 2:
        return wiener(rows, rng)
    usage, value, deviation = rows.T
    weight = 1.0 / deviation
    basis = np.column_stack((np.ones(len(usage)), usage)) * weight[:, None]
    inverse = np.linalg.pinv(basis.T @ basis)
    best = inverse @ basis.T @ (value * weight)
    freedom = max(len(rows) - 2, 1)
    scale = max(float(np.sum((value * weight - basis @ best) ** 2)) / freedom, 1.0)
    at, slope = rng.multivariate_normal(best, scale * inverse, size=COUNT, method="svd").T
    with np.errstate(divide="ignore", invalid="ignore"):
        end = np.where(slope > 0.0, (1.0 - at) / slope, np.inf)
    return np.asarray(np.clip(end - usage[-1], 0.0, FAR))


def particles(rows: Rows, rng: Rng) -> Floats:
    """Return remaining lives by a bootstrap particle filter without physics.

    Each particle has a level, the logarithm of its rate, an exponent by which the rate follows the
    level, and the size of its own wander.
    """
    count = 3000
    level = np.zeros(count)
    rate = 0.8 * rng.standard_normal(count)
    power = 0.7 * rng.standard_normal(count)
    wander = np.exp(rng.uniform(np.log(0.05), np.log(1.0), count))
    before = 0.0

    def grown(level: Floats, rate: Floats, time: Floats | float) -> tuple[Floats, Floats]:
        pace = np.exp(np.clip(rate + power * np.log((np.clip(level, 0.0, 2.0) + 0.1) / 0.6), -9, 5))
        move = pace * time
        level = level + move * np.exp(0.05 * rng.standard_normal(len(level)))
        return level, rate + wander * np.sqrt(np.minimum(time, 0.3)) * rng.standard_normal(count)

    for usage, value, deviation in rows:
        for _ in range(4):
            level, rate = grown(level, rate, (usage - before) / 4.0)
        before = usage
        off = (value - level) / deviation
        score = np.logaddexp(-0.5 * off**2, -8.0)
        weight = np.exp(score - score.max())
        weight /= weight.sum()
        index = np.searchsorted(np.cumsum(weight), (rng.random() + np.arange(count)) / count)
        index = np.minimum(index, count - 1)
        spread = 0.1 * np.sqrt(weight @ (power - weight @ power) ** 2) + 0.01
        level = np.maximum(level[index] + 0.3 * deviation * rng.standard_normal(count), 0.0)
        rate = rate[index] + 0.03 * rng.standard_normal(count)
        power = power[index] + spread * rng.standard_normal(count)
        wander = wander[index]
    end, now, step = np.full(count, FAR), 0.0, 0.01
    end[level >= 1.0] = 0.0
    while now < FAR and (end >= FAR).any():
        after, rate = grown(level, rate, step)
        crossed = (after >= 1.0) & (level < 1.0) & (end >= FAR)
        end[crossed] = now + step
        level, now = after, now + step
        step *= 1.03
    return end


BASELINES: dict[str, Callable[[Rows, Rng], Floats]] = {
    "Wiener process": wiener,
    "gamma process": gamma,
    "particle filter": particles,
    "line": line,
}
"""Name to method: rows and chance to remaining lives in expected lives, shape (n,)."""
