"""Lines as they travel in a page: few enough samples to draw, as base64 of their bytes."""

from __future__ import annotations

import base64
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats

_MOST_POINTS = 20_000


def thinned(
    time: Floats, values: Mapping[str, Floats], most: int = _MOST_POINTS
) -> tuple[Floats, dict[str, Floats]]:
    """Keep the least and the greatest value of each of equal slices of the samples.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Abscissa.
    values : mapping of str to ndarray, shape (n,)
        Lines.
    most : int
        The largest number of points selected.

    Returns
    -------
    time : ndarray, shape (m,)
        As given when n <= most, else two instants for each slice.
    values : dict of str to ndarray, shape (m,)
        As given, or the extremes in the order in which they occur; a slice with no finite value is
        NaN.
    """
    if time.size <= most:
        return time, dict(values)
    edges = np.unique(np.linspace(0, time.size, most // 2 + 1).astype(np.intp))
    starts = edges[:-1]
    middles = (starts + edges[1:]) // 2
    selected = np.empty(2 * starts.size)
    selected[0::2], selected[1::2] = time[starts], time[middles]
    return selected, {name: _extremes(line, starts) for name, line in values.items()}


def _extremes(line: Floats, starts: npt.NDArray[np.intp]) -> Floats:
    finite = np.isfinite(line)
    low = np.minimum.reduceat(np.where(finite, line, np.inf), starts)
    high = np.maximum.reduceat(np.where(finite, line, -np.inf), starts)
    with np.errstate(invalid="ignore"):  # a slice without any value has no middle
        rising = line[starts] <= (low + high) / 2
    pair = np.empty(2 * starts.size)
    pair[0::2], pair[1::2] = np.where(rising, low, high), np.where(rising, high, low)
    pair[~np.isfinite(pair)] = np.nan
    return pair


def packed(values: npt.ArrayLike, kind: str = "<f4") -> str:
    """Return numbers as the base64 of their bytes."""
    with np.errstate(over="ignore"):  # beyond float32 is drawn as missing
        return base64.b64encode(np.asarray(values).astype(kind).tobytes()).decode("ascii")
