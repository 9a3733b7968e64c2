"""Many possible units at once: their damage, their growth, and a step in use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.prognose.law import Law
from elevon.prognose.response import ResponseTables

DRIFT = 0.05
"""Deviation by which the logarithm of a unit's growth factor wanders while its use grows e-fold.

ASSUMED: no law is right for a whole life; a law's wrong exponent shows as a factor that drifts.
"""

ONSET = 0.05
"""Rate at which a dormant fault begins to grow, for each e-fold of use. ASSUMED."""


_OF_LAWS = (
    "damage",
    "growth",
    "form",
    "active",
    "misfit",
    "common",
    "coefficients",
    "off",
)  # unit, law


@dataclass(frozen=True)
class UnitPopulation:
    """Units that may be the true one, n of them, with k laws.

    Attributes
    ----------
    damage : ndarray, shape (n, k)
        Of each law.
    growth : ndarray, shape (n, k)
        Logarithm of the unit's own factor on each law's rate.
    form : ndarray, shape (n, k)
        Exponent by which the unit's growth differs from the law's as the fault grows.
    weight : ndarray, shape (n,)
        Sum 1.
    active : ndarray of bool, shape (n, k)
        Whether the fault grows.
    misfit : ndarray, shape (n, k)
        Sum of the squared distances, in stated deviations, from the diagnoses that saw the fault.
    common : ndarray, shape (n, k)
        What all diagnoses of the fault err by alike, in deviations of it (`Seen.common`).
    coefficients : ndarray, shape (n, k, c)
        Logarithms of the unit's factors on the coefficients that differ from unit to unit, in the
        order of `Law.spreading`; the rest of c is unused.
    off : ndarray, shape (n, k, m)
        The model's error of m requirements, in deviations of it, beside the law that
        moves each most; m = 0 until one of them has been measured.
    usage : float
        Use so far, in the mission's unit.
    """

    damage: Floats
    growth: Floats
    form: Floats
    weight: Floats
    active: npt.NDArray[np.bool_]
    misfit: Floats
    common: Floats
    coefficients: Floats
    off: Floats
    usage: float = 0.0

    @classmethod
    def of(
        cls, damage: Floats, growth: Floats, *, form: Floats | None = None, usage: float = 0.0
    ) -> UnitPopulation:
        """Return growing units of equal weight, shape (n, k), with the laws' coefficients."""
        zeros = np.zeros_like(growth)
        return cls(
            damage=damage,
            growth=growth,
            form=zeros if form is None else form,
            weight=np.full(len(growth), 1.0 / len(growth)),
            active=np.ones(growth.shape, dtype=np.bool_),
            misfit=zeros,
            common=zeros,
            coefficients=np.zeros((*growth.shape, 0)),
            off=np.zeros((*growth.shape, 0)),
            usage=usage,
        )

    def without_dormant(self) -> UnitPopulation:
        """Return the units without the faults that do not grow in them: those are not there."""
        return replace(self, damage=np.where(self.active, self.damage, 0.0))

    def picked(self, index: npt.NDArray[np.intp]) -> UnitPopulation:
        """Return those of an index, all with the same weight."""
        even = np.full(len(index), 1.0 / max(len(index), 1))
        return replace(self, weight=even, **{name: getattr(self, name)[index] for name in _OF_LAWS})

    def with_law(self, k: int, index: npt.NDArray[np.intp]) -> UnitPopulation:
        """Return the units with the numbers of one law from those of an index, shape (n,)."""
        columns = np.arange(self.damage.shape[1])
        rows = np.where(columns == k, index[:, None], np.arange(len(index))[:, None])
        return replace(self, **{name: getattr(self, name)[rows, columns] for name in _OF_LAWS})

    def with_off(self, requirements: int, rng: np.random.Generator) -> UnitPopulation:
        """Return the units with the model's error, drawn where they carry none yet."""
        if self.off.shape[2]:
            return self
        return replace(self, off=rng.standard_normal((*self.damage.shape, requirements)))


