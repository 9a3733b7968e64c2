"""Motion of a log through one smoothing kernel, and lags that pass everything alike.

The motor's encoder has 2^24 counts a turn: speed and acceleration taken from its angle are nearly
free of noise. Every signal of a regression goes through the same Gaussian, so that what the kernel
does to the left-hand side it does to the right-hand side too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from elevon.arrays import Bools, Floats
from elevon.logs.log import Log

_NOISE = 0.01  # of the acceleration's RMS that its noise may be
_WIDEST = 0.02  # s, deviation of the smoothing kernel at most
_REACH = 6.0  # deviations of the kernel kept
_SIGMAS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)  # samples: kernels tried, narrowest first


@dataclass(frozen=True)
class SmoothedMotion:
    """Speed and acceleration of one log, smoothed as its current is, and what may be used."""

    speed: Floats
    acceleration: Floats
    current: Floats
    sigma: float


def motion_of(log: Log) -> SmoothedMotion:
    """Speed, acceleration and current through one kernel and its derivatives."""
    sigma = kernel(log)
    return SmoothedMotion(*acceleration_of(log, sigma), smoothed(log.current, sigma), sigma)


def acceleration_of(log: Log, sigma: float) -> tuple[Floats, Floats]:
    """Smoothed speed and acceleration.

    Derivatives are those of the kernel: differences of neighbours would damp what is fast, at
    40 Hz already by 6 %, and the lag and the derivative time would take it up.
    """
    dt = log.period
    if not log.has("motor_position"):
        return smoothed(log.speed, sigma), smoothed(log.speed, sigma, 1) / dt
    return smoothed(log.motor, sigma, 1) / dt, smoothed(log.motor, sigma, 2) / dt**2


def kernel(log: Log) -> float:
    """Deviation in samples of a Gaussian that brings the acceleration's noise under its limit."""
    for sigma in _SIGMAS:
        acceleration = acceleration_of(log, sigma)[1]
        # Third differences of a smooth motion vanish: what is left is noise.
        jerk = np.diff(acceleration, 3)
        noise = 1.4826 * float(np.median(np.abs(jerk))) / np.sqrt(20.0)
        if noise < _NOISE * max(float(np.std(acceleration)), 1e-300):
            return sigma
        if (sigma + 1.0) * log.period > _WIDEST:
            return sigma
    return _SIGMAS[-1]


def smoothed(values: Floats, sigma: float, order: int = 0) -> Floats:
    """Pass values (n,) or columns (n, k), or their derivative a sample, through the Gaussian."""
    from scipy.ndimage import correlate1d

    # Taken off the mean: an angle of many turns would leave its rounding in the derivatives.
    level = values.mean(axis=0)
    fresh = correlate1d(values - level, _gaussian(sigma, order), axis=0, mode="nearest")
    return np.asarray(fresh if order else fresh + level, dtype=np.float64)


def _gaussian(sigma: float, order: int) -> Floats:
    """Sampled Gaussian, or its derivative, exact for polynomials of degree two.

    Sampling leaves the second derivative a sum of some 1e-7: enough to turn an angle of a hundred
    radians into an acceleration.
    """
    reach = round(_REACH * sigma)
    x = np.arange(-reach, reach + 1, dtype=np.float64)
    plain = np.exp(-0.5 * (x / sigma) ** 2)
    plain /= plain.sum()
    if order == 0:
        return plain
    if order == 1:
        return np.asarray(plain * x / np.sum(plain * x * x), dtype=np.float64)
    curved = plain * (x * x - sigma**2)
    curved -= plain * curved.sum()
    return np.asarray(2.0 * curved / np.sum(curved * x * x), dtype=np.float64)


def dilated(bad: Bools, period: float, reach: float) -> Bools:
    """Widen what is marked by a reach [s] to either side."""
    from scipy.ndimage import binary_dilation

    steps = max(1, round(reach / period))
    return np.asarray(binary_dilation(bad, iterations=steps), dtype=np.bool_)


def lagged(columns: Floats, lag: float, period: float) -> Floats:
    """Pass columns, shape (n, p), through a first-order lag.

    Exact for whatever the samples can tell: straight lines between them would damp it. A negative
    lag is a shift ahead: a current that comes before the motion it makes.
    """
    if abs(lag) < 1e-7:
        return columns
    if lag < 0.0:
        return delayed(columns, lag, period)
    folded = np.concatenate((columns, columns[::-1]))
    at = np.fft.rfftfreq(len(folded), period)
    passed = np.fft.rfft(folded, axis=0) / (1.0 + 2j * np.pi * at * lag)[:, None]
    return np.asarray(np.fft.irfft(passed, len(folded), axis=0)[: len(columns)], dtype=np.float64)


def delayed(columns: Floats, lag: float, period: float) -> Floats:
    """Shift columns, shape (n, p), later by a lag."""
    folded = np.concatenate((columns, columns[::-1]))
    at = np.fft.rfftfreq(len(folded), period)
    turned = np.fft.rfft(folded, axis=0) * np.exp(-2j * np.pi * at * lag)[:, None]
    return np.asarray(np.fft.irfft(turned, len(folded), axis=0)[: len(columns)], dtype=np.float64)
