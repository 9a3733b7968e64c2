"""Lives by a law that the filter is told, and a filter that knows all of it but the unit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.prognose import Inspection, Mission, Process, ResponseTables, respond
from elevon.prognose.future import look_ahead
from elevon.prognose.mission import Usage
from studies.prognosis.campaign import campaign_mission
from studies.prognosis.truth import FAULTS, seen_as

Rng = np.random.Generator
_MOST = 20_000  # steps of a life by the law, of some hundreds
_UNITS = 4000
_SUBSTEPS = 6
_AHEAD = 0.01  # of an expected life: step of the look ahead


@dataclass(frozen=True)
class Case:
    """One mission in which one law acts alone; severities new and at the end; expected life."""

    law: str
    mission: Mission
    tables: ResponseTables
    start: float
    limit: float
    expected: float


@lru_cache(maxsize=8)
def case(name: str) -> Case:
    """Return the mission of the run-to-failure histories with one law alone."""
    mission = campaign_mission()
    law = replace(next(item for item in mission.laws() if item.name == name), dormant=0.0)
    kept = tuple(r for r in mission.requirement if r.fault is None or r.fault == law.key)
    growth = tuple(g for g in mission.growth if g.law == name)
    alone = mission.model_copy(update={"requirement": kept, "growth": growth})
    tables = respond(Actuator.load("torino-rotary"), alone, laws=[law])
    process, rng = Process(tables), np.random.default_rng(0)
    future = look_ahead(process, process.start(1000, rng), Usage(), rng)
    at = np.linspace(0.0, law.highest, 4001)
    failed = tables.reserve(at[:, None]).min(axis=0) < 0.0
    start = float(law.severity(np.array([law.start]))[0])
    limit = float(at[int(np.argmax(failed))])
    return Case(name, alone, tables, start, limit, float(np.median(future.end)))


@dataclass(frozen=True)
class _Units:
    """Units of a law's own population, n of them: what differs between them."""

    given: Case
    damage: Floats
    factor: Floats
    form: Floats
    coefficients: dict[str, Floats]

    @classmethod
    def drawn(cls, given: Case, count: int, rng: Rng) -> _Units:
        """Draw new units."""
        law = given.tables.laws[0]
        coefficients = {
            name: np.exp(law.coefficients[name].spread * rng.standard_normal(count))
            for name in law.spreading
        }
        start = law.start + law.start_spread * rng.standard_normal(count)
        return cls(
            given, np.maximum(start, 0.0), np.exp(law.spread * rng.standard_normal(count)),
            np.abs(law.form_spread * rng.standard_normal(count)), coefficients,
        )  # fmt: skip

    def used(self, step: Floats | float, rng: Rng) -> _Units:
        """Use them: the law, its gamma process about it."""
        law, tables = self.given.tables.laws[0], self.given.tables
        severity = law.severity(self.damage)
        drivers = tables.exposed(severity[:, None], np.ones(len(severity)))
        pace = self.factor * (1.0 + np.maximum(severity, 0.0) / (0.25 * law.highest)) ** self.form
        mean = step * pace * law.growth(self.damage, drivers, self.coefficients)
        grown = law.grain * rng.standard_gamma(mean / law.grain) if law.grain else mean
        return replace(self, damage=np.minimum(self.damage + grown, 2.0 * law.highest_damage))

    def picked(self, at: npt.NDArray[np.intp]) -> _Units:
        """Return those of an index."""
        kept = {name: value[at] for name, value in self.coefficients.items()}
        return replace(
            self, damage=self.damage[at], factor=self.factor[at], form=self.form[at],
            coefficients=kept,
        )  # fmt: skip

    @property
    def severity(self) -> Floats:
        """Of each unit."""
        return np.asarray(self.given.tables.laws[0].severity(self.damage))


@dataclass(frozen=True)
class OwnLife:
    """One life by the law: its course and its end."""

    given: Case
    usage: Floats
    severity: Floats

    @property
    def end(self) -> float:
        """Use at the end."""
        return float(self.usage[-1])


