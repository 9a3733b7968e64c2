"""What a log shows that no candidate moves, against baselines of the same test.

A fault that is no candidate is told from those that are by it: a late encoder looks like backlash
by the width of the two positions' difference, and not by its shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import compress

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.posterior import Posterior
from elevon.diagnose.engine.reading import Reading
from elevon.diagnose.engine.spread import DEGREES
from elevon.diagnose.engine.table import deviations, periodic_covariance

SHARE = 0.2  # of the false alarms: what no candidate moves. ASSUMED
_PERIODS = 0.01  # relative difference of two logs' sampling up to which noise compares
_WIDE = (10.0, 30.0, 100.0)  # deviations by which something else moves such a feature. ASSUMED
_STRAYED = 0.1  # probability that one strays. ASSUMED


@dataclass(frozen=True)
class Plausibility:
    """Features that no candidate moves, of a log and of the healthy unit.

    Attributes
    ----------
    names, units : tuple of str
        The features.
    values, mean, std : ndarray, shape (m,)
        Of the log; of the baselines; of their difference.
    degrees : float
        How well the deviations are known.
    baselines : ndarray, shape (n, m)
        Values of each baseline.
    """

    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    values: Floats = field(default_factory=lambda: np.zeros(0))
    mean: Floats = field(default_factory=lambda: np.zeros(0))
    std: Floats = field(default_factory=lambda: np.zeros(0))
    degrees: float = DEGREES
    baselines: Floats = field(default_factory=lambda: np.zeros((0, 0)))

    def without(self, left_out: Sequence[str]) -> Plausibility:
        """Return it without the features whose names begin with one of these."""
        keep = [not name.startswith(tuple(left_out)) for name in self.names]
        if all(keep):
            return self
        names = tuple(compress(self.names, keep))
        units = tuple(compress(self.units, keep))
        values = (self.values[keep], self.mean[keep], self.std[keep])
        return Plausibility(names, units, *values, self.degrees, self.baselines[:, keep])

    @property
    def score(self) -> Floats:
        """Deviations from the healthy unit, shape (m,)."""
        return np.asarray((self.values - self.mean) / self.std, dtype=np.float64)


def plausibility(item: Reading, baselines: Sequence[Reading]) -> Plausibility:
    """Hold a log against baselines of the same test; without one there is nothing to say."""
    period = item.log.period
    near = [b for b in baselines if abs(b.log.period / period - 1.0) <= _PERIODS]
    if not near:
        return Plausibility()
    seen = [b.plausible for b in near]
    names = [n for n in item.plausible.names if all(n in s.names for s in seen)]
    records = [item.plausible_table[n] for n in names]
    rows = np.array([s.only(names).values for s in seen]).reshape(len(near), len(names))
    mean, count = rows.mean(axis=0), len(near)
    variance = deviations(records, mean, "repeats") ** 2
    variance = variance + np.diag(periodic_covariance(item.periodic()[1], names))
    # The stated spread counts as so many runs, beside what the baselines scatter.
    scatter = np.sum((rows - mean) ** 2, axis=0) / variance
    scale = np.maximum((DEGREES + scatter) / (DEGREES + count - 1), 1.0)
    std = np.sqrt(variance * scale * (1.0 + 1.0 / count))
    units = tuple(record.unit for record in records)
    values = item.plausible.only(names).values
    return Plausibility(tuple(names), units, values, mean, std, DEGREES + count - 1, rows)


def chance_of_any(items: Sequence[Plausibility]) -> float:
    """Return how often one feature of a healthy unit deviates as much as the farthest here."""
    from scipy.stats import t as student

    score = np.concatenate([item.score for item in items])
    if not len(score):
        return 1.0
    degrees = min(item.degrees for item in items)
    once = 2.0 * float(student.sf(np.abs(score).max(), degrees))
    return min(1.0, len(score) * once)


def weigh_plausibility(
    result: Posterior, score: Floats, degrees: float, allowed: Floats, by_run: Floats
) -> Posterior:
    """Return the hypotheses with the weight of what no candidate is looked for by.

    Each leaves such features where they are, or they stray; something else moves any of them. Of
    the latter only those count that speak for it, at the price of their choice.

    Parameters
    ----------
    result : Posterior
        By the other features.
    score : ndarray, shape (m,)
        Deviations from the healthy unit.
    degrees : float
        How well these are known.
    allowed : ndarray, shape (h, m)
        By how much each hypothesis' features may stray, in deviations.
    by_run : ndarray, shape (h, m)
        The part of it that a model run shows.
    """
    from scipy.stats import norm
    from scipy.stats import t as student

    unmoved = student.logpdf(score, degrees)
    # Speaks for a cause that a model run shows to move them. A wide allowance is no evidence.
    logs = _strayed(score, degrees, allowed)
    most = logs[int(np.argmax(result.probabilities))]
    logs = np.minimum(logs, np.maximum(most, _strayed(score, degrees, by_run)))
    far = np.max([norm.logpdf(score, scale=wide) for wide in _WIDE], axis=0)
    gain = far - np.log(2.0 * len(score) * len(_WIDE)) - unmoved
    other = float(np.sum(unmoved) + np.sum(np.maximum(gain, 0.0)))
    weight = np.append(logs, other)
    before = np.log(np.maximum([*result.probabilities, result.other], 1e-300))
    after = np.exp(before + weight - np.max(before + weight))
    after /= after.sum()
    order = np.argsort(-after[:-1], kind="stable")
    return replace(
        result,
        hypotheses=tuple(result.hypotheses[k] for k in order),
        probabilities=tuple(float(after[k]) for k in order),
        other=float(after[-1]),
    )


def _strayed(score: Floats, degrees: float, wide: Floats) -> Floats:
    """Return the log likelihood of features that may stray by deviations, shape (h, m) to (h,)."""
    from scipy.stats import t as student

    each = np.log(_STRAYED) + student.logpdf(score, degrees, scale=np.hypot(1.0, wide))
    left = np.log1p(-_STRAYED) + student.logpdf(score, degrees)
    return np.asarray(np.logaddexp(left, each).sum(axis=1))
