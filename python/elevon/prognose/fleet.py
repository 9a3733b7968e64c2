"""When to maintain a small fleet: each unit alone, or several at one visit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError, RangeError
from elevon.number_text import count_text
from elevon.plain import STORED, WORKING, Plain, key
from elevon.prognose.answer import Prognosis
from elevon.report import ReportTable
from elevon.results import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.report import Report

_INSTANTS = 400  # at which a visit may be, of each unit's remaining life
_MOST = 6000  # instants of all units together
_SEEN = 0.95  # of the futures with an end, that the horizon holds
_FAILED = 0.5  # probability of having failed from which a unit has failed


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
        When each unit would be done by itself; without those that need no visit.
    visits : tuple of Visit
        Together.
    cost, cost_alone : float
        Expected cost of both until the horizon, all units.
    horizon : float
        Use from now on that costs are counted over.
    visit_cost : float or None
        Of one visit; shown on the page.
    """

    unit: str
    units: Annotated[Mapping[str, Prognosis], key("predictions"), STORED]
    alone: Annotated[Mapping[str, float], STORED]
    visits: tuple[Visit, ...]
    cost: float
    cost_alone: float
    horizon: float
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

    def text_tables(self) -> list[ReportTable]:
        """Return the visits, unit by unit."""
        return [ReportTable(self.HEADINGS, self.cells(), f"{self.unit} from now")]

    @property
    def remarks(self) -> Sequence[str]:
        """What the caller should know."""
        return self.findings

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
            f"{name}: no visit is planned in the next {count_text(self.horizon)} {self.unit}: "
            f"it fails in them with a probability of {1.0 - item.survives(self.horizon):.2g}"
            for name, item in self.units.items()
            if self.visit_of(name) is None
        ]
        return out + [f"{n}: {text}" for n, item in self.units.items() for text in item.findings]


def _use_text(value: float | None) -> str:
    return "no end in sight" if value is None else f"{value:.0f}"


def plan_fleet(
    units: Mapping[str, Prognosis],
    costs: Costs,
    *,
    risk: float | None = None,
    horizon: float | None = None,
) -> FleetPlan:
    """Choose the visits of least expected cost over a horizon.

    All units are used alike from now on. A unit that has failed is done now. The others are sorted
    by when they would be done alone; a visit takes neighbours in that order, and the best split is
    found exactly (dynamic programming). A unit that is cheaper left alone until the horizon gets no
    visit.

    Parameters
    ----------
    units : mapping of str to Prognosis
        Serial number to prediction, one unit of use for all.
    costs : Costs
        What is balanced.
    risk : float, optional
        Probability of failing before its visit that no unit may exceed.
    horizon : float, optional
        Use from now on that costs are counted over; default: 95 % of the ends in sight lie in it.

    Raises
    ------
    InputError
        No unit, or several units of use.
    RangeError
        A risk outside 0 to 1, a horizon that is not above 0.
    """
    if not units:
        raise InputError("a fleet needs at least one unit")
    kinds = {item.unit for item in units.values()}
    if len(kinds) > 1:
        raise InputError(f"the fleet is counted in several units: {', '.join(sorted(kinds))}")
    if risk is not None and not 0.0 < risk < 1.0:
        raise RangeError(f"risk {risk:g} is not between 0 and 1")
    far = _horizon(units.values()) if horizon is None else horizon
    if not (np.isfinite(far) and far > 0.0):
        raise RangeError(f"horizon {far:g} must be a finite number above 0")
    failed = [name for name, item in units.items() if item.survives(0.0) <= 1.0 - _FAILED]
    instants = _instants(units.values(), far)
    tables = {
        name: _expected(item, instants, costs, far, risk)
        for name, item in units.items()
        if name not in failed
    }
    left = {name: costs.late * (1.0 - units[name].survives(far)) for name in tables}
    due = [name for name, cost in tables.items() if _due(cost, left[name], costs.visit, risk)]
    alone = dict.fromkeys(failed, 0.0) | {
        name: float(instants[tables[name].argmin()]) for name in due
    }
    order = sorted(due, key=lambda name: alone[name])
    visits, cost = _grouped(order, tables, instants, costs.visit, failed)
    waiting = sum(value for name, value in left.items() if name not in due)
    single = sum(float(tables[name].min()) + costs.visit for name in due)
    return FleetPlan(
        next(iter(kinds)),
        units,
        alone,
        visits,
        cost + waiting,
        single + waiting + costs.visit * len(failed),
        far,
        costs.visit,
    )


