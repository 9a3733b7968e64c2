"""Many possible units at once: their damage, their growth, and a step in use."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.prognose.fault_filter import CHANGE, GROWTHS, JUMP, JUMPS
from elevon.prognose.law import Law
from elevon.prognose.manner import BESIDE_LAW, draw_manner, draw_rates, prior_of
from elevon.prognose.response import ResponseTables
from elevon.prognose.shapes import Shapes, members, shapes_of

ONSET = 0.05
"""Rate at which a dormant fault begins to grow, for each e-fold of use. ASSUMED."""
AHEAD = 0.5
"""Sudden changes of the rate to come, over those that a history is searched for. ASSUMED: what may
have happened is weighted by inspections, what is to come only widens the answer."""

_LONGEST = 0.3  # of a life: what may happen to a rate in a longer step counts as in that
NUMBERS = ("damage", "growth", "slope", "wander", "drift", "memory", "changes", "path")
_OF_LAWS = (*NUMBERS, "row", "active", "off")


@dataclass(frozen=True)
class UnitPopulation:
    """Units that may be the true one, n of them of the same weight, with k laws.

    Attributes
    ----------
    damage : ndarray, shape (n, k)
        Of each law.
    growth : ndarray, shape (n, k)
        Logarithm of the unit's rate of each fault over the law's.
    slope : ndarray, shape (n, k)
        Power by which that follows the severity.
    wander : ndarray, shape (n, k)
        Part of `growth` that fades with use.
    row : ndarray of int, shape (n, k)
        Row of the law's `Shapes`; 0 is the law as it stands.
    drift, memory, changes, path : ndarray, shape (n, k)
        As in `GrowthPrior`, of each unit.
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
    slope: Floats
    wander: Floats
    row: npt.NDArray[np.intp]
    drift: Floats
    memory: Floats
    changes: Floats
    path: Floats
    active: npt.NDArray[np.bool_]
    off: Floats
    usage: float = 0.0

    @classmethod
    def of(cls, damage: Floats, growth: Floats, *, usage: float = 0.0) -> UnitPopulation:
        """Return growing units, shape (n, k), by the laws as they stand, whose rates stay."""
        none = np.zeros(growth.shape)
        return cls(
            damage=damage,
            growth=growth,
            slope=none,
            row=np.zeros(growth.shape, dtype=np.intp),
            wander=none,
            drift=none,
            memory=none + 1.0,
            changes=none,
            path=none,
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
        Whether rates drift and change as units are used.

    Attributes
    ----------
    shapes : tuple of Shapes
        Of each law.
    range : ndarray, shape (k,)
        Damage from new to the end of life that each fault alone brings.
    lives : list of ndarray
        Use from new to that end, of each row of the fault's `Shapes`.
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
        self.lives = [s.life() for s in self.shapes]

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
        deviations, _ = members(law)[member]
        factors = {
            name: np.exp(np.full(len(damage), deviation))
            for name, deviation in zip(law.spreading, deviations, strict=True)
        }
        return np.asarray(law.growth(damage, drivers, factors))

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
        active = rng.random((count, size)) >= np.array([law.dormant for law in self.laws])
        damage = np.maximum(self._new + spread * rng.standard_normal((count, size)), 0.0)
        none = np.zeros(count, dtype=np.bool_)
        columns: list[list[Floats]] = []
        for law in self.laws:
            shares = np.array([share for _, share in members(law)])
            priors = (prior_of(law), BESIDE_LAW)
            manner = draw_manner(count, np.zeros(len(shares), dtype=np.bool_), shares, priors, rng)
            drawn = draw_rates(none, law, priors, rng)
            row = rng.permutation(manner.row)
            columns.append(
                [
                    drawn.rate,
                    drawn.slope,
                    row,
                    manner.drift,
                    manner.memory,
                    manner.changes,
                    manner.path,
                ]
            )
        growth, slope, row, drift, memory, changes, path = (
            np.column_stack(c) for c in zip(*columns, strict=True)
        )
        return UnitPopulation(
            damage=np.where(active, damage, 0.0),
            growth=growth,
            slope=slope,
            row=row.astype(np.intp),
            wander=np.zeros((count, size)),
            drift=drift,
            memory=memory,
            changes=changes,
            path=path,
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
        steps: float | Floats,
        rng: np.random.Generator | None,
        load: Floats | None = None,
        rate: Floats | None = None,
    ) -> UnitPopulation:
        """Let all units be used more, in one step of the midpoint rule.

        Parameters
        ----------
        units : UnitPopulation
            Now; their `usage` rises where `steps` is a number.
        steps : float or ndarray, shape (n,)
            Repetitions, of all units or of each.
        rng : Generator, optional
            Of chance; without it growth is the mean one.
        load : ndarray, shape (n,), optional
            Factor on the mission's loads.
        rate : ndarray, shape (n, k), optional
            That of the units as they stand, where it is known already.
        """
        ones = np.ones(len(units)) if load is None else load
        each = np.reshape(np.asarray(steps, dtype=np.float64), (-1, 1))
        first = each * (self.rate(units, units.damage, ones) if rate is None else rate)
        mean = each * self.rate(units, units.damage + 0.5 * first, ones)
        folds = self._folds(units, units.damage + 0.5 * mean)
        mean = mean * np.exp(np.clip(units.slope * folds, -1.0, 1.0))
        damage = units.damage + (mean if rng is None else self._scattered(units, mean, rng))
        damage = np.minimum(damage, self._most)
        growth, wander = units.growth + units.slope * self._folds(units, damage), units.wander
        if rng is not None and self.wander:
            growth, wander = self._wandered(units, growth, each, mean, rng)
        return replace(
            units,
            damage=damage,
            growth=np.clip(growth, -GROWTHS, GROWTHS),
            wander=wander,
            usage=units.usage + float(each[0, 0]) if np.ndim(steps) == 0 else units.usage,
        )

    def _folds(self, units: UnitPopulation, damage: Floats) -> Floats:
        """Return by how much the logarithm of the severity grows up to a damage, shape (n, k)."""
        out = np.zeros(damage.shape)
        for k, shapes in enumerate(self.shapes):
            if units.slope[:, k].any():
                before, after = (
                    np.interp(d[:, k], shapes.damage, shapes.level) for d in (units.damage, damage)
                )
                row = units.row[:, k]
                out[:, k] = shapes.logarithm(after, row) - shapes.logarithm(before, row)
        return out

    def _scattered(self, units: UnitPopulation, mean: Floats, rng: np.random.Generator) -> Floats:
        """Draw increments of gamma processes: mean D, variance D times the grain; and jumps."""
        out = mean.copy()
        for k, (shapes, law) in enumerate(zip(self.shapes, self.laws, strict=True)):
            spread = units.path[:, k] ** 2 * self.range[k]
            free = shapes.free[units.row[:, k]]
            grain = np.where(free, spread, law.grain)
            if grain.any():
                scale = np.maximum(grain, 1e-300)
                drawn = scale * rng.standard_gamma(np.minimum(mean[:, k] / scale, 1e12))
                out[:, k] = np.where(grain > 0.0, drawn, mean[:, k])
            if self.wander:
                moved = np.minimum(mean[:, k] / self.range[k], _LONGEST)
                jumps = free & (rng.random(len(units)) < JUMPS * moved)
                size = JUMP * self.range[k] * np.abs(rng.standard_normal(len(units)))
                out[:, k] += np.where(jumps, size, 0.0)
        return out

    def _wandered(
        self,
        units: UnitPopulation,
        growth: Floats,
        steps: Floats,
        mean: Floats,
        rng: np.random.Generator,
    ) -> tuple[Floats, Floats]:
        """Return rates, and their parts that fade, after a step; now and then a rate changes."""
        growth, wander = growth.copy(), units.wander.copy()
        for k in range(len(self.laws)):
            time = steps[:, 0] / self.lives[k][units.row[:, k]]
            used = time * np.exp(units.growth[:, k])
            moved = np.minimum(np.maximum(used, mean[:, k] / self.range[k]), _LONGEST)
            remains = np.exp(-np.maximum(moved, time) / units.memory[:, k])
            normal = rng.standard_normal((2, len(units)))
            fades = units.drift[:, k] * np.sqrt(1.0 - remains**2) * normal[0]
            wander[:, k] = remains * units.wander[:, k] + fades
            change = rng.random(len(units)) < AHEAD * units.changes[:, k] * moved
            growth[:, k] += wander[:, k] - units.wander[:, k]
            growth[:, k] += np.where(change, CHANGE * normal[1], 0.0)
        return growth, wander
