"""Many possible units at once: their damage, their growth, and a step in use."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.prognose.bank import BEND, BEND_SPREAD, GROWTHS
from elevon.prognose.law import Law
from elevon.prognose.response import ResponseTables
from elevon.prognose.shapes import Shapes, members, shapes_of

ONSET = 0.05
"""Rate at which a dormant fault begins to grow, for each e-fold of use. ASSUMED."""

_LONGEST = 0.3  # of a life: what may happen to a rate in a longer step counts as in that
_OF_LAWS = ("damage", "growth", "row", "active", "off")  # unit, law


@dataclass(frozen=True)
class UnitPopulation:
    """Units that may be the true one, n of them of the same weight, with k laws.

    Attributes
    ----------
    damage : ndarray, shape (n, k)
        Of each law.
    growth : ndarray, shape (n, k)
        Logarithm of the unit's own factor on each fault's rate.
    row : ndarray of int, shape (n, k)
        How each fault grows: row of the law's `Shapes`; 0 is the law as it stands.
    active : ndarray of bool, shape (n, k)
        Whether the fault grows.
    off : ndarray, shape (n, k, m)
        The model's error of m requirements, in deviations of it, beside the law that
        moves each most; m = 0 until one of them has been measured.
    usage : float
        Use so far, in the mission's unit.
    """

    damage: Floats
    growth: Floats
    row: npt.NDArray[np.intp]
    active: npt.NDArray[np.bool_]
    off: Floats
    usage: float = 0.0

    @classmethod
    def of(cls, damage: Floats, growth: Floats, *, usage: float = 0.0) -> UnitPopulation:
        """Return growing units, shape (n, k), by the laws as they stand."""
        return cls(
            damage=damage,
            growth=growth,
            row=np.zeros(growth.shape, dtype=np.intp),
            active=np.ones(growth.shape, dtype=np.bool_),
            off=np.zeros((*growth.shape, 0)),
            usage=usage,
        )

    def __len__(self) -> int:
        """Return how many units there are."""
        return len(self.damage)

    def picked(self, index: npt.NDArray[np.intp]) -> UnitPopulation:
        """Return those of an index."""
        return replace(self, **{name: getattr(self, name)[index] for name in _OF_LAWS})


class Process:
    """The growth of all faults together under a mission.

    Parameters
    ----------
    response : ResponseTables
        What severities do.
    wander : bool
        Whether rates drift and bend as units are used.

    Attributes
    ----------
    shapes : tuple of Shapes
        Of each law.
    range : ndarray, shape (k,)
        Damage from new to the end of life that each fault alone brings.
    """

    def __init__(self, response: ResponseTables, *, wander: bool = True) -> None:
        self.response = response
        self.laws: tuple[Law, ...] = response.laws
        self.wander = wander
        self._new = np.array([law.start for law in self.laws])
        self.shapes: tuple[Shapes, ...] = tuple(
            shapes_of(law, partial(self._alone, k), self._limit(k))
            for k, law in enumerate(self.laws)
        )
        self.range = np.array([s.span_of_damage for s in self.shapes])
        # Beyond the greatest severity of the tables nothing is known; no state runs away there.
        self._most = np.array([s.damage[-1] for s in self.shapes])
        self._modifiers = [self._modifier(k) for k in range(len(self.laws))]
        self._lives = [s.life() for s in self.shapes]

    def _limit(self, k: int) -> float:
        """Return the severity at which a fault alone ends the life; the greatest, where none."""
        severity = np.tile(self.severity(self._new[None, :])[0], (400, 1))
        severity[:, k] = np.linspace(severity[0, k], self.laws[k].highest, 401)[1:]
        failed = self.response.reserve(severity).min(axis=0) < 0.0
        return float(severity[int(np.argmax(failed)) if failed.any() else -1, k])

    def _alone(self, k: int, damage: Floats, member: int = 0) -> Floats:
        """Return the growth of one fault by a member of its law, the others as in a new unit."""
        law = self.laws[k]
        severity = np.tile(self.severity(self._new[None, :])[0], (len(damage), 1))
        severity[:, k] = law.severity(damage)
        drivers = self.response.exposed(severity, np.ones(len(damage)))
        form, deviations, _ = members(law)[member]
        factors = {
            name: np.exp(np.full(len(damage), deviation))
            for name, deviation in zip(law.spreading, deviations, strict=True)
        }
        hastened = (1.0 + severity[:, k] / (0.25 * law.highest)) ** form
        return np.asarray(law.growth(damage, drivers, factors) * hastened)

    def _modifier(self, k: int) -> Floats:
        """Return the rows' growth over the law's between the points, shape (n, p - 1)."""
        shapes = self.shapes[k]
        middle = 0.5 * (shapes.damage[1:] + shapes.damage[:-1])
        law = np.maximum(self._alone(k, middle), 1e-300)
        return shapes.rates() / law

    def start(self, count: int, rng: np.random.Generator) -> UnitPopulation:
        """Draw new units, as their laws have them."""
        if count < 10:
            raise InputError(f"{count} samples: at least 10 are needed")
        size = len(self.laws)
        spread = np.array([law.start_spread for law in self.laws])
        growth = np.array([law.spread for law in self.laws])
        active = rng.random((count, size)) >= np.array([law.dormant for law in self.laws])
        damage = np.maximum(self._new + spread * rng.standard_normal((count, size)), 0.0)
        rows = [
            rng.choice(len(m), size=count, p=[share for *_, share in m])
            for m in map(members, self.laws)
        ]
        return UnitPopulation(
            damage=np.where(active, damage, 0.0),
            growth=growth * rng.standard_normal((count, size)),
            row=np.column_stack(rows).astype(np.intp),
            active=active,
            off=np.zeros((count, size, 0)),
        )

    def severity(self, damage: Floats) -> Floats:
        """Return the severities of damages, shape (n, k) both."""
        columns = [law.severity(damage[:, k]) for k, law in enumerate(self.laws)]
        return np.column_stack(columns)

    def rate(
        self,
        units: UnitPopulation,
        damage: Floats,
        load: Floats,
        drivers: Mapping[str, Floats] | None = None,
    ) -> Floats:
        """Return the mean growth of each damage in one repetition, shape (n, k).

        Parameters
        ----------
        units : UnitPopulation
            Whose growth it is.
        damage : ndarray, shape (n, k)
            Where it is evaluated: not always the units' own.
        load : ndarray, shape (n,)
            Factor on the mission's loads.
        drivers : mapping of str to ndarray, shape (n,), optional
            Exposure there, where it is known already.
        """
        damage = np.minimum(damage, self._most)
        if drivers is None:
            drivers = self.response.exposed(self.severity(damage), load)
        columns = []
        for k, law in enumerate(self.laws):
            modifier = self._modifiers[k][units.row[:, k], self._interval(k, damage[:, k])]
            columns.append(law.growth(damage[:, k], drivers) * modifier)
        return np.asarray(np.column_stack(columns) * np.exp(units.growth) * units.active)

    def factors(self, units: UnitPopulation) -> Floats:
        """Return each unit's growth of each fault now, over what its law says of it, (n, k)."""
        out = np.exp(units.growth)
        for k in range(len(self.laws)):
            out[:, k] *= self._modifiers[k][units.row[:, k], self._interval(k, units.damage[:, k])]
        return out

    def _interval(self, k: int, damage: Floats) -> npt.NDArray[np.intp]:
        return np.searchsorted(self.shapes[k].damage[1:-1], damage, side="right")

    def paces(self, severity: Floats) -> Floats:
        """Return each law's growth in the company of the others' faults, over it alone, (k,)."""
        damage = np.array([
            law.damage(severity[k : k + 1])[0] for k, law in enumerate(self.laws)
        ])  # fmt: skip
        drivers = self.response.exposed(severity[None, :], np.ones(1))
        out = []
        for k, law in enumerate(self.laws):
            alone = float(self._alone(k, damage[k : k + 1])[0])
            together = float(law.growth(damage[k : k + 1], drivers)[0])
            out.append(together / alone if alone > 0.0 else 1.0)
        return np.array(out)

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
        ones = np.ones(len(units)) if load is None else load
        first = steps * (self.rate(units, units.damage, ones) if rate is None else rate)
        mean = steps * self.rate(units, units.damage + 0.5 * first, ones)
        damage, growth, active = units.damage, units.growth, units.active
        if rng is None:
            damage = damage + mean
        else:
            damage = damage + self._scattered(units, mean, rng)
            if self.wander:
                growth = self._wandered(units, steps, mean, rng)
            if units.usage > 0.0 and not active.all():
                folds = float(np.log1p(steps / units.usage))
                active = active | (rng.random(active.shape) < -np.expm1(-ONSET * folds))
                begun = active & ~units.active & (damage <= 0.0)
                damage = np.where(begun, self._new, damage)
        return replace(
            units,
            damage=np.minimum(damage, self._most),
            growth=growth,
            active=active,
            usage=units.usage + steps,
        )

    def _scattered(self, units: UnitPopulation, mean: Floats, rng: np.random.Generator) -> Floats:
        """Draw increments of gamma processes: mean D, variance D times the row's grain."""
        out = mean.copy()
        for k, shapes in enumerate(self.shapes):
            grain = shapes.grain[units.row[:, k]]
            if grain.any():
                scale = np.maximum(grain, 1e-300)
                drawn = scale * rng.standard_gamma(np.minimum(mean[:, k] / scale, 1e12))
                out[:, k] = np.where(grain > 0.0, drawn, mean[:, k])
        return out

    def _wandered(
        self, units: UnitPopulation, steps: float, mean: Floats, rng: np.random.Generator
    ) -> Floats:
        """Return growth factors after a step: they drift, and now and then they bend."""
        growth = units.growth.copy()
        for k, (shapes, life) in enumerate(zip(self.shapes, self._lives, strict=True)):
            row = units.row[:, k]
            lives = np.minimum(np.exp(growth[:, k]) * steps / life[row], _LONGEST)
            normal = rng.standard_normal((3, len(units)))
            bend = rng.random(len(units)) < 2.0 * shapes.ahead[row] * lives
            side = np.where(normal[1] > 0.0, BEND, -BEND) + BEND_SPREAD * normal[2]
            moved = np.maximum(lives, np.minimum(mean[:, k] / self.range[k], _LONGEST))
            growth[:, k] += shapes.drift[row] * np.sqrt(moved) * normal[0] + bend * side
        return np.clip(growth, -GROWTHS, GROWTHS)

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