def own_life(law: str, number: int, seed: int) -> OwnLife:
    """Draw one life of a unit of the law's own population."""
    given = case(law)
    rng = np.random.default_rng([62, seed, FAULTS.index(law), number])
    unit = _Units.drawn(given, 1, rng)
    step = 2e-3 * given.expected / float(unit.factor[0])
    usage, severities = [0.0], [float(unit.severity[0])]
    while severities[-1] < given.limit and len(usage) < _MOST:
        unit = unit.used(step, rng)
        usage.append(usage[-1] + step)
        severities.append(float(unit.severity[0]))
    return OwnLife(given, np.array(usage), np.array(severities))


def own_inspections(
    life: OwnLife, number: int, seed: int, *, looks: int | None = None
) -> list[Inspection]:
    """Inspect a life 2 to 40 times until 30 to 95 % of it, with the measured errors."""
    given = life.given
    rng = np.random.default_rng([63, seed, FAULTS.index(given.law), number, looks or 0])
    count = looks or round(float(np.exp(rng.uniform(np.log(2.0), np.log(40.0)))))
    uses = np.sort(rng.uniform(0.05, 1.0, count))
    uses *= rng.uniform(0.3, 0.95) * life.end / uses[-1]
    law = given.tables.laws[0]
    common = (*rng.standard_normal(2).tolist(), float(0.02 * rng.standard_normal()))
    return [
        Inspection(
            float(use),
            {law.key: seen_as(law, float(np.interp(use, life.usage, life.severity)), common, rng)},
        )
        for use in uses
    ]


def knowing(given: Case, seen: list[Inspection], rng: Rng) -> Floats:
    """Return remaining lives by a filter that knows law and spread, of its own making.

    A bootstrap particle filter over whole units: factor, form and coefficients are the unit's for
    life, so that particles are only drawn again, never moved.
    """
    key = given.tables.laws[0].key
    units, before = _Units.drawn(given, _UNITS, rng), 0.0
    common = rng.standard_normal(_UNITS)
    score = np.zeros(_UNITS)
    for item in seen:
        for _ in range(_SUBSTEPS):
            units = units.used((item.usage - before) / _SUBSTEPS, rng)
        before = item.usage
        look = item.seen[key]
        if look.severity is None:
            z = (look.limit - units.severity) / (0.3 * look.limit)
            score += np.where(z > 0.0, 0.0, -0.5 * z**2)
        else:
            off = look.severity - units.severity - look.common * common
            deviation = np.where(off > 0.0, look.low, look.high)
            score += np.logaddexp(-0.5 * (off / deviation) ** 2, -12.0)
        weight = np.exp(score - score.max())
        weight /= weight.sum()
        if 1.0 / np.sum(weight**2) < 0.3 * _UNITS:
            even = (rng.random() + np.arange(_UNITS)) / _UNITS
            index = np.minimum(np.searchsorted(np.cumsum(weight), even), _UNITS - 1)
            units, common = units.picked(index), common[index]
            near = np.exp(0.02 * rng.standard_normal(_UNITS))
            units = replace(units, factor=units.factor * near)
            score = np.zeros(_UNITS)
    weight = np.exp(score - score.max())
    chosen = rng.choice(_UNITS, size=1000, p=weight / weight.sum())
    return _ends(units.picked(chosen), given, rng)


def _ends(units: _Units, given: Case, rng: Rng) -> Floats:
    end, now, step = np.full(len(units.damage), np.inf), 0.0, _AHEAD * given.expected
    end[units.severity >= given.limit] = 0.0
    while np.isinf(end).any() and now < 100.0 * given.expected:
        units = units.used(step, rng)
        now += step
        end[np.isinf(end) & (units.severity >= given.limit)] = now
        step *= 1.02
    return np.asarray(np.minimum(end, 100.0 * given.expected))
