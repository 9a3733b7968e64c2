"""The components of a fault's bank: ways of growth, scales of scatter, neighbourhoods of rates."""

from __future__ import annotations

from math import sqrt

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.prognose.shapes import Shapes

#: Of the diagnoses' deviations over those stated, and their prior; ASSUMED.
SCALES = (0.25, 0.45, 0.8, 1.5)
SCALE_PRIOR = (0.15, 0.3, 0.35, 0.2)
_WIDTH = 0.6  # between neighbourhoods of growth factors, of its logarithm


def components(shapes: Shapes) -> tuple[npt.NDArray[np.intp], Floats, Floats, Floats, Floats]:
    """Return row, scale, prior, mean and deviation of the growth factor of each component."""
    rows = []
    for k, (share, spread) in enumerate(zip(shapes.prior, shapes.spread, strict=True)):
        if share <= 0.0:
            continue
        at, weight, width = _neighbourhoods(float(spread))
        for scale, of_scale in zip(SCALES, SCALE_PRIOR, strict=True):
            rows += [
                (k, scale, share * of_scale * w, g, width) for g, w in zip(at, weight, strict=True)
            ]
    row, scale, prior, growth, width = np.array(rows).T
    return row.astype(np.intp), scale, prior / prior.sum(), growth, width


def _neighbourhoods(spread: float) -> tuple[Floats, Floats, float]:
    """Return centres, weights and deviation of Gaussians that together are one of a deviation."""
    if spread <= _WIDTH:
        return np.zeros(1), np.ones(1), spread
    width = 0.7 * _WIDTH
    remainder = sqrt(spread**2 - width**2)
    count = 2 * int(np.ceil(2.5 * remainder / _WIDTH)) + 1
    at = np.asarray(_WIDTH * (np.arange(count) - count // 2), dtype=np.float64)
    weight = np.exp(-0.5 * (at / remainder) ** 2)
    return at, np.asarray(weight / weight.sum()), float(width)
