"""Unscented Kalman filter over the same process, to compare with the particles.

Our own, after Julier and Uhlmann (2004): the process is vectorised over its sigma points, so that
the filter is some forty lines and needs no library.
"""

from __future__ import annotations

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.prognose.observation import Inspection
from elevon.prognose.process import Process, UnitPopulation

_ALPHA, _BETA, _KAPPA = 0.5, 2.0, 0.0


class UnscentedFilter:
    """Mean and covariance of damages and growth factors, 2k numbers.

    Every law counts as acting and as right in its form. Damages are kept at zero or above by
    moving sigma points to the border.

    Parameters
    ----------
    process : Process
        How units grow.

    Attributes
    ----------
    mean : ndarray, shape (2k,)
        Damages, then logarithms of the growth factors.
    covariance : ndarray, shape (2k, 2k)
    """

    def __init__(self, process: Process) -> None:
        laws = process.laws
        self.process = process
        self.usage = 0.0
        self.mean = np.array([law.start for law in laws] + [0.0] * len(laws))
        spread = [max(law.start_spread, 1e-3 * law.highest) for law in laws]
        self.covariance = np.diag(np.array(spread + [law.spread for law in laws]) ** 2)

    def update(self, item: Inspection) -> None:
        """Grow to an inspection and take in what it saw."""
        if item.reset:
            raise InputError("the unscented filter knows no maintenance; use the particles")
        self._grow(item.usage)
        for k, law in enumerate(self.process.laws):
            seen = item.seen.get(law.key)
            if seen is None:
                continue
            points, mean_weight, weight = _sigma(self.mean, self.covariance)
            severities = self.process.severity(np.maximum(points[:, : len(self.process.laws)], 0.0))
            at = severities[:, k]
            centre = float(mean_weight @ at)
            level = min(centre, 3.0 * seen.high) if seen.severity is None else seen.severity
            deviation = seen.low if level < centre else seen.high
            variance = float(weight @ (at - centre) ** 2) + deviation**2
            gain = ((points - self.mean).T * weight) @ (at - centre) / variance
            self.mean = self.mean + gain * (level - centre)
            self.covariance = _even(self.covariance - np.outer(gain, gain) * variance)

    def sampled(self, count: int, rng: np.random.Generator) -> UnitPopulation:
        """Draw units from the mean and the covariance, to look ahead with."""
        size = len(self.process.laws)
        rows = rng.multivariate_normal(self.mean, self.covariance, size=count, method="eigh")
        return self._population(rows[:, :size], rows[:, size:])

    def _population(self, damage: Floats, growth: Floats) -> UnitPopulation:
        return UnitPopulation.of(np.maximum(damage, 0.0), growth, usage=self.usage)

    def _grow(self, usage: float) -> None:
        if usage <= self.usage:
            return
        size = len(self.process.laws)
        points, mean_weight, weight = _sigma(self.mean, self.covariance)
        before = self._population(points[:, :size], points[:, size:])
        after = self.process.to(before, usage, None)
        grown = np.column_stack((after.damage, after.growth))
        self.mean = mean_weight @ grown
        residual = grown - self.mean
        added = mean_weight @ (after.damage - before.damage)
        grain = np.array([law.grain for law in self.process.laws])
        wander = self.process.drift**2 * np.log(usage / self.usage) if self.usage > 0.0 else 0.0
        noise = np.concatenate((np.maximum(added, 0.0) * grain, np.full(size, wander)))
        self.covariance = _even((residual.T * weight) @ residual + np.diag(noise))
        self.usage = usage


def _sigma(mean: Floats, covariance: Floats) -> tuple[Floats, Floats, Floats]:
    """Return sigma points (2d+1, d), their weights for the mean and for the covariance."""
    size = len(mean)
    spread = _ALPHA**2 * (size + _KAPPA)
    root = np.linalg.cholesky(spread * covariance)
    points = np.vstack((mean, mean + root.T, mean - root.T))
    weight = np.full(2 * size + 1, 0.5 / spread)
    weight[0] = 1.0 - size / spread
    of_covariance = weight.copy()
    of_covariance[0] += 1.0 - _ALPHA**2 + _BETA
    return points, weight, of_covariance


def _even(covariance: Floats) -> Floats:
    """Make a covariance symmetric and keep it positive against rounding."""
    even = 0.5 * (covariance + covariance.T)
    values, vectors = np.linalg.eigh(even)
    floor = 1e-12 * max(float(values[-1]), 1e-30)
    return np.asarray((vectors * np.maximum(values, floor)) @ vectors.T)
