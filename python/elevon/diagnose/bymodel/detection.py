"""Healthy or not at a set rate of false alarms: the best fault's likelihood ratio, by draws."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

__all__ = ["Detector"]

Floats = npt.NDArray[np.float64]
_DRAWS = 20_000


class Detector:
    """Likelihood ratio of the best fault against healthy, and how a healthy unit's is spread.

    Parameters
    ----------
    directions : ndarray, shape (d, k)
        Shifts of the candidates in the whitened evidence; length is of no matter.
    both : sequence of bool
        Whether the shift may have either sign.
    degrees : float
        Of freedom of Student's distribution.
    """

    def __init__(self, directions: Floats, both: Sequence[bool], degrees: float) -> None:
        size = np.linalg.norm(directions, axis=1)
        seen = size > 1e-9
        self._ways = directions[seen] / size[seen, None]
        self._both = np.array(both)[seen]
        self._degrees = degrees
        rng = np.random.default_rng(15)
        width = directions.shape[1]
        chi = rng.chisquare(degrees, _DRAWS) / degrees
        healthy = rng.standard_normal((_DRAWS, width)) / np.sqrt(chi)[:, None]
        self._healthy = np.sort(self.ratio(healthy))

    def ratio(self, rest: Floats) -> Floats:
        """Log likelihood ratio of whitened evidence, shape (m, k) to (m,)."""
        if not len(self._ways):
            return np.zeros(len(rest))
        along = rest @ self._ways.T
        along = np.where(self._both, np.abs(along), np.maximum(along, 0.0))
        square = np.sum(rest**2, axis=1)
        gain = np.maximum(square - along.max(axis=1) ** 2, 0.0)
        power = 0.5 * (self._degrees + rest.shape[1])
        return np.asarray(
            power * (np.log1p(square / self._degrees) - np.log1p(gain / self._degrees))
        )

    def threshold(self, rate: float) -> float:
        """Ratio that a healthy unit exceeds at this rate."""
        return float(np.quantile(self._healthy, 1.0 - rate))

    def chance(self, ratio: float) -> float:
        """How often a healthy unit has this ratio or a larger one; at least one draw."""
        above = len(self._healthy) - int(np.searchsorted(self._healthy, ratio))
        return max(above, 1) / len(self._healthy)
