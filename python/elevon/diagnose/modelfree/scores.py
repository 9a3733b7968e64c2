"""Scores of a classifier, with intervals over recordings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

Codes = npt.NDArray[np.int64]


def macro_f1(truth: npt.ArrayLike, predicted: npt.ArrayLike) -> float:
    """Return the mean of F1 = 2 TP / (2 TP + FP + FN) over the classes that `truth` holds.

    Parameters
    ----------
    truth, predicted : array of int or str
        Of each recording.
    """
    right, answer = np.asarray(truth), np.asarray(predicted)
    scores = []
    for name in np.unique(right):
        of, called = right == name, answer == name
        scores.append(2.0 * np.count_nonzero(of & called) / (of.sum() + called.sum()))
    return float(np.mean(scores))


def accuracy(truth: npt.ArrayLike, predicted: npt.ArrayLike) -> float:
    """Return the share of recordings that are right."""
    return float(np.mean(np.asarray(truth) == np.asarray(predicted)))


def confusion(
    truth: npt.ArrayLike, predicted: npt.ArrayLike, classes: Sequence[str]
) -> list[list[int]]:
    """Count recordings: a row for each true class, a column for each answer."""
    right, answer = np.asarray(truth), np.asarray(predicted)
    return [[int(((right == a) & (answer == b)).sum()) for b in classes] for a in classes]


def resamples(strata: npt.ArrayLike, *, draws: int = 1000, seed: int = 0) -> Iterator[Codes]:
    """Draw recordings again with replacement, within each stratum (Efron's bootstrap).

    Parameters
    ----------
    strata : array
        Such as the number of each condition and load; how many they have stays as it is.
    draws : int
        How often.
    seed : int
        Of the draws.

    Yields
    ------
    array of int
        Indices of the recordings of one draw.
    """
    keys = np.unique(np.asarray(strata), return_inverse=True)[1]
    order = np.argsort(keys, kind="stable")
    counts = np.bincount(keys)
    first = np.repeat(np.concatenate(([0], np.cumsum(counts)[:-1])), counts)
    size = np.repeat(counts, counts)
    random = np.random.default_rng(seed)
    for _ in range(draws):
        yield order[first + (random.random(len(order)) * size).astype(np.int64)]


def share_interval(hits: int, count: int) -> tuple[float, float]:
    """Return the exact 95 % interval of a share (Clopper and Pearson, Biometrika 26, 1934)."""
    from scipy.special import betaincinv

    if count == 0:
        return 0.0, 1.0
    low = float(betaincinv(hits, count - hits + 1, 0.025)) if hits else 0.0
    high = float(betaincinv(hits + 1, count - hits, 0.975)) if hits < count else 1.0
    return low, high
