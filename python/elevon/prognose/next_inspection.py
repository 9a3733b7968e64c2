"""When to look again, and with which test, for a risk of failing before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from elevon.arrays import Floats
from elevon.errors import RangeError
from elevon.number_text import count_text
from elevon.plain import Plain
from elevon.prognose.answer import NextAction
from elevon.prognose.future import MODEL_ERROR, look_ahead
from elevon.prognose.growth import GrowthFilter
from elevon.prognose.mission import Usage
from elevon.prognose.process import Process
from elevon.report import ReportTable
from elevon.results import Result

if TYPE_CHECKING:
    from elevon.prognose.answer import Prognosis
    from elevon.prognose.fleet import Costs
    from elevon.prognose.manner import GrowthPrior
    from elevon.prognose.observation import Inspection
    from elevon.prognose.response import ResponseTables


_SAMPLES = 1000


@dataclass(frozen=True)
class Assumed(Plain):
    """Remaining life where something is taken for certain; null: no end in sight."""

    name: str
    median: float | None
    low: float | None
    high: float | None


def assumptions(
    inspections: Sequence[Inspection],
    tables: ResponseTables,
    usage: Usage,
    *,
    priors: Mapping[str, tuple[GrowthPrior, GrowthPrior]] | None = None,
    level: float,
    seed: int = 0,
) -> tuple[Assumed, ...]:
    """Predict again, with one thing at a time taken for certain.

    Parameters
    ----------
    inspections : sequence of Inspection
        Of the unit.
    tables : ResponseTables
        Of actuator and mission.
    usage : Usage
        Of the future.
    priors : mapping, optional
        As `GrowthFilter` takes them.
    level : float
        Of the intervals.
    seed : int
        Of chance.
    """
    alone = replace(tables, laws=tuple(replace(law, only=True) for law in tables.laws))
    steady = {"wander": False}
    cases: tuple[tuple[str, ResponseTables, dict[str, bool], float, Usage], ...] = (
        ("as it stands", tables, {}, MODEL_ERROR, usage),
        ("growth is by the laws alone", alone, {}, MODEL_ERROR, usage),
        ("rates stay as they are now", tables, steady, MODEL_ERROR, usage),
        ("the model has no error", tables, {}, 0.0, usage),
        ("loads are the mission's", tables, {}, MODEL_ERROR, Usage()),
    )
    out = []
    for name, of, how, error, future in cases:
        if name.startswith("loads") and usage == future:
            continue
        flt = GrowthFilter(Process(of, **how), seed=seed, priors=priors)
        for item in inspections:
            flt.update(item)
        rng = np.random.default_rng([25, seed])
        units = flt.drawn(_SAMPLES, rng)
        outlook = look_ahead(flt.process, units, future, rng, model_error=error, course=False)
        out.append(_assumed(name, outlook.remaining, level))
    return tuple(out)


def _assumed(name: str, lives: Floats, level: float) -> Assumed:
    ranked, tail = np.sort(lives), 0.5 * (1.0 - level)
    ends = (float(ranked[int(share * len(ranked))]) for share in (0.5, tail, 1.0 - tail))
    return Assumed(name, *(value if np.isfinite(value) else None for value in ends))


@dataclass(frozen=True)
class NextInspection(Result):
    """When to look next.

    Attributes
    ----------
    unit : str
        Of use.
    usage : float
        Use at the last inspection.
    risk : float
        Probability of failing before the next one that is accepted.
    within : float or None
        Use from now on in which the risk is not exceeded; None: no end of life reaches it.
    requirement : str or None
        That most likely fails first.
    status : str
        Of the prediction.
    test : str or None
        Standard test that is expected to tell most; None where none is known to.
    assumptions : tuple of Assumed
        What each assumption costs.
    findings : tuple of str
        Of the prediction, and of the choice.
    serial : str or None
        Of the unit.
    cost_rates : mapping of str to float
        Expected cost of one unit of use, over the horizon: ``inspect`` within `within`, ``replace``
        now, or ``wait`` without either.
    horizon : float
        Use from now on that they are counted over.
    """

    unit: str
    usage: float
    risk: float
    within: float | None
    requirement: str | None
    status: str
    test: str | None
    assumptions: tuple[Assumed, ...]
    findings: tuple[str, ...]
    serial: str | None = None
    cost_rates: Mapping[str, float] = field(default_factory=dict)
    horizon: float = 0.0

    KIND: ClassVar = "next-inspection"
    COMPUTED: ClassVar = ("action",)
    TABLE: ClassVar = "assumptions"

    @property
    def action(self) -> NextAction:
        """The cheapest of inspecting, replacing now and waiting that keeps the risk."""
        kind = min(self.cost_rates, key=self.cost_rates.__getitem__, default="inspect")
        if kind == "replace" and self.within is not None:
            return NextAction("replace", 0.0, self.unit)
        if self.within is None:
            return NextAction("none", None, self.unit)
        return NextAction("inspect", self.within, self.unit)

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        how = f" with the test {self.test}" if self.test else ""
        if self.within is None:
            return f"No end of life is in sight at a risk of {self.risk:.2g}; look at leisure{how}."
        if self.action.kind == "replace":
            inspect, now = (self.cost_rates[name] for name in ("inspect", "replace"))
            return (
                f"Replace now: it costs {now:.3g} for each of the next {count_text(self.horizon)} "
                f"{self.unit}, to inspect {inspect:.3g}."
            )
        if self.within <= 0.0:
            return f"Inspect now{how}: the risk that the unit has failed exceeds {self.risk:.2g}."
        within = count_text(self.within)
        return (
            f"Inspect within {within} {self.unit}{how}: until then the unit fails with a "
            f"probability of at most {self.risk:.2g}."
        )

    def text_tables(self) -> list[ReportTable]:
        """Return the remaining life with one assumption after the other taken for certain."""
        rows = [
            (item.name, *("no end in sight" if use is None else count_text(use)
                          for use in (item.median, item.low, item.high)))
            for item in self.assumptions
        ]  # fmt: skip
        columns = ("assumed", "median", "low", "high")
        return [ReportTable(columns, rows, f"remaining {self.unit}")]

    @property
    def remarks(self) -> Sequence[str]:
        """What the caller should know."""
        return self.findings


def next_inspection(
    result: Prognosis,
    risk: float,
    costs: Costs | None = None,
    *,
    test: str | None,
    assumed: Sequence[Assumed] = (),
    findings: Sequence[str] = (),
) -> NextInspection:
    """Return when the probability of having failed reaches a risk, and what is cheapest.

    Parameters
    ----------
    result : Prognosis
        Of the unit.
    risk : float
        Accepted; at least what the number of futures can show.
    costs : Costs, optional
        Of what is weighted; without them nothing is.
    test : str or None
        What to look with.
    assumed, findings
        As in `NextInspection`.

    Raises
    ------
    RangeError
        The risk is not between that of a few futures and 1.
    """
    least = _FEW / result.samples
    if not least <= risk < 1.0:
        raise RangeError(
            f"--risk {risk:g}: is not from {least:g} ({_FEW} of {result.samples} futures; "
            "--particles gives more) to 1"
        )
    ranked = np.sort(result.future.remaining)
    end = float(ranked[int(risk * len(ranked))])
    rates, horizon = _cost_rates(ranked, end, costs) if costs is not None else ({}, 0.0)
    return NextInspection(
        result.unit,
        result.usage,
        risk,
        end if np.isfinite(end) else None,
        result.first_requirement,
        result.status,
        test,
        tuple(assumed),
        (*findings, *result.findings),
        result.serial,
        rates,
        horizon,
    )


_SEEN = 0.95  # of the ends in sight, that the horizon holds


def _cost_rates(lives: Floats, within: float, costs: Costs) -> tuple[dict[str, float], float]:
    """Return the cost of one unit of use by each choice, and the horizon.

    An inspection shows what is left: the unit is then replaced just before its end, where that
    lies within the horizon. What is replaced now throws its life away.
    """
    known = lives[np.isfinite(lives)]
    far = max(float(np.quantile(known, _SEEN)), 1.0) if len(known) else 1.0
    ends = float(np.mean(lives <= far))
    before = float(np.mean(lives <= min(within, far)))
    total = {
        "inspect": costs.visit + costs.late * before + (ends - before) * costs.visit,
        "replace": costs.visit + costs.early * float(np.mean(np.minimum(lives, far))),
        "wait": costs.late * ends,
    }
    return {name: value / far for name, value in total.items()}, far


_FEW = 5
"""Futures that a probability needs to be seen."""
