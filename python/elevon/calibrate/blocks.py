"""Covariance of estimates from the spread of their scores over blocks of time.

Residuals of a log are coloured (friction, backlash, filters) and partly systematic (the model is
not the bench). Samples are therefore counted in blocks longer than the residual remembers: the
scores of a block are summed over all signals, and the spread of these sums is what a repetition of
the experiment would show (cluster-robust sandwich, with the finite-number correction).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats

__all__ = ["block_covariance", "block_length", "memory", "stroke_blocks"]

_SHORTEST = 0.25  # s
_MEMORY = 4.0  # correlation times a block is at least
_FEWEST = 8  # blocks a log


def memory(residual: Floats) -> float:
    """Samples of a coloured residual, shape (n,), that count as one."""
    centred = residual - residual.mean()
    power = float(centred @ centred)
    if power == 0.0:
        return 1.0
    size = 1 << (2 * len(centred) - 1).bit_length()
    spectrum = np.fft.rfft(centred, size)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2, size)[: len(centred) // 4] / power
    below = np.flatnonzero(correlation < 0.05)
    last = int(below[0]) if below.size else len(correlation)
    return 1.0 + 2.0 * float(np.sum(correlation[1:last]))


def block_length(residual: Floats, period: float) -> float:
    """Length of a block [s]: several correlation times of a residual, shape (n,)."""
    time = 0.5 * period * memory(residual)
    longest = period * len(residual) / _FEWEST
    return float(min(max(_SHORTEST, _MEMORY * time), longest))


def stroke_blocks(
    time: Floats, speed: Floats, residual: Floats, period: float
) -> npt.NDArray[np.int64]:
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


def block_covariance(
    normal: Floats, scores: Sequence[Floats], blocks: Sequence[npt.NDArray[np.int64]]
) -> tuple[Floats, float]:
    """Return covariance, shape (p, p), and its degrees of freedom.

    Parameters
    ----------
    normal : ndarray, shape (p, p)
        Sum over all samples of weight times outer product of the derivatives.
    scores : sequence of ndarray, shape (n, p)
        One a log: derivative times weighted residual, summed over the signals.
    blocks : sequence of ndarray of int, shape (n,)
        One a log: number of the block each sample is in.
    """
    size = normal.shape[0]
    scale = np.sqrt(np.diag(normal))
    if not np.all(scale > 0.0):
        return np.full((size, size), math.inf), 1.0
    scaled = normal / np.outer(scale, scale)
    if np.linalg.cond(scaled) > 1e12:
        return np.full((size, size), math.inf), 1.0
    bread = np.linalg.inv(scaled)
    sums = []
    for score, block in zip(scores, blocks, strict=True):
        total = np.zeros((int(block.max()) + 1, size))
        np.add.at(total, block, score / scale)
        sums.append(total[np.bincount(block, minlength=len(total)) > 0])
    stacked = np.vstack(sums)
    count = len(stacked)
    degrees = max(count - size, 1)
    meat = stacked.T @ stacked * (count / degrees)
    covariance = bread @ meat @ bread / np.outer(scale, scale)
    return np.asarray(covariance, dtype=np.float64), float(degrees)
