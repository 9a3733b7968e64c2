"""When to maintain a small fleet: each unit alone, or several at one visit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError, RangeError
from elevon.plain import STORED, WORKING, Plain, key
from elevon.prognose.answer import Prognosis
from elevon.results import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.report import Report

_NEVER = 1e30  # a cost that no plan takes
_INSTANTS = 400  # at which a visit may be, of each unit's remaining life


@dataclass(frozen=True)
class Costs:
    """What the plan balances, in one currency.

    Attributes
    ----------
    early : float
        Of one unit of use of a part's life that is thrown away.
    late : float
        Of a failure in service.
    visit : float
        Of a visit to the hangar, however many units are done at it.
    """

    early: float
    late: float
    visit: float

    def __post_init__(self) -> None:
        for name in ("early", "late", "visit"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise RangeError(f"cost {name} = {value:g} must be a finite number, 0 or more")


@dataclass(frozen=True)
class Visit(Plain):
    """A visit at `use` from now, and the units done at it."""

    use: float
    units: tuple[str, ...]


@dataclass(frozen=True)
class FleetPlan(Result):
    """The cheapest visits.

    Attributes
    ----------
    unit : str
        Of use.
    units : mapping of str to Prognosis
        The fleet.
    alone : mapping of str to float
        When each unit would be done by itself; without those of no end in sight.
    visits : tuple of Visit
        Together.
    cost, cost_alone : float
        Expected cost of both, all units.
    visit_cost : float or None
        Of one visit; shown on the page.
    """

    unit: str
    units: Annotated[Mapping[str, Prognosis], key("predictions"), STORED]
    alone: Annotated[Mapping[str, float], STORED]
    visits: tuple[Visit, ...]
    cost: float
    cost_alone: float
    visit_cost: Annotated[float | None, WORKING] = None

    HEADINGS: ClassVar = ("unit", "remain", "90 %", "alone at", "visit at", "failed before")
    KIND: ClassVar = "fleet"
    COMPUTED: ClassVar = ("status", "rows=table", "findings")
    TABLE: ClassVar = "table"
    COLUMNS: ClassVar = ("unit", "rul", "interval", "alone", "visit", "p_failed_before")
    status: ClassVar = "ok"

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        return (
            f"{len(self.visits)} visit(s) for {len(self.units)} units: expected cost "
            f"{self.cost:.4g}, {self.cost_alone:.4g} with each unit alone."
        )

    @property
    def table(self) -> list[dict[str, Any]]:
        """One row a unit: its life, when it would be done alone, its visit."""
        return [self._row(name, item) for name, item in self.units.items()]

    def _row(self, name: str, item: Prognosis) -> dict[str, Any]:
        visit = self.visit_of(name)
        return {
            "unit": name,
            "rul": item.rul["median"],
            "interval": item.rul["interval"],
            "alone": self.alone.get(name),
            "visit": visit,
            "p_failed_before": None if visit is None else 1.0 - item.survives(visit - 1e-9),
        }

    def cells(self) -> list[tuple[str, ...]]:
        """Return the table's rows as text, under `HEADINGS`."""
        return [
            (
                str(row["unit"]),
                _use_text(row["rul"]),
                " to ".join(_use_text(value) for value in row["interval"]),
                _use_text(row["alone"]),
                _use_text(row["visit"]),
                "-" if row["p_failed_before"] is None else f"{row['p_failed_before']:.3f}",
            )
            for row in self.table
        ]

    def plot(self) -> Figure:
        """Return the remaining lives and the visits."""
        return fleet_figure(self)

    def report(self, *, date: str | None = None) -> Report:
        """Return the page of the plan."""
        from elevon.report import Report, ReportTable

        page = Report("Maintenance of a fleet", self.headline, date=date)
        section = page.section(f"Remaining {self.unit}")
        section.figure(
            self.plot(), "Remaining life: median and 90 %; blue: the visit at which it is done."
        )
        price = "" if self.visit_cost is None else f"A visit costs {self.visit_cost:g}."
        section.table(ReportTable(self.HEADINGS, self.cells(), price))
        if self.findings:
            section.points(self.findings)
        return page

    def visit_of(self, name: str) -> float | None:
        """Return when a unit is done; None where no end of its life is in sight."""
        return next((visit.use for visit in self.visits if name in visit.units), None)

    @property
    def findings(self) -> list[str]:
        """What each unit's prediction must be read with, its name before it."""
        out = [
            f"{name}: no visit is planned: no end of its life is in sight in half of the futures"
            for name in self.units
            if self.visit_of(name) is None
        ]
        return out + [f"{n}: {text}" for n, item in self.units.items() for text in item.findings]


def _use_text(value: float | None) -> str:
    return "no end in sight" if value is None else f"{value:.0f}"


