"""Lost motion from the difference of two positions: the output that friction carries, or flies."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats

Bools = npt.NDArray[np.bool_]
_AFLOAT = 0.15  # of the difference's width: what it scatters in one direction if it is free
_LEAST = 3e-4  # rad of that scatter: four counts of the bench's encoder, more than rounding leaves
_ROUNDS = 4  # of which end is nearer, and of the slope


def carried(driver: Floats, width: float) -> Bools:
    """Return the samples after the driver has passed the whole gap since it turned."""
    way = np.sign(np.gradient(driver))
    last = np.zeros(len(driver), dtype=np.intp)
    turns = np.flatnonzero(np.diff(way) != 0) + 1
    last[turns] = turns
    start = driver[np.maximum.accumulate(last)]
    return np.asarray(np.abs(driver - start) > 1.5 * width)


def floats(gap: Floats, way: Floats) -> bool:
    """Return whether the output flies freely in its backlash, no friction holding it.

    Parameters
    ----------
    gap : ndarray, shape (n,)
        Difference of the two positions [rad], where an output held by friction lies at one end.
    way : ndarray, shape (n,)
        Direction of the motion.
    """
    ends = [gap[way > 0.0], gap[way < 0.0]]
    if min(len(end) for end in ends) < 2:
        return False
    scatter = math.sqrt(0.5 * (float(np.var(ends[0])) + float(np.var(ends[1]))))
    return scatter > _LEAST and scatter > _AFLOAT * _width(gap)


def spanned(gap: Floats, output: Floats) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return lost motion and scale of such an output, each with its deviation.

    The difference piles up at both ends of the backlash: which end is nearer, not the direction,
    stands beside the output's position. The lost motion is the width of what is left; one sample in
    ten is on the way or presses a contact. The quarters of the log give the deviations.

    Parameters
    ----------
    gap, output : ndarray, shape (n,)
        Difference of the two positions and the output's position [rad].
    """
    width, slope = _ends(gap, output)
    parts = zip(np.array_split(gap, 4), np.array_split(output, 4), strict=True)
    widths, slopes = np.array([_ends(*part) for part in parts]).T
    return (width, 0.5 * float(widths.std(ddof=1))), (slope, 0.5 * float(slopes.std(ddof=1)))


def _ends(gap: Floats, output: Floats) -> tuple[float, float]:
    """Width of the difference, and its slope over the output's position at either end."""
    centred, slope = output - float(np.mean(output)), 0.0
    for _ in range(_ROUNDS):
        residual = gap - slope * centred
        low, high = np.percentile(residual, [5.0, 95.0])
        end = np.sign(residual - 0.5 * (low + high))
        columns = np.column_stack([centred, end, np.ones_like(gap)])
        slope = float(np.linalg.lstsq(columns, gap, rcond=None)[0][0])
    return _width(gap - slope * centred), slope


def _width(gap: Floats) -> float:
    low, high = np.percentile(gap, [5.0, 95.0])
    return float(high - low)
