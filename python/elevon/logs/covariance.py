"""Covariance of least-squares estimates when the residuals are coloured.

Residuals of a log are never white (friction, backlash, filters), and the textbook covariance then
claims far too much. Here the long-run covariance of the scores is estimated (Newey and West, 1987),
after a first-order pre-whitening (Andrews and Monahan, 1992) that keeps it honest for slow ones.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

__all__ = ["correlated", "long_run_covariance", "robust_covariance"]

FloatArray = npt.NDArray[np.float64]
_SLOWEST = 0.97  # bound on the fitted persistence, as Andrews and Monahan advise


def robust_covariance(jacobian: FloatArray, residual: FloatArray) -> FloatArray:
    """Return the covariance of least-squares estimates under autocorrelated residuals.

    Parameters
    ----------
    jacobian : ndarray, shape (n, p)
        Derivatives of the model by its parameters, rows in the order of time.
    residual : ndarray, shape (n,)
        Data less model.

    Returns
    -------
    ndarray, shape (p, p)
        Sandwich estimate; infinite where the data do not determine the parameters.
    """
    n, p = jacobian.shape
    if n <= p:
        return np.full((p, p), math.inf)
    scale = np.linalg.norm(jacobian, axis=0)
    if not np.all(scale > 0.0) or not np.all(np.isfinite(scale)):
        return np.full((p, p), math.inf)
    scaled = jacobian / scale
    normal = scaled.T @ scaled
    if np.linalg.cond(normal) > 1e14:
        return np.full((p, p), math.inf)
    bread = np.linalg.inv(normal)
    meat = long_run_covariance(scaled * residual[:, None]) * (n / (n - p))
    return np.asarray(bread @ meat @ bread / np.outer(scale, scale), dtype=np.float64)


def long_run_covariance(scores: FloatArray) -> FloatArray:
    """Return the sum over all lags of the autocovariance of scores.

    Parameters
    ----------
    scores : ndarray, shape (n, p)
        Residual times derivative, rows in the order of time.

    Returns
    -------
    ndarray, shape (p, p)
        Covariance of their sum.
    """
    rho = np.array([_persistence(column) for column in scores.T])
    white = scores[1:] - rho * scores[:-1]
    count = len(white)
    lags = _bandwidth(white)
    total = white.T @ white
    for lag in range(1, lags + 1):
        cross = white[lag:].T @ white[:-lag]
        total += (1.0 - lag / (lags + 1.0)) * (cross + cross.T)
    colour = 1.0 / (1.0 - rho)
    grown = total * np.outer(colour, colour) * (len(scores) / max(count, 1))
    return np.asarray(grown, dtype=np.float64)


def correlated(series: FloatArray) -> float:
    """Return how many samples of a series are worth one independent sample.

    Parameters
    ----------
    series : ndarray, shape (n,)
        In the order of time.

    Returns
    -------
    float
        The autocorrelation summed over both signs of the lag, up to where it first vanishes: what
        comes beyond is an oscillation's, which would only make the sum smaller, or noise. 1 for
        white noise.
    """
    centred = series - series.mean()
    power = float(centred @ centred)
    if power == 0.0:
        return 1.0
    size = 2 * len(centred)
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    at = np.fft.irfft(spectrum, size)[: len(centred)] / power
    end = int(np.argmax(at <= 0.0)) or len(at)
    return float(2.0 * np.sum(at[:end]) - 1.0)


def _persistence(series: FloatArray) -> float:
    power = float(series[:-1] @ series[:-1])
    if power == 0.0:
        return 0.0
    return float(np.clip(series[1:] @ series[:-1] / power, -_SLOWEST, _SLOWEST))


def _bandwidth(series: FloatArray) -> int:
    """Andrews' (1991) automatic bandwidth for the Bartlett kernel, from first-order fits."""
    weight = top = 0.0
    for column in series.T:
        rho = _persistence(column)
        power = float(column @ column) ** 2
        top += 4.0 * rho**2 * power / ((1.0 - rho) ** 2 * (1.0 + rho) ** 2) / (1.0 - rho) ** 4
        weight += power / (1.0 - rho) ** 4
    if weight == 0.0:
        return 0
    lags = 1.1447 * (top / weight * len(series)) ** (1.0 / 3.0)
    return int(min(math.ceil(lags), len(series) // 4))
