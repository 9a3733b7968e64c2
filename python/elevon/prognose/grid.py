"""Tables over a grid of severities, and linear interpolation between their points."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats

#: Points of each axis by the number of axes: at most 1 024 model runs a table.
_POINTS = {1: 13, 2: 9, 3: 7, 4: 5, 5: 4, 6: 3}


def axis_points(axes: int) -> int:
    """Return how many points each of several axes has."""
    return _POINTS.get(axes, 2)


@dataclass(frozen=True)
class Grid:
    """A grid of points.

    Attributes
    ----------
    axes : tuple of ndarray
        Rising values of each axis, two or more.
    """

    axes: tuple[Floats, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Points of each axis."""
        return tuple(len(axis) for axis in self.axes)

    def points(self) -> Iterator[tuple[float, ...]]:
        """Yield all points, the last axis fastest."""
        return itertools.product(*(axis.tolist() for axis in self.axes))

    def weights(self, at: Sequence[Floats]) -> tuple[npt.NDArray[np.intp], Floats]:
        """Return flat indices and weights of the corners about each point, shape (c, n) each.

        Points outside the grid are moved to its border.
        """
        index = np.zeros((1, len(at[0])), dtype=np.intp)
        weight = np.ones((1, len(at[0])))
        for axis, value in zip(self.axes, at, strict=True):
            # Inner points alone are searched: no index is below the first cell or above the last.
            low = np.searchsorted(axis[1:-1], value, side="right")
            share = (value - axis[low]) / np.diff(axis)[low]
            share = np.minimum(np.maximum(share, 0.0), 1.0)
            index = np.concatenate((index * len(axis) + low, index * len(axis) + low + 1))
            weight = np.concatenate((weight * (1.0 - share), weight * share))
        return index, weight

    def interpolate(self, table: Floats, at: Sequence[Floats]) -> Floats:
        """Interpolate a table.

        Parameters
        ----------
        table : ndarray, shape (points, m)
            Values at `points`.
        at : sequence of ndarray, shape (n,)
            One an axis.

        Returns
        -------
        ndarray, shape (m, n)
        """
        index, weight = self.weights(at)
        return np.asarray(np.einsum("cnm,cn->mn", table[index], weight))