def _horizon(units: Iterable[Prognosis]) -> float:
    """Return a use in which nearly all ends of each unit lie that are in sight."""
    far = 1.0
    for item in units:
        ends = item.future.remaining
        known = ends[np.isfinite(ends)]
        far = max(far, float(np.quantile(known, _SEEN)) if len(known) else far)
    return far


def _instants(units: Iterable[Prognosis], far: float) -> Floats:
    """Return when a visit may be: as finely as each unit's life asks, one that ends soon, too."""
    ends = []
    for item in units:
        lives = np.minimum(item.future.remaining, far)
        ends += [float(np.quantile(lives, share)) for share in (0.02, 0.5, 0.95)]
    ends = [min(max(end, 1.0), far) for end in (*ends, 1.0, far)]
    count = min(max(_MOST // len(set(ends)), 8), _INSTANTS)
    return np.unique(np.concatenate([np.linspace(0.0, end, count) for end in set(ends)]))


def _expected(
    item: Prognosis, instants: Floats, costs: Costs, far: float, risk: float | None
) -> Floats:
    """Return the expected cost of doing a unit at each instant, shape (t,).

    Life beyond the horizon is not thrown away by a visit. Instants at which the risk is exceeded
    cost as the last that keeps it, and the failures besides: no plan takes them.
    """
    lives = np.sort(np.minimum(item.future.remaining, far))
    count = len(lives)
    before = np.searchsorted(lives, instants, side="left")
    failed = np.searchsorted(np.sort(item.future.remaining), instants, side="left") / count
    left = np.append(np.cumsum(lives[::-1])[::-1], 0.0)[before]
    lost = left / count - (1.0 - before / count) * instants
    cost = costs.early * lost + costs.late * failed
    if risk is None:
        return np.asarray(cost)
    allowed = failed <= risk
    last = int(np.flatnonzero(allowed)[-1]) if allowed.any() else 0
    return np.asarray(np.where(np.arange(len(instants)) <= last, cost, np.inf))


def _due(cost: Floats, left: float, visit: float, risk: float | None) -> bool:
    """Return whether a visit within the horizon is worth it, or asked for by the risk."""
    if risk is not None and not np.isfinite(cost[-1]):
        return True
    return float(cost.min()) + visit < left


def _grouped(
    order: Sequence[str],
    table: Mapping[str, Floats],
    instants: Floats,
    visit: float,
    failed: Sequence[str],
) -> tuple[tuple[Visit, ...], float]:
    """Split the order into visits; the least cost of the first j units for each j.

    Where units have failed there is a visit now in any case, which the first ones may join.
    """
    rows = np.array([table[name] for name in order]).reshape(len(order), len(instants))
    best, since, at = [visit if failed else 0.0], [0], [0.0]
    for j in range(1, len(order) + 1):
        options = []
        together = np.zeros(len(instants))
        for i in range(j - 1, -1, -1):
            together = together + rows[i]
            options.append((best[i] + visit + float(together.min()), i, together.argmin()))
        if failed:
            options.append((visit + float(rows[:j, 0].sum()), -1, 0))
        cost, first, instant = min(options)
        best.append(cost)
        since.append(first)
        at.append(float(instants[instant]))
    out: list[Visit] = []
    j, now = len(order), list(failed)
    while j > 0:
        i = since[j]
        if i < 0:
            now += order[:j]
            break
        out.append(Visit(at[j], tuple(order[i:j])))
        j = i
    out += [Visit(0.0, tuple(now))] if now else []
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