def plan_fleet(units: Mapping[str, Prognosis], costs: Costs) -> FleetPlan:
    """Choose the visits of least expected cost.

    All units are used alike from now on. Units are sorted by when they would be done alone; a
    visit takes neighbours in that order, and the best split is found exactly (dynamic programming).

    Parameters
    ----------
    units : mapping of str to Prognosis
        Serial number to prediction, one unit of use for all.
    costs : Costs
        What is balanced.

    Raises
    ------
    InputError
        No unit, or several units of use.
    """
    if not units:
        raise InputError("a fleet needs at least one unit")
    kinds = {item.unit for item in units.values()}
    if len(kinds) > 1:
        raise InputError(f"the fleet is counted in several units: {', '.join(sorted(kinds))}")
    ending = {name: item for name, item in units.items() if np.isfinite(item.median)}
    instants = _instants(ending.values())
    table = {name: _expected(item, instants, costs) for name, item in ending.items()}
    alone = {name: float(instants[cost.argmin()]) for name, cost in table.items()}
    order = sorted(ending, key=lambda name: alone[name])
    visits, cost = _grouped(order, table, instants, costs.visit)
    single = sum(float(c.min()) for c in table.values()) + costs.visit * len(ending)
    return FleetPlan(next(iter(kinds)), units, alone, visits, cost, single, costs.visit)


def _instants(units: Iterable[Prognosis]) -> Floats:
    """Return when a visit may be: as finely as each unit's life asks, one that ends soon, too."""
    ends = [max(float(np.quantile(_finite(item), 0.95)), 1.0) for item in units]
    return np.unique(np.concatenate([np.linspace(0.0, end, _INSTANTS) for end in [*ends, 1.0]]))


def _finite(item: Prognosis) -> Floats:
    """Return remaining lives; those without end in sight count as the longest that has one."""
    lives = item.future.remaining
    known = lives[np.isfinite(lives)]
    return np.where(np.isfinite(lives), lives, known.max(initial=0.0))


def _expected(item: Prognosis, instants: Floats, costs: Costs) -> Floats:
    """Expected cost of doing a unit at each instant, shape (t,); one that has failed waits not."""
    lives = np.sort(_finite(item))
    failed = np.searchsorted(lives, instants, side="left") / len(lives)
    left = np.append(np.cumsum(lives[::-1])[::-1], 0.0)[np.searchsorted(lives, instants)]
    lost = left / len(lives) - (1.0 - failed) * instants
    cost = costs.early * lost + costs.late * failed
    over = item.median <= 0.0
    return np.asarray(np.where(over & (instants > 0.0), _NEVER, cost))


def _grouped(
    order: Sequence[str], table: Mapping[str, Floats], instants: Floats, visit: float
) -> tuple[tuple[Visit, ...], float]:
    """Split the order into visits; the least cost of the first j units for each j."""
    rows = np.array([table[name] for name in order])
    sums = np.vstack((np.zeros(len(instants)), np.cumsum(rows, axis=0)))
    best, since = [0.0], [0]
    for j in range(1, len(order) + 1):
        costs = [best[i] + visit + float((sums[j] - sums[i]).min()) for i in range(j)]
        since.append(int(np.argmin(costs)))
        best.append(min(costs))
    out: list[Visit] = []
    j = len(order)
    while j > 0:
        i = since[j]
        use = float(instants[(sums[j] - sums[i]).argmin()])
        out.append(Visit(use, tuple(order[i:j])))
        j = i
    return tuple(reversed(out)), best[-1]


def fleet_figure(plan: FleetPlan) -> Figure:
    """Draw each unit's remaining life and the visits."""
    from elevon.report.figures import COLOURS, new_figure

    names = sorted(plan.units, key=lambda name: plan.alone.get(name, np.inf), reverse=True)
    ends = [v for item in plan.units.values() for v in item.interval if np.isfinite(v)]
    far = 1.1 * max([*ends, 1.0])
    with new_figure(width=8.5, height=1.2 + 0.42 * len(names)) as (figure, axis):
        for k, name in enumerate(names):
            item = plan.units[name]
            low, high = np.minimum(item.interval, far)
            axis.plot([low, high], [k, k], color=COLOURS["orange"], lw=6, alpha=0.5)
            axis.plot([min(item.median, far)], [k], "o", color=COLOURS["orange"])
            if (visit := plan.visit_of(name)) is not None:
                axis.plot([visit], [k], "|", color=COLOURS["blue"], ms=16, mew=2.5)
        for done in plan.visits:
            axis.axvline(done.use, color=COLOURS["blue"], lw=0.8, ls=":")
        axis.set(xlabel=f"{plan.unit} from now", yticks=range(len(names)), yticklabels=names)
        axis.set_xlim(left=0.0)
    return figure
