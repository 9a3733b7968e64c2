"""Healthy or not at a set rate of false alarms: the best fault's likelihood ratio, by draws.

Beside it, each for a share of the rate, how far one feature deviates alone, and all in any
direction: a fault that is not among the candidates is none of a healthy unit either. With shares
apart, a fault of the candidates is not judged by how many features there are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from elevon.arrays import Floats

DRAWS = 10_000  # by which 5 % is met to 0.2 %


class _Ways:
    """Directions in whitened features, and the likelihood ratio of the best of them."""

    def __init__(self, directions: Floats, both: Sequence[bool], degrees: float) -> None:
        size = np.linalg.norm(directions, axis=1)
        seen = size > 1e-9
        ways, either = directions[seen] / size[seen, None], np.array(both, dtype=np.bool_)[seen]
        self._ways, self._either = np.vstack([ways[either], ways[~either]]), int(either.sum())
        self._degrees = degrees

    def ratio(self, residual: Floats) -> Floats:
        if not len(self._ways):
            return np.zeros(len(residual))
        along = residual @ self._ways.T
        np.abs(along[:, : self._either], out=along[:, : self._either])
        most = np.maximum(along.max(axis=1), 0.0)
        square = np.einsum("mk,mk->m", residual, residual)
        gain = np.maximum(square - most**2, 0.0)
        power = 0.5 * (self._degrees + residual.shape[1])
        return np.asarray(
            power * (np.log1p(square / self._degrees) - np.log1p(gain / self._degrees))
        )


class Detector:
    """Likelihood ratio of the best fault against healthy, and how a healthy unit's is spread.

    Parameters
    ----------
    directions : ndarray, shape (d, k)
        Shifts of the candidates in the whitened features; length is of no matter.
    both : sequence of bool
        Whether the shift may have either sign.
    degrees : float
        Of freedom of Student's distribution.
    anywhere : float
        Share of the false-alarm rate for deviations in any direction.
    draws : ndarray, shape (d, k), optional
        Whitened healthy logs; by default they follow Student's distribution.
    each : ndarray, shape (e, k), optional
        Directions, either way, of what no candidate may do.
    alone : float
        Share of the false-alarm rate for them.
    """

    def __init__(
        self,
        directions: Floats,
        both: Sequence[bool],
        degrees: float,
        anywhere: float = 0.0,
        draws: Floats | None = None,
        *,
        each: Floats | None = None,
        alone: float = 0.0,
    ) -> None:
        self._degrees, self._anywhere = degrees, anywhere
        self._tests = [(_Ways(directions, both, degrees), 1.0 - anywhere - alone)]
        if each is not None:
            self._tests.append((_Ways(each, [True] * len(each), degrees), alone))
        healthy = _student(directions.shape[1], degrees) if draws is None else draws
        ratios = [ways.ratio(healthy) for ways, _ in self._tests]
        self._ratios = [np.sort(ratio) for ratio in ratios]
        self._healthy = np.sort(self._score(healthy, ratios))

    def ratio(self, residual: Floats) -> Floats:
        """Log likelihood ratio of the candidates, of whitened features, shape (m, k) to (m,)."""
        return self._tests[0][0].ratio(residual)

    def score(self, residual: Floats) -> Floats:
        """What is judged of whitened features, shape (m, k) to (m,): the most seldom.

        The candidates' ratio, where nothing is set aside for anything else; else less the log of a
        chance. The squared length over k follows Fisher's distribution.
        """
        return self._score(residual, [ways.ratio(residual) for ways, _ in self._tests])

    def _score(self, residual: Floats, ratios: Sequence[Floats]) -> Floats:
        from scipy.stats import f as fisher

        if len(ratios) == 1 and not self._anywhere:
            return ratios[0]
        chances = []
        for (_, share), known, ratio in zip(self._tests, self._ratios, ratios, strict=True):
            above = len(known) - np.searchsorted(known, ratio)
            chances.append(np.maximum(above, 1) / len(known) / share)
        if self._anywhere:
            square = np.mean(residual**2, axis=1)
            off = fisher.sf(square, residual.shape[1], self._degrees) / self._anywhere
            chances.append(np.maximum(off, 1e-300))
        return np.asarray(-np.log(np.minimum.reduce(chances)), dtype=np.float64)

    def threshold(self, rate: float) -> float:
        """Score that a healthy unit exceeds at this rate."""
        return float(np.quantile(self._healthy, 1.0 - rate))

    def chance(self, score: float) -> float:
        """How often a healthy unit has this score or a larger one; at least one draw."""
        above = len(self._healthy) - int(np.searchsorted(self._healthy, score))
        return max(above, 1) / len(self._healthy)


def _student(width: int, degrees: float) -> Floats:
    """Draw whitened healthy logs of Student's distribution, shape (d, width)."""
    rng = np.random.default_rng(15)
    chi = rng.chisquare(degrees, DRAWS) / degrees
    return np.asarray(rng.standard_normal((DRAWS, width)) / np.sqrt(chi)[:, None])
