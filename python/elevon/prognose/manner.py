"""How a fault may grow beside its law, and how inspections may err: priors, and draws of them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.plain import Plain

if TYPE_CHECKING:
    from elevon.prognose.law import Law

Rng = np.random.Generator


@dataclass(frozen=True)
class GrowthPrior(Plain):
    """What is taken of the units of a type before a unit's own history says more.

    Attributes
    ----------
    rate, spread : float
        Mean and deviation of the logarithm of a unit's rate over the law's.
    slope, slope_spread : float
        Mean and deviation of the power by which the rate follows the severity beyond the law.
    drift : (float, float)
        Least and greatest deviation of the part of the logarithm of the rate that fades.
    memory : (float, float)
        Least and greatest share of a life in which it fades to a third.
    changes : (float, float)
        Least and greatest number of sudden changes of the rate in one life.
    path : (float, float)
        Least and greatest deviation of the path over a life, of the severity at its end.
    scatter : (float, float)
        Mean and deviation of the logarithm of the diagnoses' scatter over what they state.
    missed : (float, float)
        Least and greatest share of well visible faults that inspections miss, in most units.
    """

    rate: float
    spread: float
    slope: float
    slope_spread: float
    drift: tuple[float, float]
    memory: tuple[float, float]
    changes: tuple[float, float]
    path: tuple[float, float]
    scatter: tuple[float, float] = (0.0, 0.45)
    missed: tuple[float, float] = (0.001, 0.03)


_MEMORY = (0.15, 1.5)
#: Beside a law, and where there is none. ASSUMED: what no fleet's file says (`learn-growth`).
BESIDE_LAW = GrowthPrior(0.0, 0.8, 0.0, 0.0, (0.02, 0.2), _MEMORY, (0.01, 0.1), (0.003, 0.03))
WITHOUT_LAW = GrowthPrior(0.0, 0.8, 1.0, 0.7, (0.6, 1.6), (0.1, 0.6), (0.1, 0.8), (0.003, 0.08))
#: Where a mission keeps its law alone, it is taken at its word.
LAW_ALONE = GrowthPrior(0.0, 0.8, 0.0, 0.0, (0.01, 0.04), _MEMORY, (0.001, 0.01), (1e-3, 3e-3))
FAR_OFF = 10.0
"""Greatest logarithm of a rate over the expected one, either way, of units whose growth follows no
law: a history counts, however far its rate is from what was expected."""
_FAR_SHARE, _FAR_DRAWN = 0.02, 0.15  # of units anywhere there, and of the particles; ASSUMED
_MISSED_OFTEN = (0.03, 0.3)
_OFTEN = 0.25  # share of units whose inspections miss well visible faults often; ASSUMED
_BLUR = (0.1, 0.5)  # deviation of the logarithm of the severity at which a fault is seen
_JITTER = 0.1  # of the logarithms of parameters, where particles are drawn again


@dataclass(frozen=True)
class Manner:
    """Parameters of particles, each of shape (n,).

    Attributes
    ----------
    row : ndarray of int
        Row of the fault's `Shapes`.
    drift, memory, changes, path : ndarray
        As in `GrowthPrior`.
    scatter : ndarray
        Deviation of the diagnoses over that which they state.
    missed : ndarray
        Probability that an inspection does not see a fault that is well visible.
    blur : ndarray
        Deviation of the logarithm of the severity at which a fault begins to be seen.
    """

    row: npt.NDArray[np.intp]
    drift: Floats
    memory: Floats
    changes: Floats
    path: Floats
    scatter: Floats
    missed: Floats
    blur: Floats

    def picked(self, index: npt.NDArray[np.intp]) -> Manner:
        """Return those of an index."""
        return Manner(**{f.name: getattr(self, f.name)[index] for f in fields(self)})

    def jittered(self, rng: Rng) -> Manner:
        """Return parameters close to these, so that particles drawn twice do not stay alike."""
        size = len(self.row)
        near = {
            name: getattr(self, name) * np.exp(_JITTER * rng.standard_normal(size))
            for name in ("drift", "memory", "changes", "path", "scatter", "missed", "blur")
        }
        near["missed"] = np.minimum(near["missed"], 0.6)
        return replace(self, **near)


def prior_of(law: Law) -> GrowthPrior:
    """Return what is taken of units that grow by a law, where no fleet says more."""
    return replace(LAW_ALONE if law.only else BESIDE_LAW, spread=law.spread)


def draw_manner(
    count: int, free: npt.NDArray[np.bool_], rows: Floats, priors: tuple[GrowthPrior, GrowthPrior],
    rng: Rng,
) -> Manner:  # fmt: skip
    """Draw parameters of particles.

    Parameters
    ----------
    count : int
        Of particles.
    free : ndarray of bool, shape (r,)
        Rows that follow no law.
    rows : ndarray, shape (r,)
        Prior of each row.
    priors : (GrowthPrior, GrowthPrior)
        Beside the law, and without it.
    rng : Generator
        Of chance.
    """
    row = np.sort(rng.choice(len(rows), size=count, p=rows / rows.sum()))
    of_law, of_free = priors

    def between(name: str) -> Floats:
        ends = [np.log(getattr(item, name)) for item in (of_law, of_free)]
        low = np.where(free[row], ends[1][0], ends[0][0])
        high = np.where(free[row], ends[1][1], ends[0][1])
        return np.asarray(np.exp(low + (high - low) * rng.random(count)))

    often = rng.random(count) < _OFTEN
    least = np.asarray(np.where(often, np.log(_MISSED_OFTEN[0]), np.log(of_free.missed[0])))
    most = np.asarray(np.where(often, np.log(_MISSED_OFTEN[1]), np.log(of_free.missed[1])))
    return Manner(
        row,
        between("drift"),
        between("memory"),
        between("changes"),
        between("path"),
        np.exp(of_free.scatter[0] + of_free.scatter[1] * rng.standard_normal(count)),
        np.exp(least + (most - least) * rng.random(count)),
        rng.uniform(*_BLUR, size=count),
    )


@dataclass(frozen=True)
class Rates:
    """Rates of particles, shape (n,) each.

    Attributes
    ----------
    rate, slope : ndarray
        Logarithm of the rate over the law's, and its slope over the logarithm of the severity.
    width : ndarray
        Deviation that a particle stands for around its rate.
    weight : ndarray
        Of the particle, 1 on average.
    """

    rate: Floats
    slope: Floats
    width: Floats
    weight: Floats


def draw_rates(
    free: npt.NDArray[np.bool_], law: Law, priors: tuple[GrowthPrior, GrowthPrior], rng: Rng
) -> Rates:
    """Draw rates of particles.

    Parameters
    ----------
    free : ndarray of bool, shape (n,)
        Particles that follow no law.
    law : Law
        Its `form_spread` is the one-sided slope of its error.
    priors, rng
        As `draw_manner`.
    """
    count = len(free)
    of_law, of_free = priors
    far = free & (rng.random(count) < _FAR_DRAWN)
    spread = np.where(free, of_free.spread, of_law.spread)
    rate = np.where(free, of_free.rate, of_law.rate) + spread * rng.standard_normal(count)
    rate = np.where(far, rng.uniform(-FAR_OFF, FAR_OFF, size=count), rate)
    normal = rng.standard_normal(count)
    one_sided = law.form_spread * np.abs(normal)
    of_law_slope = of_law.slope + of_law.slope_spread * normal if of_law.slope_spread else one_sided
    slope = np.where(free, of_free.slope + of_free.slope_spread * normal, of_law_slope)
    near = np.where(free, (1.0 - _FAR_SHARE) / (1.0 - _FAR_DRAWN), 1.0)
    weight = np.where(far, _FAR_SHARE / _FAR_DRAWN, near)
    width = np.where(far, _FAR_WIDTH, np.minimum(_NARROW, 0.5 * spread))
    return Rates(rate, slope, width, weight)


_NARROW, _FAR_WIDTH = 0.25, 0.5  # deviation of a particle's own Gaussian of its rate
