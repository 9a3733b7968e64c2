"""What a fleet's growth is worth, and what a plan by cost is worth over five years."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from elevon.arrays import Floats
from elevon.prognose import GrowthFilter, Inspection, Process, Seen
from elevon.prognose.answer import Prognosis
from elevon.prognose.fleet import Costs, plan_fleet
from elevon.prognose.fleet_growth import FleetUnit, learn_fleet
from elevon.prognose.future import Future, look_ahead
from elevon.prognose.manner import WITHOUT_LAW
from elevon.prognose.mission import Usage
from elevon.prognose.value_history import VALUE
from studies.lives.judge import Scored, relative_tables, remaining, scored
from studies.lives.truth import drawn_life

_TEACHERS = 20
_SCATTER = 0.02  # of the limit: deviation of an inspection


@dataclass(frozen=True)
class Population:
    """Units of one form: use over the life at severities over the limit, and their spread."""

    severity: Floats
    use: Floats
    spread: float

    @classmethod
    def drawn(cls, number: int, seed: int) -> Population:
        """Draw a form of two powers, and how far units differ."""
        rng = np.random.default_rng([70, seed, number])
        share = np.linspace(0.0, 1.0, 201)
        first, second, mix = rng.uniform(0.6, 1.0), rng.uniform(1.2, 3.0), rng.random()
        severity = mix * share**first + (1.0 - mix) * share**second
        return cls(severity, share, float(rng.uniform(0.15, 0.4)))

    def history(self, rng: np.random.Generator, until: float) -> tuple[list[Inspection], float]:
        """Draw a unit's inspections until a share of its life, and its life."""
        life = float(np.exp(self.spread * rng.standard_normal()))
        uses = np.sort(rng.uniform(0.03, until, int(rng.integers(5, 16)))) * life
        true = np.interp(uses / life, self.use, self.severity)
        values = true + _SCATTER * rng.standard_normal(len(uses))
        return [_look(float(u), float(v)) for u, v in zip(uses, values, strict=True)], life


def _look(use: float, value: float) -> Inspection:
    return Inspection(use, {VALUE: Seen(value, _SCATTER, _SCATTER)})


def learned_rows(number: int, seed: int) -> list[dict[str, Any]]:
    """Predict new units by 20 histories, by the known population, and by neither."""
    population = Population.drawn(number, seed)
    rng = np.random.default_rng([71, seed, number])
    units = []
    for k in range(_TEACHERS):
        seen, life = population.history(rng, 1.0)
        failed = rng.random() < 0.7
        end = life if failed else life * float(rng.uniform(0.5, 0.95))
        kept = tuple(i for i in seen if i.usage < end) or tuple(seen[:1])
        units.append(FleetUnit(f"unit {k}", kept, max(end, kept[-1].usage), failed))
    tables = relative_tables()
    fleet = learn_fleet(units, tables, unit="lives", seed=seed)
    law = replace(
        tables.laws[0], life=1.0, dormant=0.0,
        form=tuple(zip(population.severity.tolist(), population.use.tolist(), strict=True)),
    )  # fmt: skip
    steady = replace(
        WITHOUT_LAW, spread=population.spread, slope=0.0, slope_spread=0.0,
        drift=(0.005, 0.006), changes=(1e-4, 2e-4), path=(1e-3, 1.1e-3),
    )  # fmt: skip
    known = replace(tables, laws=(law,))
    out: list[Scored] = []
    for k in range(_TEACHERS):
        seen, life = population.history(rng, float(rng.uniform(0.4, 0.9)))
        at, end = seen[-1].usage, life
        for name, left in (
            ("learned", remaining(fleet.tables(tables), seen, k, priors=fleet.priors({}))),
            ("known", remaining(known, seen, k, priors={VALUE: (steady, steady)})),
            ("neither", remaining(tables, seen, k)),
        ):
            out.append(
                scored(
                    name,
                    "fleet",
                    100 * number + k,
                    left,
                    true=end - at,
                    life=end,
                    far=20.0,
                    looks=len(seen),
                )
            )
    return [asdict(item) for item in out]


_UNITS, _YEARS, _QUARTERS = 200, 5, 4
_YEAR = 0.4  # of an expected life, that a unit is used in a year
_COSTS = Costs(early=1.0, late=10.0, visit=0.3)  # of an expected life, a failure, a visit
_RISK = 0.02  # of failing before its visit, that no unit may exceed


def plan_rows(seed: int, *, units: int = _UNITS) -> dict[str, Any]:
    """Keep a fleet for five years: by the plan, at fixed ages, and knowing each end.

    Each quarter all units are inspected and the visits are planned again; those that fall before
    the next quarter are done at once. A unit that fails is replaced, at the cost of a failure.
    """
    quarter = _YEAR / _QUARTERS
    fleet = [_Slot(seed, k) for k in range(units)]
    ours = _kept(fleet, quarter)
    fixed = {age: _by_age(fleet, quarter, age) for age in (0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 99.0)}
    best = min(fixed, key=lambda age: fixed[age]["cost"])
    return {
        "units": units,
        "plan": ours,
        "fixed": fixed[best] | {"age": best},
        "at_failure": fixed[99.0],
        "knowing": _knowing(fleet, quarter),
    }


