"""What `nasa-separation` seeds and reports."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np

from elevon.arrays import Floats
from elevon.plain import REMAINDER, WORKING, fields_of
from elevon.report.checks import Check, CheckedResult
from elevon_cases.nasa.features import Impact, ImpactTrace


@dataclass(frozen=True, slots=True)
class Seeded:
    """A fault, the severity seeded, and the feature named for it beforehand."""

    name: str
    grammar: str
    severity: float
    unit: str
    feature: str

    def text(self, share: float = 1.0) -> str:
        """Return the fault in the grammar of the command line, at a share of its severity."""
        return f"{self.grammar}={share * self.severity:g}{self.unit and ' ' + self.unit}"


@dataclass(frozen=True, slots=True)
class SeparationRow:
    """How far one fault stands from healthy in one profile under one load.

    Attributes
    ----------
    fault, feature, unit, profile : str
        What.
    load : float
        N, opposing.
    healthy, faulty : float
        Means of the feature, in its unit.
    effect : Effect
        In healthy standard deviations, with its interval.
    half : Effect or None
        Of half the severity, where it was run.
    winner : bool or None
        Whether this profile shows the fault best under this load; None: no profile can be named.
    power : float
        Probability that another such experiment names the best profile of this fault and load.
    draws : int or None
        Faulty draws (and as many times more healthy ones) that would name it, were the effects as
        estimated; None where it is named or where the fault is not shown.
    """

    fault: str
    feature: str
    unit: str
    profile: str
    load: float
    healthy: float
    faulty: float
    effect: Effect
    half: Effect | None
    winner: bool | None
    power: float
    draws: int | None

    def to_dict(self) -> dict[str, object]:
        """Return one row of the command's JSON object."""
        return fields_of(
            self, "fault", "profile", "load_n=load", "feature", "unit", "healthy", "faulty",
            "effect_size=effect.size", "interval=effect.interval", "half_severity=half.size",
            "winner", "power", "draws_needed=draws",
        )  # fmt: skip


@dataclass(frozen=True)
class SeparationResult(CheckedResult):
    """Everything `elevon reproduce nasa-separation` reports.

    Attributes
    ----------
    rows : list of SeparationRow
        One a fault, load and profile.
    impacts : list of Impact
        Excess of the load cell's peak that the gap makes.
    null_rate, null_tables : float
        Share of the healthy-against-healthy comparisons above the threshold, and of the whole
        tables that hold any.
    healthy, reassemblies : int
        Healthy units, and units of each fault.
    level : float
        Of every interval, so that all of them hold together with 95 %.
    traces : list of ImpactTrace
        Load-cell force of the nominal actuator about a reversal, with and without the gap.
    """

    rows: list[SeparationRow]
    impacts: list[Impact]
    checks: list[Check]
    null_rate: float
    null_tables: float
    seed: int
    healthy: int
    reassemblies: int
    level: float
    traces: Annotated[list[ImpactTrace], WORKING] = field(default_factory=list)
    meta: Annotated[dict[str, Any], REMAINDER] = field(default_factory=dict)

    def winners(self) -> dict[tuple[str, float], str | None]:
        """Return the best profile of each fault and load, None where none can be named."""
        best: dict[tuple[str, float], str | None] = {}
        for row in self.rows:
            best.setdefault((row.fault, row.load), None)
            if row.winner:
                best[row.fault, row.load] = row.profile
        return best


POWER = 0.95
"""A best profile is named where another experiment would name it again this often: intervals that
just part in one draw of the units overlap in every other."""
PIVOTS = 200_000
"""Draws of the pivots; tails of 1e-4 then hold 20 of them."""


@dataclass(frozen=True, slots=True)
class Effect:
    """Distance of a faulty group from healthy in healthy standard deviations, signed.

    Attributes
    ----------
    size, low, high : float
        The effect and its interval.
    """

    size: float
    low: float
    high: float

    @property
    def interval(self) -> tuple[float, float]:
        """Both ends."""
        return self.low, self.high

    @property
    def bounds(self) -> tuple[float, float]:
        """Interval of the distance whatever its sign."""
        ends = sorted((abs(self.low), abs(self.high)))
        return (0.0 if self.low <= 0.0 <= self.high else ends[0]), ends[1]

    @property
    def significant(self) -> bool:
        """Whether the interval leaves out zero."""
        return self.low > 0.0 or self.high < 0.0


