"""The components of a fault's bank: ways of growth, scales of scatter, neighbourhoods of rates."""

from __future__ import annotations

from math import sqrt

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.prognose.shapes import NO_LAW, Shapes

#: Of the diagnoses' deviations over those stated, and their prior; ASSUMED.
SCALES = (0.25, 0.45, 0.8, 1.5)
SCALE_PRIOR = (0.15, 0.3, 0.35, 0.2)
_WIDTH = 0.6  # between neighbourhoods of growth factors, of its logarithm
#: Of growth without a law: how far off its rate may be, and the share of units that are anywhere
#: there. ASSUMED: a history counts, however far its rate is from what was expected.
_FAR, _ANYWHERE = 7.2, 0.02


def components(shapes: Shapes) -> tuple[npt.NDArray[np.intp], Floats, Floats, Floats, Floats]:
    """Return row, scale, prior, mean and deviation of the growth factor of each component."""
    rows = []
    pairs = zip(shapes.prior, shapes.spread, shapes.names, strict=True)
    for k, (share, spread, name) in enumerate(pairs):
        if share <= 0.0:
            continue
        at, weight, width = _neighbourhoods(float(spread))
        if name == NO_LAW:
            at, weight = _with_tails(at, weight)
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


def _with_tails(at: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Return neighbourhoods on to either side, a small share of the weight even over all."""
    count = round(_FAR / _WIDTH)
    wide = np.asarray(_WIDTH * np.arange(-count, count + 1), dtype=np.float64)
    out = np.full(len(wide), _ANYWHERE / len(wide))
    middle = count - len(at) // 2
    out[middle : middle + len(at)] += (1.0 - _ANYWHERE) * weight
    return wide, out
