"""Many possible units at once: their damage, their growth, and a step in use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from elevon.errors import InputError
from elevon.prognose.law import Law
from elevon.prognose.response import Response

__all__ = ["DRIFT", "Population", "Process"]

Floats = npt.NDArray[np.float64]

DRIFT = 0.08
"""Deviation by which the logarithm of a unit's growth factor wanders while its use grows e-fold.

ASSUMED: no law is right for a whole life; a law's wrong exponent shows as a factor that drifts.
"""


@dataclass(frozen=True)
class Population:
    """Units that may be the true one, n of them, with k laws.

    Attributes
    ----------
    damage : ndarray, shape (n, k)
        Of each law.
    growth : ndarray, shape (n, k)
        Logarithm of the unit's own factor on each law's rate.
    bias : ndarray, shape (n, k)
        Logarithm of the factor by which diagnoses show each severity.
    weight : ndarray, shape (n,)
        Sum 1.
    usage : float
        Use so far, in the mission's unit.
    """

    damage: Floats
    growth: Floats
    bias: Floats
    weight: Floats
    usage: float = 0.0

    def picked(self, index: npt.NDArray[np.intp]) -> Population:
        """Return those of an index, all with the same weight."""
        even = np.full(len(index), 1.0 / len(index))
        return Population(
            self.damage[index], self.growth[index], self.bias[index], even, self.usage
        )


class Process:
    """The growth of all faults together under a mission.

    Parameters
    ----------
    response : Response
        What severities do.
    drift : float
        See `DRIFT`.
    """

    def __init__(self, response: Response, *, drift: float = DRIFT) -> None:
        self.response = response
        self.laws: tuple[Law, ...] = response.laws
        self.drift = drift

    def start(self, count: int, rng: np.random.Generator, *, bias: float = 0.0) -> Population:
        """Draw new units; `bias` is the deviation of the diagnoses' common factor."""
        if count < 10:
            raise InputError(f"{count} particles: at least 10 are needed")
        size = len(self.laws)
        start = np.array([law.start for law in self.laws])
        spread = np.array([law.start_spread for law in self.laws])
        growth = np.array([law.spread for law in self.laws])
        return Population(
            np.maximum(start + spread * rng.standard_normal((count, size)), 0.0),
            growth * rng.standard_normal((count, size)),
            bias * rng.standard_normal((count, size)),
            np.full(count, 1.0 / count),
        )

    def severity(self, damage: Floats) -> Floats:
        """Return the severities of damages, shape (n, k) both."""
        columns = [law.severity(damage[:, k]) for k, law in enumerate(self.laws)]
        return np.column_stack(columns)

    def rate(self, damage: Floats, growth: Floats, load: Floats) -> Floats:
        """Return the mean growth of each damage in one repetition, shape (n, k)."""
        drivers = self.response.exposed(self.severity(damage), load)
        columns = [law.growth(damage[:, k], drivers) for k, law in enumerate(self.laws)]
        return np.column_stack(columns) * np.exp(growth)

    def advance(
        self,
        units: Population,
        steps: float,
        rng: np.random.Generator | None,
        load: Floats | None = None,
    ) -> Population:
        """Let all units be used `steps` repetitions more, in one step of the midpoint rule.

        Without a random generator growth is the mean one.
        """
        ones = np.ones(len(units.weight)) if load is None else load
        first = steps * self.rate(units.damage, units.growth, ones)
        mean = steps * self.rate(units.damage + 0.5 * first, units.growth, ones)
        grown = mean if rng is None else _gamma(mean, self.laws, rng)
        growth = units.growth
        if rng is not None and self.drift > 0.0 and units.usage > 0.0:
            wander = self.drift * np.sqrt(np.log1p(steps / units.usage))
            growth = growth + wander * rng.standard_normal(growth.shape)
        return replace(units, damage=units.damage + grown, growth=growth, usage=units.usage + steps)

    def to(
        self,
        units: Population,
        usage: float,
        rng: np.random.Generator | None,
        *,
        steps: int = 12,
    ) -> Population:
        """Use all units up to `usage`, in `steps` steps."""
        if usage < units.usage:
            raise InputError(f"use goes back from {units.usage:g} to {usage:g}")
        if usage == units.usage:
            return units
        for stop in np.linspace(units.usage, usage, steps + 1)[1:]:
            units = self.advance(units, float(stop) - units.usage, rng)
        return replace(units, usage=usage)

    def reset(self, units: Population, keys: Sequence[str], rng: np.random.Generator) -> Population:
        """Return the units with parts made new; what replaces them has a growth of its own."""
        new = self.start(len(units.weight), rng)
        at = [k for k, law in enumerate(self.laws) if law.key in keys]
        damage, growth = units.damage.copy(), units.growth.copy()
        damage[:, at], growth[:, at] = new.damage[:, at], new.growth[:, at]
        return replace(units, damage=damage, growth=growth)


def _gamma(mean: Floats, laws: Sequence[Law], rng: np.random.Generator) -> Floats:
    """Draw increments of a gamma process: mean D, variance D times the law's grain."""
    out = mean.copy()
    for k, law in enumerate(laws):
        if law.grain > 0.0:
            out[:, k] = law.grain * rng.standard_gamma(mean[:, k] / law.grain)
    return out