class EffectScale:
    """Glass's effect size: the mean's change over the healthy standard deviation.

    The interval is that of the generalised pivots (Weerahandi 1993): both means and the healthy
    deviation vary as normal samples of these sizes make them, with unequal deviations. A small
    group may miss the tail of its population: its deviation counts as no less than the healthy
    one. The point estimate has Hedges' correction for the small sample of the deviation.

    Parameters
    ----------
    healthy, faulty : int
        Numbers of draws of the groups, at least 2.
    level : float
        Level of one interval, 0 to 1.
    pivots : int
        Draws of the pivots: many where the level is near 1.
    """

    def __init__(self, healthy: int, faulty: int, level: float, pivots: int = PIVOTS) -> None:
        rng = np.random.default_rng(0)
        self._level = level
        self._deviation = np.sqrt((healthy - 1) / rng.chisquare(healthy - 1, pivots))
        self._healthy = rng.standard_normal(pivots) / math.sqrt(healthy)
        self._faulty = rng.standard_t(faulty - 1, pivots) / math.sqrt(faulty)
        self._correction = 1.0 - 3.0 / (4.0 * (healthy - 1) - 1.0)

    def effect(self, healthy: Floats, faulty: Floats) -> Effect:
        """Return the effect of one feature; a population that does not vary has none.

        Parameters
        ----------
        healthy, faulty : ndarray
            One value a unit, of the sizes given to the scale.
        """
        deviation, faulty_deviation = float(np.std(healthy, ddof=1)), float(np.std(faulty, ddof=1))
        moved = float(np.mean(faulty) - np.mean(healthy))
        if deviation == 0.0:
            return Effect(float("nan"), float("nan"), float("nan"))
        change = (moved - max(faulty_deviation, deviation) * self._faulty) / (
            deviation * self._deviation
        )
        ends = 0.5 * (1.0 - self._level), 0.5 * (1.0 + self._level)
        low, high = np.quantile(change - self._healthy, ends)
        return Effect(self._correction * moved / deviation, float(low), float(high))


def null_p(healthy: Floats, faulty: Floats) -> Floats:
    """Return the probability that equal means differ so much, along the first axis.

    Welch's t, with the deviation of the second, small group no less than that of the first, as
    in `EffectScale`.
    """
    from scipy.stats import t

    large, small = len(healthy), len(faulty)
    variance = np.var(healthy, axis=0, ddof=1)
    ratio = np.maximum(np.var(faulty, axis=0, ddof=1), variance) / small
    other = variance / large
    freedom = (ratio + other) ** 2 / (ratio**2 / (small - 1) + other**2 / (large - 1))
    moved = np.abs(np.mean(healthy, axis=0) - np.mean(faulty, axis=0))
    return np.asarray(2.0 * t.sf(moved / np.sqrt(ratio + other), freedom))


@dataclass(frozen=True, slots=True)
class GroupComparison:
    """Which of several effects is the largest, if the intervals tell.

    Attributes
    ----------
    winner : int or None
        Index of the effect whose interval lies above all others, if another such experiment
        would find that again with the probability `POWER`.
    power : float
        Probability that in another such experiment the intervals of the two largest effects
        part, were they as estimated.
    factor : float
        Times as many draws would give that probability `POWER`; infinite where the effects are
        equal.
    """

    winner: int | None
    power: float
    factor: float


def compare_profiles(effects: Sequence[Effect], level: float) -> GroupComparison:
    """Compare effects by their distance from zero; `level` is that of their intervals."""
    from scipy.stats import norm

    order = sorted(range(len(effects)), key=lambda i: -abs(effects[i].size))
    best, others = effects[order[0]], [effects[i] for i in order[1:]]
    # The most dangerous rival is the one whose interval reaches highest.
    rival = max(others, key=lambda effect: effect.bounds[1])
    gap = abs(best.size) - abs(rival.size)
    halves = abs(best.size) - best.bounds[0], rival.bounds[1] - abs(rival.size)
    z = float(norm.ppf(0.5 + 0.5 * level))
    spread = math.hypot(halves[0] / z, halves[1] / z)
    power = float(norm.cdf((gap - sum(halves)) / spread))
    named = best.significant and best.bounds[0] > rival.bounds[1] and power >= POWER
    apart = sum(halves) + float(norm.ppf(POWER)) * spread
    factor = (apart / gap) ** 2 if gap > 0.0 else math.inf
    return GroupComparison(order[0] if named else None, power, factor)
