"""Healthy or not at a set rate of false alarms: the best fault's likelihood ratio, by draws.

Beside it, for a share of the rate, how far the features deviate in any direction: a fault that
is not among the candidates is none of a healthy unit either.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from elevon.arrays import Floats

DRAWS = 10_000  # by which 5 % is met to 0.2 %


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
    """

    def __init__(
        self,
        directions: Floats,
        both: Sequence[bool],
        degrees: float,
        anywhere: float = 0.0,
        draws: Floats | None = None,
    ) -> None:
        size = np.linalg.norm(directions, axis=1)
        seen = size > 1e-9
        ways, either = directions[seen] / size[seen, None], np.array(both, dtype=np.bool_)[seen]
        self._ways, self._either = np.vstack([ways[either], ways[~either]]), int(either.sum())
        self._degrees, self._anywhere = degrees, anywhere
        healthy = _student(directions.shape[1], degrees) if draws is None else draws
        ratios = self.ratio(healthy)
        self._ratios = np.sort(ratios)
        self._healthy = np.sort(self._score(healthy, ratios)) if anywhere else self._ratios

    def ratio(self, residual: Floats) -> Floats:
        """Log likelihood ratio of whitened features, shape (m, k) to (m,)."""
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

    def score(self, residual: Floats) -> Floats:
        """What is judged of whitened features, shape (m, k) to (m,): the more seldom of the two.

        The ratio, where nothing is set aside for other directions; else less the log of a chance.
        The squared length over k follows Fisher's distribution.
        """
        return self._score(residual, self.ratio(residual))

    def _score(self, residual: Floats, ratio: Floats) -> Floats:
        from scipy.stats import f as fisher

        if not self._anywhere:
            return ratio
        above = len(self._ratios) - np.searchsorted(self._ratios, ratio)
        along = np.maximum(above, 1) / len(self._ratios) / (1.0 - self._anywhere)
        square = np.mean(residual**2, axis=1)
        off = fisher.sf(square, residual.shape[1], self._degrees) / self._anywhere
        return np.asarray(-np.log(np.minimum(along, np.maximum(off, 1e-300))), dtype=np.float64)

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
