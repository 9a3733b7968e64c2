"""What a healthy unit's features are in one test: the model's, moved and scaled by baselines."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.replay import Replay
from elevon.diagnose.positions.features import FeatureVector

_FAR = 2.0  # deviations
DEGREES = 10.0  # ASSUMED: worth of the stated spread, in runs

#: How far a calibrated reduced-order model may deviate from a healthy unit: share of the value, and
#: SI. ASSUMED, from logs of benches with another drive and friction law; baselines of the same test
#: replace it.
MISMATCH: Mapping[str, tuple[float, float]] = {
    "lost_motion": (0.03, 1e-4),
    "position_scale": (0.0, 1e-3),
    "dry_current": (0.10, 0.0),
    "viscous_current": (0.20, 0.0),
    "inertia_current": (0.05, 0.0),
    "brake_current": (0.03, 0.0),
    "current_order_1": (0.0, 0.006),
    "current_order_2": (0.0, 0.006),
    "current_shaft": (0.0, 0.005),
    "voltage_per_speed": (0.30, 0.0),  # beside little current it takes what the switches drop
    "voltage_per_current": (1.0, 10.0),
    "voltage_order_1": (0.0, 0.006),
    "voltage_order_2": (0.0, 0.006),
    "speed_gain": (0.30, 0.0),  # spikes of a derivative: 20 % apart for a drive with hysteresis
    "following_gain": (0.004, 0.0),
    "current_sideband": (0.0, 0.006),
    "voltage_sideband": (0.0, 0.006),
}
#: With a brake of unknown torque: many times the unit's own friction.
_BRAKE_UNKNOWN: Mapping[str, tuple[float, float]] = {
    "dry_current": (10.0, 0.0),
    "viscous_current": (10.0, 0.0),
}
#: Least deviation from run to run, beside what the draws of the model show: another start, counts,
#: clocks, what the model has not. ASSUMED.
FLOOR: Mapping[str, tuple[float, float]] = {
    "lost_motion": (0.01, 2e-5),
    "position_scale": (0.0, 2e-4),
    "dry_current": (0.01, 0.0),
    "viscous_current": (0.05, 0.0),
    "inertia_current": (0.01, 0.0),
    "brake_current": (0.01, 0.0),
    "current_order_1": (0.0, 0.003),
    "current_order_2": (0.0, 0.003),
    "current_shaft": (0.0, 0.002),
    "voltage_per_speed": (0.005, 0.0),
    "voltage_per_current": (0.05, 0.0),
    "voltage_order_1": (0.0, 0.002),
    "voltage_order_2": (0.0, 0.002),
    "speed_gain": (0.02, 0.0),
    "following_gain": (0.0005, 0.0),
    "current_sideband": (0.0, 0.003),
    "voltage_sideband": (0.0, 0.002),
}


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
    offset : ndarray, shape (k, k), or None
        The part of the covariance that is the same in all logs of the unit: what is not known of
        how far it deviates from the model.
    """

    names: tuple[str, ...]
    mean: Floats
    covariance: Floats
    degrees: float
    baselines: int
    scale: Floats
    offset: Floats | None = None


#: Features that deviate from the model by one share in all tests of a unit, and the deviation of
#: that share between tests. ASSUMED: one friction law acts in all of them, at other speeds.
POOLED: Mapping[str, float] = {"dry_current": 0.04}


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
    *,
    brake_unknown: bool = False,
) -> Healthy:
    """Join the model's spread with baselines.

    The offset of a unit from the model is Gaussian with `MISMATCH`; the mean of the baselines of
    the same test narrows it, those of other tests narrow what is `POOLED`. The spread's scale is
    that stated, worth `DEGREES` runs, and the baselines' scatter. Where baselines deviate
    further from the model than was assumed, the assumption yields. Under a brake of unknown torque
    (`brake_unknown`) the model gives nothing of friction.
    """
    at = [model.healthy.names.index(name) for name in names]
    draws = model.draws[:, at]
    mean = draws.mean(axis=0)
    spread = np.cov(draws.T).reshape(len(at), len(at)) + np.diag(_sizes(FLOOR, names, mean) ** 2)
    table = {**MISMATCH, **_BRAKE_UNKNOWN} if brake_unknown else MISMATCH
    off = np.diag(_sizes(table, names, mean) ** 2)
    count = len(baselines)
    scale = np.ones(len(at))
    left, moved = off, np.zeros(len(at))
    if count:
        residual = np.array([b.only(names).values for b in baselines]) - mean
        noise = np.array([b.only(names).std ** 2 for b in baselines]).mean(axis=0)
        centre = residual.mean(axis=0)
        scatter = np.sum((residual - centre) ** 2, axis=0) / (np.diag(spread) + noise)
        scale = (DEGREES + scatter) / (DEGREES + count - 1)
        spread *= np.sqrt(np.outer(scale, scale))
        off = _yielding(off, spread + np.diag(noise), centre, count)
        gain = off @ np.linalg.inv(off + (spread + np.diag(noise)) / count)
        left, moved = off - gain @ off, gain @ centre
    for k, offset, std in _pooled(names, mean, () if brake_unknown else elsewhere):
        gain = left[:, k] / (left[k, k] + spread[k, k] + std**2)
        moved = moved + gain * (offset - moved[k])
        left = left - np.outer(gain, left[k])
    return Healthy(
        tuple(names),
        mean + moved,
        spread + 0.5 * (left + left.T),
        DEGREES + max(count - 1, 0),
        count,
        np.sqrt(scale),
        0.5 * (left + left.T),
    )


def _yielding(off: Floats, spread: Floats, centre: Floats, count: int) -> Floats:
    """Return the prior of the offset, as wide as the baselines are off where it is too narrow."""
    expected = np.diag(off) + np.diag(spread) / count
    far = centre**2 > _FAR**2 * expected
    return np.asarray(off + np.diag(np.where(far, centre**2, 0.0)))


def _pooled(
    names: Sequence[str], mean: Floats, elsewhere: Sequence[Elsewhere]
) -> Iterator[tuple[int, float, float]]:
    """Yield what other tests say of a number's offset: its place, the offset, its deviation."""
    for name, between in POOLED.items():
        for other in elsewhere:
            offset = _offset_elsewhere(name, other) if name in names else None
            if offset is not None:
                k = list(names).index(name)
                size = abs(float(mean[k]))
                yield k, offset[0] * float(mean[k]), size * float(np.hypot(offset[1], between))


def _offset_elsewhere(name: str, other: Elsewhere) -> tuple[float, float] | None:
    """Share by which a feature deviates from the model in another test, and its deviation."""
    if name not in other.features.names or name not in other.model.names:
        return None
    modelled = float(other.model.only([name]).values[0])
    if not modelled > 0.0:
        return None
    features = other.features.only([name])
    return float(features.values[0]) / modelled - 1.0, float(features.std[0]) / modelled


def _sizes(table: Mapping[str, tuple[float, float]], names: Sequence[str], mean: Floats) -> Floats:
    parts = [(table[n][0] * abs(float(m)), table[n][1]) for n, m in zip(names, mean, strict=True)]
    return np.array([float(np.hypot(*part)) for part in parts])