class _Slot:
    """One place of the fleet: the lives that follow each other in it, the same for all policies."""

    def __init__(self, seed: int, number: int) -> None:
        self._seed, self._number = seed, number

    def life(self, generation: int) -> tuple[Floats, Floats]:
        """Return use and severity of the part of a generation."""
        drawn = drawn_life(1_000_000 + 100 * self._number + generation, self._seed)
        return drawn.usage, drawn.severity

    def look(self, generation: int, age: float) -> Inspection:
        """Return what an inspection of a part at an age says."""
        usage, severity = self.life(generation)
        rng = np.random.default_rng([72, self._seed, self._number, generation, round(1e6 * age)])
        true = float(np.interp(age, usage, severity))
        return _look(age, true + _SCATTER * float(rng.standard_normal()))


class _Book:
    """Costs of a policy."""

    def __init__(self) -> None:
        self.cost, self.failures, self.replaced = 0.0, 0, 0

    def fail(self) -> None:
        self.cost += _COSTS.late
        self.failures += 1

    def replace(self, left: float) -> None:
        self.cost += _COSTS.early * left
        self.replaced += 1

    def figures(self, units: int) -> dict[str, Any]:
        return {
            "cost": self.cost / units / _YEARS,
            "failures": self.failures / units / _YEARS,
            "replaced": self.replaced / units / _YEARS,
        }


def _kept(fleet: list[_Slot], quarter: float) -> dict[str, Any]:
    process, book = Process(relative_tables()), _Book()
    state = [(0, 0.0, GrowthFilter(process, seed=k)) for k in range(len(fleet))]
    for number in range(_YEARS * _QUARTERS):
        lives = {}
        for k, slot in enumerate(fleet):
            generation, age, flt = state[k]
            flt.update(slot.look(generation, age))
            rng = np.random.default_rng([73, number, k])
            units = flt.drawn(400, rng)
            future = look_ahead(process, units, Usage(), rng, course=False)
            lives[str(k)] = _prognosis(future)
        plan = plan_fleet(lives, _COSTS, risk=_RISK, horizon=_YEAR)
        due = {int(name) for visit in plan.visits if visit.use < quarter for name in visit.units}
        book.cost += _COSTS.visit * bool(due)
        for k, slot in enumerate(fleet):
            generation, age, flt = state[k]
            end = float(slot.life(generation)[0][-1])
            if k in due:
                book.replace(end - age)
                generation, age, flt = generation + 1, 0.0, GrowthFilter(process, seed=k)
                end = float(slot.life(generation)[0][-1])
            if end <= age + quarter:
                book.fail()
                generation, age = generation + 1, age + quarter - end
                flt = GrowthFilter(process, seed=k)
            else:
                age += quarter
            state[k] = (generation, age, flt)
    return book.figures(len(fleet))


def _prognosis(future: Future) -> Prognosis:
    return Prognosis("lives", future.usage, 0.9, future, ("limit",), (), (), ())


def _by_age(fleet: list[_Slot], quarter: float, limit: float) -> dict[str, Any]:
    """Replace each unit at the quarter before an age."""
    book = _Book()
    state = [(0, 0.0)] * len(fleet)
    for _ in range(_YEARS * _QUARTERS):
        due = {k for k, (_, age) in enumerate(state) if age + quarter > limit and age > 0.0}
        book.cost += _COSTS.visit * bool(due)
        state = [_next(fleet[k], item, quarter, k in due, book) for k, item in enumerate(state)]
    return book.figures(len(fleet))


def _knowing(fleet: list[_Slot], quarter: float) -> dict[str, Any]:
    """Replace each unit at the last quarter before its end."""
    book = _Book()
    state = [(0, 0.0)] * len(fleet)
    for _ in range(_YEARS * _QUARTERS):
        due = {
            k
            for k, (generation, age) in enumerate(state)
            if age > 0.0 and float(fleet[k].life(generation)[0][-1]) <= age + quarter
        }
        book.cost += _COSTS.visit * bool(due)
        state = [_next(fleet[k], item, quarter, k in due, book) for k, item in enumerate(state)]
    return book.figures(len(fleet))


def _next(
    slot: _Slot, state: tuple[int, float], quarter: float, due: bool, book: _Book
) -> tuple[int, float]:
    """Use a place for a quarter: replaced first where it is due."""
    generation, age = state
    if due:
        book.replace(float(slot.life(generation)[0][-1]) - age)
        generation, age = generation + 1, 0.0
    end = float(slot.life(generation)[0][-1])
    if end > age + quarter:
        return generation, age + quarter
    book.fail()
    return generation + 1, age + quarter - end
