"""The answer of a prognosis."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np

from elevon.number_text import count_text
from elevon.plain import STORED, WORKING, Plain, in_unit, key
from elevon.prognose.future import Future
from elevon.report import ReportTable
from elevon.results import Result
from elevon.units import to_display

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.report import Report


@dataclass(frozen=True)
class KnownFault(Plain):
    """What is known of one fault at the last inspection.

    Attributes
    ----------
    kind, place, unit, law : str
        The fault and the law that drives it.
    severity, interval : float, (float, float)
        Median and interval, of the prognosis' level.
    factor, factor_interval : float, (float, float)
        The unit's own factor on the law's rate.
    inspections : int
        Inspections that saw the fault.
    growing : float
        Probability that it grows; the factor is that of the futures in which it does.
    growth : mapping of str to float
        Probability that it grows by the law, and that its rate is free.
    """

    kind: str
    place: str
    unit: str
    law: str
    severity: float
    interval: tuple[float, float]
    factor: float
    factor_interval: tuple[float, float]
    inspections: int
    growing: Annotated[float, key("p_growing")] = 1.0
    growth: Annotated[Mapping[str, float], key("p_growth")] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """``KIND@PLACE``."""
        return f"{self.kind}@{self.place}"


@dataclass(frozen=True)
class Reserve(Plain):
    """A requirement: what it measures, its value now, that at which life ends, their unit."""

    name: str
    measure: str
    value: float
    threshold: float
    unit: str


@dataclass(frozen=True)
class OffLaw(Plain):
    """A diagnosis that contradicts law and history.

    Attributes
    ----------
    usage : float
        Of the inspection.
    fault : str
        ``KIND@PLACE``.
    deviations : float
        By which the severity stands above what was expected.
    """

    usage: float
    fault: str
    deviations: float

    @property
    def text(self) -> str:
        """In words."""
        side = "above" if self.deviations > 0.0 else "below"
        return (
            f"{self.fault} at {self.usage:g} stands {abs(self.deviations):.3g} deviations {side} "
            "what law and history expected"
        )


RISK = 0.01
"""Probability of failing before the next inspection that an answer accepts without being told."""
_OVER = 0.5  # probability of having failed from which a unit is replaced rather than looked at


@dataclass(frozen=True)
class NextAction(Plain):
    """What to do next.

    Attributes
    ----------
    kind : str
        ``inspect``; ``replace``: it has probably failed; ``none``: no end of life is in sight.
    within : float or None
        Use from now on until when; None where nothing is to be done.
    unit : str
        Of use.
    """

    kind: Literal["inspect", "replace", "none"]
    within: float | None
    unit: str

    @property
    def text(self) -> str:
        """In words, to begin an answer with."""
        name = self.kind.upper()
        if self.within is None:
            return "NO INSPECTION is due by the risk accepted."
        if self.within <= 0.0:
            return f"{name} now."
        return f"{name} within {count_text(self.within)} {self.unit}."


@dataclass(frozen=True)
class Branch(Plain):
    """Remaining life where something that is not certain is true.

    Attributes
    ----------
    what : str
        What is true in it.
    probability : float
        Of it.
    median : float
        Of its remaining life; infinite where no end is in sight.
    interval : (float, float)
        Of `level`.
    level : float
        Of the interval.
    unit : str
        Of use.
    """

    what: str
    probability: float
    median: Annotated[float, STORED]
    interval: Annotated[tuple[float, float], STORED]
    level: Annotated[float, STORED]
    unit: Annotated[str, STORED]

    COMPUTED: ClassVar = ("rul",)

    @property
    def rul(self) -> dict[str, object]:
        """Remaining useful life as `Prognosis.rul`."""
        return life_of(self.median, self.interval, self.level, self.unit)


def life_of(
    median: float, interval: tuple[float, float], level: float, unit: str
) -> dict[str, object]:
    """Return a remaining life as answers write it; null and `censored`: no end in sight."""
    low, high = (_number(end) for end in interval)
    return {
        "median": _number(median),
        "interval": [low, high],
        "level": level,
        "unit": unit,
        "censored": None in {_number(median), low, high},
    }


@dataclass(frozen=True)
class Prognosis(Result):
    """Remaining useful life of one unit.

    Attributes
    ----------
    unit : str
        Of use.
    usage : float
        Use at the last inspection.
    level : float
        Of all intervals.
    future : Future
        The samples.
    requirements : tuple of str
        Names, in the order of `Future.first`.
    known : tuple of KnownFault
        Severities and growth at the last inspection.
    reserve : tuple of Reserve
        Each requirement at the median severities.
    findings : tuple of str
        What the caller should know.
    serial : str
        Of the unit.
    seconds : dict of str to float
        Time of ``tables``, ``updates``, ``prediction``.
    off_law : tuple of OffLaw
        Faults whose last diagnoses, or all, contradict the law, with the greatest deviation.
    branches : tuple of Branch
        Remaining lives where what is not certain is true, and where it is not; else one.
    horizons : tuple of float
        N of `p_survive`; empty: round ones.
    page : callable or None
        Makes its page, date given.
    """

    unit: Annotated[str, key("rul.unit")]
    usage: float
    level: Annotated[float, key("rul.level")]
    future: Annotated[Future, STORED]
    requirements: Annotated[tuple[str, ...], key("names"), STORED]
    known: Annotated[tuple[KnownFault, ...], key("faults")]
    reserve: Annotated[tuple[Reserve, ...], key("requirements")]
    findings: tuple[str, ...]
    serial: str | None = None
    seconds: Annotated[Mapping[str, float], in_unit("s")] = field(
        default_factory=dict, compare=False
    )
    off_law: tuple[OffLaw, ...] = ()
    branches: tuple[Branch, ...] = ()
    horizons: Annotated[tuple[float, ...], STORED] = ()
    page: Annotated[Callable[[Prognosis, str | None], Report] | None, WORKING] = field(
        default=None, compare=False, repr=False
    )

    KIND: ClassVar = "prognosis"
    COMPUTED: ClassVar = (
        "status",
        "action",
        "rul",
        "p_survive",
        "first_requirement",
        "first_shares=first",
        "eol_samples=samples",
    )
    TABLE: ClassVar = "known"

    @property
    def status(self) -> Literal["ok", "off_law"]:
        """``ok``; ``off_law``: the history contradicts the law."""
        return "off_law" if self.off_law else "ok"

    @property
    def rul(self) -> dict[str, object]:
        """Remaining useful life of all branches together; null and `censored`: no end in sight."""
        return life_of(self.median, self.interval, self.level, self.unit)

    @property
    def action(self) -> NextAction:
        """What to do next, at a risk of `RISK`."""
        if self.survives(0.0) <= 1.0 - _OVER:
            return NextAction("replace", 0.0, self.unit)
        within = self.quantile(RISK)
        if not math.isfinite(within):
            return NextAction("none", None, self.unit)
        return NextAction("inspect", within, self.unit)

    @property
    def p_survive(self) -> list[tuple[float, float]]:
        """Probability of surviving the next N, at `horizons` or at round N."""
        return survival(self, self.horizons)

    @property
    def first_requirement(self) -> str | None:
        """The requirement that most likely fails first."""
        return next(iter(self.first)) if np.isfinite(self.future.end).any() else None

    @property
    def samples(self) -> int:
        """How many futures there are."""
        return len(self.future.end)

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        from elevon.prognose.page import sentence

        return sentence(self)

    def text_tables(self) -> list[ReportTable]:
        """Return the probability of surviving the next N, and what each requirement has left."""
        from elevon.prognose.page import severity_unit

        survived = [(f"{n:g}", f"{p:.3f}") for n, p in self.p_survive]
        rows = []
        for item in self.reserve:
            unit = severity_unit(item.unit)
            now, end = (f"{to_display(x, unit):.4g}" for x in (item.value, item.threshold))
            rows.append((item.name, now, end, unit, f"{self.first[item.name]:.3f}"))
        columns = ("requirement", "now", "life ends at", "unit", "fails first")
        return [
            ReportTable((f"next N {self.unit}", "probability of surviving"), survived),
            ReportTable(columns, rows),
        ]

    @property
    def remarks(self) -> Sequence[str]:
        """What the caller should know."""
        return self.findings

    def plot(self) -> Figure:
        """Return the probability of surviving over use."""
        from elevon.prognose.page import survival_figure

        return survival_figure(self)

    def report(self, *, date: str | None = None) -> Report:
        """Return its page, whole where it was computed in this process."""
        return super().report(date=date) if self.page is None else self.page(self, date)

    @property
    def median(self) -> float:
        """Median of the remaining useful life; infinite where no end is in sight."""
        return self.quantile(0.5)

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of `level`."""
        tail = 0.5 * (1.0 - self.level)
        return self.quantile(tail), self.quantile(1.0 - tail)

    def quantile(self, share: float) -> float:
        """Return a quantile of the remaining useful life."""
        ranked = np.sort(self.future.remaining)
        return float(ranked[min(int(share * len(ranked)), len(ranked) - 1)])

    @property
    def first(self) -> dict[str, float]:
        """Share of the futures in which each requirement fails first, largest first."""
        failed = self.future.first
        shares = {name: float(np.mean(failed == k)) for k, name in enumerate(self.requirements)}
        return dict(sorted(shares.items(), key=lambda item: -item[1]))

    def survives(self, more: float) -> float:
        """Return the probability of surviving `more` units of use."""
        return float(np.mean(self.future.remaining > more))


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def survival(result: Prognosis, horizons: Sequence[float] = ()) -> list[tuple[float, float]]:
    """Return the probability of surviving the next N, at round N or at those given."""
    if horizons:
        return [(float(n), result.survives(float(n))) for n in horizons]
    finite = result.future.remaining[np.isfinite(result.future.remaining)]
    far = float(np.quantile(finite, 0.99)) if len(finite) else 1000.0
    if far <= 0.0:
        return [(0.0, 0.0)]
    step = _round_up(far / 10.0)
    return [(k * step, result.survives(k * step)) for k in range(1, 11)]


def _round_up(value: float) -> float:
    """Return the next of 1, 2, 5, 10, ... at or above a value."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= value * (1.0 - 1e-9))
