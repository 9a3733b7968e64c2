"""Lives whose growth is no law's: forms of a course, and inspections that err as measured."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.prognose import Inspection, Process, ResponseTables, respond
from elevon.prognose.future import look_ahead
from elevon.prognose.mission import Mission, Usage
from studies.prognosis.campaign import campaign_mission
from studies.prognosis.truth import FAULTS, seen_as

Rng = np.random.Generator
NAMED_LAW = "own law"
_POINTS = 2001
_MOST = 20_000  # steps of a life by the law, of some hundreds
_LIFE = 0.5  # deviation of the logarithm of a life over the one that the law expects
_MISSED = 0.1  # share of the planned inspections that is not done
_STRAY = 0.1  # share of the inspections that err far, in the form `outliers`
_FAR = 0.4  # deviation of a stray inspection, of the limit


@dataclass(frozen=True)
class Case:
    """One mission in which one law acts alone.

    Attributes
    ----------
    law : str
        Name of the law.
    mission : Mission
        With the requirements that its fault concerns.
    tables : ResponseTables
        Of the published actuator.
    start, limit : float
        Severity of a new unit, and that at which life ends.
    expected : float
        Median life by the law.
    """

    law: str
    mission: Mission
    tables: ResponseTables
    start: float
    limit: float
    expected: float


@dataclass(frozen=True)
class ForeignLife:
    """One life: severity over use until it reaches the limit.

    Attributes
    ----------
    law, form : str
        The law that the filter is given, and how the fault truly grew.
    number : int
        Of the life.
    usage, severity : ndarray, shape (s,)
        Its course, end included.
    end : float
        Use at the end.
    """

    law: str
    form: str
    number: int
    usage: Floats
    severity: Floats
    end: float


@lru_cache(maxsize=8)
def case(name: str) -> Case:
    """Return the mission of the run-to-failure histories with one law alone."""
    mission = campaign_mission()
    law = next(item for item in mission.laws() if item.name == name)
    kept = tuple(r for r in mission.requirement if r.fault is None or r.fault == law.key)
    growth = tuple(g for g in mission.growth if g.law == name)
    alone = mission.model_copy(update={"requirement": kept, "growth": growth})
    tables = respond(Actuator.load("torino-rotary"), alone, laws=[law])
    process = Process(respond_growing(tables))
    rng = np.random.default_rng(0)
    future = look_ahead(process, process.start(1000, rng), Usage(), rng)
    at = np.linspace(0.0, law.highest, 4001)
    failed = tables.reserve(at[:, None]).min(axis=0) < 0.0
    start = float(law.severity(np.array([law.start]))[0])
    limit = float(at[int(np.argmax(failed))])
    return Case(name, alone, tables, start, limit, float(np.median(future.end)))


def respond_growing(tables: ResponseTables) -> ResponseTables:
    """Return tables whose faults grow in every unit."""
    return replace(tables, laws=tuple(replace(law, dormant=0.0) for law in tables.laws))


def _power(low: float, high: float) -> Callable[[Floats, Rng], Floats]:
    return lambda u, rng: u ** rng.uniform(low, high)


def _exponential(u: Floats, rng: Rng) -> Floats:
    a = rng.uniform(2.0, 4.0)
    return np.asarray(np.expm1(a * u) / np.expm1(a))


def _saturating(u: Floats, rng: Rng) -> Floats:
    a = rng.uniform(1.2, 2.0)
    return np.asarray(np.expm1(-a * u) / np.expm1(-a))


def _bent(share: float, factor: float) -> Callable[[Floats, Rng], Floats]:
    """Return growth whose rate changes by a factor at a share of the use until the limit."""

    def course(u: Floats, _rng: Rng) -> Floats:
        grown = np.minimum(u, share) + factor * np.maximum(u - share, 0.0)
        return np.asarray(grown / grown[-1])

    return course


def _random(steps: Floats) -> Floats:
    """Return a course from its increments, up to where it first reaches its end."""
    return np.concatenate(([0.0], np.cumsum(steps)))


def _wiener(u: Floats, rng: Rng) -> Floats:
    steps = np.diff(u)
    return _random(steps + 0.1 * np.sqrt(steps) * rng.standard_normal(len(steps)))


def _gamma(u: Floats, rng: Rng) -> Floats:
    steps = np.diff(u)
    return _random(0.01 * rng.standard_gamma(steps / 0.01))


def _jump(u: Floats, rng: Rng) -> Floats:
    return np.asarray(u + 0.25 * (u > rng.uniform(0.2, 0.6)))


def _renewed(u: Floats, rng: Rng) -> Floats:
    at = rng.uniform(0.3, 0.6)
    return np.asarray(np.where(u > at, u - at, u))


#: Name to relative growth over relative use; courses go on until they first reach 1.
FORMS: dict[str, Callable[[Floats, Rng], Floats]] = {
    "linear": lambda u, _rng: u,
    "power below 1": _power(0.5, 0.7),
    "power above 1": _power(1.6, 2.4),
    "exponential": _exponential,
    "saturating": _saturating,
    "rate x 3 at 60 %": _bent(0.6, 3.0),
    "rate x 0.35 at 40 %": _bent(0.4, 0.35),
    "duty x 2 at half": _bent(0.5, 2.0),
    "duty x 0.5 at half": _bent(0.5, 0.5),
    "Wiener": _wiener,
    "gamma": _gamma,
    "jump": _jump,
    "outliers": lambda u, _rng: u,
    "renewal": _renewed,
}


def foreign_life(law: str, form: str, number: int, seed: int) -> ForeignLife:
    """Draw one life; the same whatever else is drawn."""
    name = [NAMED_LAW, *FORMS].index(form)
    rng = np.random.default_rng([31, seed, name, FAULTS.index(law), number])
    given = case(law)
    if form == NAMED_LAW:
        return _named_law(given, number, rng)
    # Some forms reach the limit late: the course is drawn twice as long and cut where it ends.
    share = np.linspace(0.0, 1.0, _POINTS)
    course = FORMS[form](share, rng)
    if course.max() < 1.0:
        share = np.linspace(0.0, 2.0, 2 * _POINTS - 1)
        course = FORMS[form](share, rng)
    last = int(np.argmax(course >= 1.0 - 1e-12)) or len(course) - 1
    life = given.expected * float(np.exp(_LIFE * rng.standard_normal()))
    severity = given.start + (given.limit - given.start) * course[: last + 1]
    usage = life * share[: last + 1]
    return ForeignLife(law, form, number, usage, severity, float(usage[-1]))


def _named_law(given: Case, number: int, rng: Rng) -> ForeignLife:
    """Draw a life of the law that the filter is given: a unit of its own population.

    Its factor, form and coefficients are drawn as the law states them; it grows by the law and a
    gamma process about it.
    """
    law, tables = given.tables.laws[0], given.tables
    factor = float(np.exp(law.spread * rng.standard_normal()))
    form = abs(law.form_spread * rng.standard_normal())
    drawn = {n: np.exp(law.coefficients[n].spread * rng.standard_normal(1)) for n in law.spreading}
    damage = np.array([max(law.start + law.start_spread * rng.standard_normal(), 0.0)])
    last, step = float(law.damage(np.array([given.limit]))[0]), 2e-3 * given.expected / factor
    usage, severities, one = [0.0], [float(law.severity(damage)[0])], np.ones(1)
    while damage[0] < last and len(usage) < _MOST:
        severity = law.severity(damage)
        drivers = tables.exposed(severity[:, None], one)
        pace = factor * (1.0 + severity / (0.25 * law.highest)) ** form
        mean = step * pace * law.growth(damage, drivers, drawn)
        grown = law.grain * rng.standard_gamma(mean / law.grain) if law.grain else mean
        damage = damage + grown
        usage.append(usage[-1] + step)
        severities.append(float(law.severity(damage)[0]))
    return ForeignLife(
        given.law, NAMED_LAW, number, np.array(usage), np.array(severities), usage[-1]
    )


def inspected(life: ForeignLife, density: float, seed: int) -> list[Inspection]:
    """Inspect a life each 4 % of what the law expects, over the density, irregularly.

    A tenth is missed. Errors are those measured (`studies.prognosis.truth.INSPECTIONS`).
    """
    given = case(life.law)
    rng = np.random.default_rng([32, seed, int(density), life.number, len(life.form)])
    law = given.tables.laws[0]
    common = (*rng.standard_normal(2).tolist(), float(0.02 * rng.standard_normal()))
    out = []
    for usage in visits(life.end, 0.04 * given.expected / density, rng):
        severity = float(np.interp(usage, life.usage, life.severity))
        if life.form == "outliers" and rng.random() < _STRAY:
            severity = max(severity + _FAR * given.limit * float(rng.standard_normal()), 0.0)
        seen = seen_as(law, severity, common, rng)
        out.append(Inspection(usage, {law.key: seen}, name=f"{usage:.0f}"))
    return out


def visits(end: float, interval: float, rng: Rng) -> Iterator[float]:
    """Yield the uses of inspections until the end: irregular, a tenth of them not done."""
    usage = 0.0
    while (usage := usage + interval * rng.uniform(0.6, 1.4)) < end:
        if rng.random() >= _MISSED:
            yield usage
