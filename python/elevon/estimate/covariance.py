"""Covariance of estimates whose residuals are correlated.

Residuals of a log are coloured (friction, backlash, filters) and partly systematic (the model is
not the bench); the textbook's covariance then claims far too much. Samples are therefore counted in
blocks longer than the residual remembers: the scores of a block are summed over all signals, and
the spread of these sums is what a repetition of the experiment would show (cluster-robust sandwich,
with the finite-number correction). Where one record has no strokes to cut at, the long-run
covariance of the scores does the same (Newey and West, 1987), after a first-order pre-whitening
(Andrews and Monahan, 1992) that keeps it honest for slow ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from elevon.arrays import Floats, Ints

#: Instants and speeds of one log's samples in their order, and the log's period.
Strokes = tuple[Floats, Floats, float]
_SHORTEST = 0.25  # s
_MEMORY = 4.0  # correlation times a block is at least
_FEWEST = 8  # blocks a log
_SLOWEST = 0.97  # bound on the fitted persistence, as Andrews and Monahan advise
_SINGULAR = 1e12  # condition from which a parameter is not determined


def memory(residual: Floats) -> float:
    """Samples of a coloured residual, shape (n,), that count as one."""
    at = _autocorrelation(residual)
    if at is None:
        return 1.0
    at = at[: len(at) // 4]
    below = np.flatnonzero(at < 0.05)
    last = int(below[0]) if below.size else len(at)
    return 1.0 + 2.0 * float(np.sum(at[1:last]))


def correlated(series: Floats) -> float:
    """Return how many samples of a series, shape (n,), are worth one independent sample.

    The autocorrelation summed over both signs of the lag, up to where it first vanishes: what comes
    beyond is an oscillation's, which would only make the sum smaller, or noise. 1 for white noise.
    """
    at = _autocorrelation(series)
    if at is None:
        return 1.0
    end = int(np.argmax(at <= 0.0)) or len(at)
    return float(2.0 * np.sum(at[:end]) - 1.0)


def _autocorrelation(series: Floats) -> Floats | None:
    """Autocorrelation by lag, shape (n,); None of what does not vary."""
    centred = series - series.mean()
    power = float(centred @ centred)
    if power == 0.0:
        return None
    size = 1 << (2 * len(centred) - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    return np.asarray(np.fft.irfft(spectrum, size)[: len(centred)] / power)


def block_length(residual: Floats, period: float) -> float:
    """Length of a block [s]: several correlation times of a residual, shape (n,)."""
    time = 0.5 * period * memory(residual)
    longest = period * len(residual) / _FEWEST
    return float(min(max(_SHORTEST, _MEMORY * time), longest))


def stroke_blocks(time: Floats, speed: Floats, residual: Floats, period: float) -> Ints:
    """Number the blocks of samples, shape (n,): whole strokes from one reversal to the next.

    What the model lacks repeats itself within a stroke, so a stroke is the least that counts as
    one observation. Short strokes are put together until the residual's memory fits in; long ones
    are cut so that a log has at least eight blocks.
    """
    shortest = block_length(residual, period)
    longest = max(period * len(time) / _FEWEST, shortest)
    turns = np.concatenate(([True], np.sign(speed[1:]) != np.sign(speed[:-1])))
    number, begin = 0, float(time[0])
    out = np.empty(len(time), dtype=np.int64)
    for k, (instant, turn) in enumerate(zip(time.tolist(), turns.tolist(), strict=True)):
        age = instant - begin
        if (turn and age >= shortest) or age >= longest:
            number, begin = number + 1, instant
        out[k] = number
    return out


def numbered_strokes(strokes: Iterable[Strokes], residual: Floats) -> Ints:
    """Number the strokes of logs whose samples follow each other in `residual`, shape (n,)."""
    parts, at = [], 0
    for time, speed, period in strokes:
        part = slice(at, at + len(time))
        at += len(time)
        if len(time):
            parts.append(stroke_blocks(time, speed, residual[part], period))
    return joined(parts)


def joined(blocks: Sequence[Ints]) -> Ints:
    """Return the blocks of several logs in one row, no number used twice."""
    out, first = [], 0
    for block in blocks:
        out.append(block - block.min() + first)
        first = int(out[-1].max()) + 1
    return np.concatenate(out) if out else np.empty(0, dtype=np.int64)


def block_sums(scores: Floats, blocks: Ints) -> Floats:
    """Sum scores, shape (n, p), over their blocks, shape (n,); empty blocks are left out."""
    total = np.zeros((int(blocks.max()) + 1, scores.shape[1]))
    np.add.at(total, blocks, scores)
    return np.asarray(total[np.bincount(blocks, minlength=len(total)) > 0])


def block_covariance(
    normal: Floats,
    scores: Floats,
    blocks: Ints,
    *,
    prior: Floats | None = None,
    counted: int | None = None,
) -> tuple[Floats, float]:
    """Return covariance, shape (p, p), and its degrees of freedom.

    Parameters
    ----------
    normal : ndarray, shape (p, p)
        Sum over all samples of weight times outer product of the derivatives.
    scores : ndarray, shape (n, p)
        Derivative times weighted residual, summed over the signals of a sample.
    blocks : ndarray of int, shape (n,)
        Number of the block that each sample is in.
    prior : ndarray, shape (p, p), optional
        Information that was there before the data.
    counted : int, optional
        Numbers that the data alone determine: taken off the blocks; default p.

    Returns
    -------
    (ndarray, float)
        Infinite where the data (and the prior) do not determine the parameters.
    """
    size = normal.shape[0]
    known = np.zeros((size, size)) if prior is None else prior
    whole = normal + known
    scale = np.sqrt(np.diag(whole))
    nothing = np.full((size, size), math.inf), 1.0
    if not np.all(scale > 0.0):
        return nothing
    scaled = whole / np.outer(scale, scale)
    if np.linalg.cond(scaled) > _SINGULAR:
        return nothing
    bread = np.linalg.inv(scaled)
    sums = block_sums(scores / scale, blocks)
    degrees = float(max(len(sums) - (size if counted is None else counted), 1))
    meat = sums.T @ sums * (len(sums) / degrees) + known / np.outer(scale, scale)
    covariance = bread @ meat @ bread / np.outer(scale, scale)
    return np.asarray(covariance, dtype=np.float64), degrees


def robust_covariance(jacobian: Floats, residual: Floats) -> Floats:
    """Return the covariance of least-squares estimates of one record, shape (p, p).

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
    scale = np.linalg.norm(jacobian, axis=0)
    if n <= p or not np.all(scale > 0.0) or not np.all(np.isfinite(scale)):
        return np.full((p, p), math.inf)
    scaled = jacobian / scale
    normal = scaled.T @ scaled
    if np.linalg.cond(normal) > 1e14:
        return np.full((p, p), math.inf)
    bread = np.linalg.inv(normal)
    meat = long_run_covariance(scaled * residual[:, None]) * (n / (n - p))
    return np.asarray(bread @ meat @ bread / np.outer(scale, scale), dtype=np.float64)


def long_run_covariance(scores: Floats) -> Floats:
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


def _persistence(series: Floats) -> float:
    power = float(series[:-1] @ series[:-1])
    if power == 0.0:
        return 0.0
    return float(np.clip(series[1:] @ series[:-1] / power, -_SLOWEST, _SLOWEST))


def _bandwidth(series: Floats) -> int:
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