class Process:
    """The growth of all faults together under a mission.

    Parameters
    ----------
    response : ResponseTables
        What severities do.
    drift : float
        See `DRIFT`.
    """

    def __init__(self, response: ResponseTables, *, drift: float = DRIFT) -> None:
        self.response = response
        self.laws: tuple[Law, ...] = response.laws
        self.drift = drift
        self._quarter = np.array([0.25 * law.highest for law in self.laws])
        # Beyond the greatest severity of the tables nothing is known; no state runs away there.
        self.range = np.array([law.highest_damage - law.start for law in self.laws])
        """Damage from new to the greatest severity of the tables, shape (k,)."""
        self._most = np.array([2.0 * law.highest_damage for law in self.laws])
        self._spreads = _spreads(self.laws)

    def start(self, count: int, rng: np.random.Generator) -> UnitPopulation:
        """Draw new units."""
        if count < 10:
            raise InputError(f"{count} particles: at least 10 are needed")
        size = len(self.laws)
        start = np.array([law.start for law in self.laws])
        spread = np.array([law.start_spread for law in self.laws])
        growth = np.array([law.spread for law in self.laws])
        form = np.array([law.form_spread for law in self.laws])
        return UnitPopulation(
            damage=np.maximum(start + spread * rng.standard_normal((count, size)), 0.0),
            growth=growth * rng.standard_normal((count, size)),
            form=np.abs(form * rng.standard_normal((count, size))),
            weight=np.full(count, 1.0 / count),
            active=rng.random((count, size)) >= np.array([law.dormant for law in self.laws]),
            misfit=np.zeros((count, size)),
            common=rng.standard_normal((count, size)),
            coefficients=self._spreads * rng.standard_normal((count, *self._spreads.shape)),
            off=np.zeros((count, size, 0)),
        ).without_dormant()

    def severity(self, damage: Floats) -> Floats:
        """Return the severities of damages, shape (n, k) both."""
        columns = [law.severity(damage[:, k]) for k, law in enumerate(self.laws)]
        return np.column_stack(columns)

    def rate(self, units: UnitPopulation, damage: Floats, load: Floats) -> Floats:
        """Return the mean growth of each damage in one repetition, shape (n, k).

        Parameters
        ----------
        units : UnitPopulation
            Whose growth it is.
        damage : ndarray, shape (n, k)
            Where it is evaluated: not always the units' own.
        load : ndarray, shape (n,)
            Factor on the mission's loads.
        """
        damage = np.minimum(damage, self._most)
        severity = self.severity(damage)
        drivers = self.response.exposed(severity, load)
        columns = [
            law.growth(damage[:, k], drivers, self._factors(units, k))
            for k, law in enumerate(self.laws)
        ]
        factor = np.exp(units.growth + units.form * np.log1p(severity / self._quarter))
        return np.asarray(np.column_stack(columns) * factor * units.active)

    def _factors(self, units: UnitPopulation, k: int) -> dict[str, Floats]:
        """Return units' factors on one law's coefficients; none where they carry none."""
        names = self.laws[k].spreading[: units.coefficients.shape[2]]
        return {name: np.exp(units.coefficients[:, k, c]) for c, name in enumerate(names)}

    def advance(
        self,
        units: UnitPopulation,
        steps: float,
        rng: np.random.Generator | None,
        load: Floats | None = None,
        rate: Floats | None = None,
    ) -> UnitPopulation:
        """Let all units be used `steps` repetitions more, in one step of the midpoint rule.

        Without a random generator growth is the mean one; `rate` is that of the units as they
        stand, where it is known already.
        """
        ones = np.ones(len(units.weight)) if load is None else load
        first = steps * (self.rate(units, units.damage, ones) if rate is None else rate)
        mean = steps * self.rate(units, units.damage + 0.5 * first, ones)
        grown = mean if rng is None else _gamma(mean, self.laws, rng)
        damage, growth, active = units.damage + grown, units.growth, units.active
        if rng is not None and units.usage > 0.0:
            e_folds = float(np.log1p(steps / units.usage))
            if self.drift > 0.0:
                wander = self.drift * np.sqrt(e_folds)
                growth = growth + wander * rng.standard_normal(growth.shape)
            if not active.all():
                active = active | (rng.random(active.shape) < 1.0 - np.exp(-ONSET * e_folds))
                begun = active & ~units.active & (damage <= 0.0)
                damage = np.where(begun, [law.start for law in self.laws], damage)
        return replace(
            units,
            damage=np.minimum(damage, self._most),
            growth=growth,
            active=active,
            usage=units.usage + steps,
        )

    def to(
        self,
        units: UnitPopulation,
        usage: float,
        rng: np.random.Generator | None,
        *,
        steps: int = 12,
    ) -> UnitPopulation:
        """Use all units up to `usage`, in `steps` steps."""
        if usage < units.usage:
            raise InputError(f"use goes back from {units.usage:g} to {usage:g}")
        if usage == units.usage:
            return units
        for stop in np.linspace(units.usage, usage, steps + 1)[1:]:
            units = self.advance(units, float(stop) - units.usage, rng)
        return replace(units, usage=usage)

    def reset(
        self, units: UnitPopulation, keys: Sequence[str], rng: np.random.Generator
    ) -> UnitPopulation:
        """Return the units with parts made new; what replaces them has a growth of its own."""
        new = self.start(len(units.weight), rng)
        made = np.array([law.key in keys for law in self.laws])
        renewed = {
            name: np.where(made, getattr(new, name), getattr(units, name))
            for name in ("damage", "growth", "form", "active")
        }
        coefficients = np.where(made[:, None], new.coefficients, units.coefficients)
        return replace(units, coefficients=coefficients, **renewed)


def _spreads(laws: Sequence[Law]) -> Floats:
    """Return the deviations of the coefficients that differ from unit to unit, shape (k, c)."""
    out = np.zeros((len(laws), max((len(law.spreading) for law in laws), default=0)))
    for k, law in enumerate(laws):
        for c, name in enumerate(law.spreading):
            out[k, c] = law.coefficients[name].spread
    return out


def _gamma(mean: Floats, laws: Sequence[Law], rng: np.random.Generator) -> Floats:
    """Draw increments of a gamma process: mean D, variance D times the law's grain."""
    out = mean.copy()
    for k, law in enumerate(laws):
        if law.grain > 0.0:
            out[:, k] = law.grain * rng.standard_gamma(mean[:, k] / law.grain)
    return out
