"""What a healthy unit's features are in one test: the model's, moved and scaled by baselines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.engine.replay import Replay
from elevon.diagnose.engine.spread import LearnedSpread, StepVariance, normal, stated, variances
from elevon.diagnose.engine.table import Feature, FeatureVector, deviations

_FAR = 2.0  # deviations
_OTHER = 1000  # of the seed: draws of the offset's size are apart from the steps'
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Healthy:
    """A healthy unit in one test.

    Attributes
    ----------
    names : tuple of str
        The features.
    mean : ndarray, shape (k,)
        Expected.
    covariance : ndarray, shape (k, k)
        Of a new log, without the noise within it.
    degrees : float
        Of freedom of Student's distribution.
    baselines : int
        Healthy logs of the same test it stands on.
    scale : ndarray, shape (k,)
        Spread over the stated one: what baselines made of it.
    offset : ndarray, shape (k, k)
        The part of the covariance that is the same in all logs of the unit: what is not known of
        how far it deviates from the model.
    steps : StepVariance
        What is known of the spread's size.
    offsets : StepVariance
        The same of the offset's size, where it is no matter of the spread; without a common factor
        it has that of the spread.
    by_days : ndarray of bool, shape (k,)
        Where baselines leave of the offset their own scatter, as large as the spread is.
    """

    names: tuple[str, ...]
    mean: Floats
    covariance: Floats
    degrees: float
    baselines: int
    scale: Floats
    offset: Floats
    steps: StepVariance
    offsets: StepVariance
    by_days: Bools

    def drawn(self, count: int, noise: Floats, seed: int) -> Floats:
        """Draw a new log's deviations, shape (count, k), with what is not known of their sizes.

        Its noise, shape (k,), is of a size as little known as the spread is. Another seed gives
        other draws.
        """
        factor, common = self.steps.drawn(count, seed)
        step = self.covariance - self.offset
        step = step / np.outer(self.scale, self.scale) + np.diag(noise**2)
        out = _correlated(step, count, (seed, 3)) * np.sqrt(factor)
        factors, _ = self.offsets.drawn(count, _OTHER + seed)
        if not len(self.offsets.common):
            factors = factors * common
        size = np.sqrt(factors / self.offsets.value)
        size[:, self.by_days] = np.sqrt(factor[:, self.by_days]) / self.scale[self.by_days]
        out += _correlated(self.offset, count, (seed, 4)) * size
        return out


def _correlated(covariance: Floats, count: int, seed: tuple[int, ...]) -> Floats:
    """Draw of a normal distribution, shape (count, k)."""
    # The offset may be known to the last digit: what is left of it is no matrix to factor.
    values, ways = np.linalg.eigh(covariance)
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * ways.T
    return np.asarray(normal(count, len(values), seed) @ root)


@dataclass(frozen=True)
class Elsewhere:
    """A baseline of another test, and what the model shows there."""

    features: FeatureVector
    model: FeatureVector


def healthy(
    model: Replay,
    names: Sequence[str],
    baselines: Sequence[FeatureVector],
    elsewhere: Sequence[Elsewhere] = (),
    spread_known: LearnedSpread | None = None,
    *,
    by_data: bool = False,
) -> Healthy:
    """Join the model's spread with baselines.

    The offset of a unit from the model is Gaussian with each feature's mismatch; the mean of the
    baselines of the same test narrows it (or replaces it, where the model's mean is no prior),
    those of other tests narrow what is pooled. The spread's scale is that stated, worth `STATED`
    runs, times one that all features have in common (which baselines tell), or learnt, and the
    baselines' scatter. Where baselines deviate further from the model than was assumed, the
    assumption yields.

    By data the model counts for nothing: the mean is the baselines', the spread the least deviation
    of each feature, times what the baselines scatter. How far the model is off widens nothing.
    """
    at, count = model.places(names), len(baselines)
    records = [model.table[name] for name in names]
    mean, common_error = model.mean[at], np.zeros(len(at))
    if isinstance(model.common_error, np.ndarray):
        common_error = model.common_error[at]
    values = np.array([b.only(names).values for b in baselines]).reshape(count, len(at))
    level = values.mean(axis=0) if count else mean
    known = stated(len(names)) if spread_known is None else spread_known.of(names)
    spread = np.diag(deviations(records, level, "repeats") ** 2)
    if not by_data:
        spread = spread + model.spread[np.ix_(at, at)]
    off = np.diag(deviations(records, level, "mismatch") ** 2) + np.outer(
        common_error, common_error
    )
    steps, offsets = variances(known)
    shared = 0.0
    centre, noise, by_days = np.zeros(len(at)), np.zeros(len(at)), np.zeros(len(at), dtype=np.bool_)
    if count:
        residual = values - mean
        noise = np.array([b.only(names).std ** 2 for b in baselines]).mean(axis=0)
        centre = residual.mean(axis=0)
        stated_step = np.diag(spread) + noise
        scatter = np.sum((residual - centre) ** 2, axis=0) / stated_step
        shared = _shared(scatter / steps.value, count - 1)
        weight = max(1.0 - 2.0 * shared, 0.0)  # of one day, baselines tell nothing of days
        scatter *= weight / (1.0 - min(shared, 0.5))
        alone = centre**2 / (np.diag(off) + stated_step / count)
        steps, offsets = variances(known, scatter, weight * (count - 1), None if by_data else alone)
    scale = steps.value
    spread *= np.sqrt(np.outer(scale, scale))
    off *= np.sqrt(np.outer(offsets.value, offsets.value))
    left, moved = off, np.zeros(len(at))
    if count:
        of_mean = (spread + np.diag(noise)) * (shared + (1.0 - shared) / count)
        off = _yielding(off, of_mean, centre)
        gain = off @ np.linalg.inv(off + of_mean)
        left, moved = (of_mean, centre)
        if model.prior and not by_data:
            left, moved = off - gain @ off, gain @ centre
        by_days = (np.diag(of_mean) < np.diag(off)) | by_data
    for k, offset, std in _pooled(records, mean, elsewhere):
        gain = left[:, k] / (left[k, k] + spread[k, k] + std**2)
        moved = moved + gain * (offset - moved[k])
        left = left - np.outer(gain, left[k])
    left = 0.5 * (left + left.T)
    degrees = model.degrees + max(count - 1, 0)
    return Healthy(
        tuple(names), mean + moved, spread + left, degrees, count, np.sqrt(scale), left, steps,
        offsets, by_days,
    )  # fmt: skip


def _shared(ratio: Floats, free: int) -> float:
    """Return the share of a step's variance that baselines have in common.

    Nobody says whether they are of one day. Where they scatter less than days do, by all features,
    what is lacking is the same in all of them: then they are worth one.
    """
    return max(1.0 - float(np.mean(ratio)) / free, 0.0) if free else 0.0


def _yielding(off: Floats, of_mean: Floats, centre: Floats) -> Floats:
    """Return the prior of the offset, as wide as the baselines are off where it is too narrow."""
    expected = np.diag(off) + np.diag(of_mean)
    far = centre**2 > _FAR**2 * expected
    return np.asarray(off + np.diag(np.where(far, centre**2, 0.0)))


def _pooled(
    records: Sequence[Feature], mean: Floats, elsewhere: Sequence[Elsewhere]
) -> Iterator[tuple[int, float, float]]:
    """Yield what other tests say of a number's offset: its place, the offset, its deviation."""
    for k, record in enumerate(records):
        for other in elsewhere if record.pooled else ():
            offset = _offset_elsewhere(record.name, other)
            if offset is not None:
                size = abs(float(mean[k]))
                std = size * float(np.hypot(offset[1], record.pooled))
                yield k, offset[0] * float(mean[k]), std


def _offset_elsewhere(name: str, other: Elsewhere) -> tuple[float, float] | None:
    """Share by which a feature deviates from the model in another test, and its deviation."""
    if name not in other.features.names or name not in other.model.names:
        return None
    modelled = float(other.model.only([name]).values[0])
    if not modelled > 0.0:
        return None
    features = other.features.only([name])
    return float(features.values[0]) / modelled - 1.0, float(features.std[0]) / modelled
