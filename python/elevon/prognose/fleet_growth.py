"""Growth as a fleet's histories have it: rate, form, spread, noise, misses, covariates; lives."""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from elevon.arrays import Floats
from elevon.errors import FormatError, InputError, Interrupted, unknown
from elevon.files import read_regular
from elevon.plain import Plain
from elevon.prognose.answer import Prognosis
from elevon.prognose.fault_filter import FaultFilter
from elevon.prognose.future import Future
from elevon.prognose.growth import GrowthFilter
from elevon.prognose.law import Law
from elevon.prognose.lives import LifeDistribution, fit_lives
from elevon.prognose.manner import BESIDE_LAW, WITHOUT_LAW, GrowthPrior, prior_of
from elevon.prognose.observation import Inspection, Seen
from elevon.prognose.predict import LEVEL
from elevon.prognose.process import Process
from elevon.prognose.response import ResponseTables
from elevon.progress import Progress
from elevon.report import ReportTable
from elevon.results import Result

_KNOTS = 11  # of a form
_FINISHED = 3  # lives that a form needs
_EXACT = 0.02  # deviation of the logarithm of a life that is known
_SEEN = 0.2  # of the units that grow so, before a prior is learned of it
_AT_END = 0.02  # of the limit: deviation of the severity at which a unit failed; ASSUMED
_SLOWEST = 0.1  # of the mean pace: no form stands still
_LARGEST = 2**24  # bytes of a file
_KNOWN = 0.8  # of a posterior's variance that can be its prior's, at most
_DRAWN = 2000  # lives of a unit
_NEEDED = ("unit", "use", "failed")
_MOSTLY = 0.5
_WIDE = replace(WITHOUT_LAW, rate=0.0, spread=20.0)  # of lives, where nothing is known
_RANGE = (0.1, 0.9)  # of the units, that a learned range holds


@dataclass(frozen=True)
class FleetUnit:
    """One unit of a fleet.

    Attributes
    ----------
    name : str
        Of it.
    inspections : tuple of Inspection
        None where only its life is known.
    use : float
        When it failed or was removed, or until now.
    failed : bool
        Whether it failed then.
    covariates : mapping of str to str
        As the file has them.
    """

    name: str
    inspections: tuple[Inspection, ...]
    use: float
    failed: bool
    covariates: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class LearnedGrowth(Plain):
    """Growth of one fault in the units of a fleet.

    Attributes
    ----------
    units : int
        Histories that showed it.
    trust : float
        Probability that a unit's growth follows the law.
    with_law, free : GrowthPrior
        Of units that follow the law, and that do not.
    life : float
        Use of a median life at a free rate.
    form : tuple of (float, float)
        Relative severity and share of the life after which it is reached; empty: in proportion.
    covariates : mapping of str to float
        What one unit of a covariate (or being of a class, ``NAME=CLASS``) adds to the logarithm of
        the rate.
    reference : mapping of str to float
        Mean of each covariate over the fleet.
    """

    units: int
    trust: float
    with_law: GrowthPrior
    free: GrowthPrior
    life: float
    form: tuple[tuple[float, float], ...] = ()
    covariates: Mapping[str, float] = field(default_factory=dict)
    reference: Mapping[str, float] = field(default_factory=dict)

    @property
    def spread(self) -> float:
        """Deviation of the logarithm of the rate, of most units."""
        return self.with_law.spread if self.trust >= _MOSTLY else self.free.spread

    def law(self, law: Law) -> Law:
        """Return a law with what the fleet says of it."""
        return replace(law, trust=min(law.trust, self.trust), life=self.life, form=self.form)

    def priors(self, covariates: Mapping[str, str]) -> tuple[GrowthPrior, GrowthPrior]:
        """Return priors of a unit with covariates.

        Raises
        ------
        InputError
            A covariate that the fleet has not, or one that is missing.
        """
        shift = 0.0
        columns = _columns(covariates, self.covariates, "covariate")
        for name, effect in self.covariates.items():
            shift += effect * (columns.get(name, self.reference[name]) - self.reference[name])
        return tuple(replace(p, rate=p.rate + shift) for p in (self.with_law, self.free))  # type: ignore[return-value]


@dataclass(frozen=True)
class FleetGrowth(Result):
    """What a fleet says of growth and of lives.

    Attributes
    ----------
    unit : str
        Of use.
    count, failed : int
        Units of the fleet, and of them those that failed.
    growth : mapping of str to LearnedGrowth
        ``KIND@PLACE`` to its growth; empty where no history shows any.
    lives : LifeDistribution or None
        Distribution of lives, where the file of lives was given.
    findings : tuple of str
        What the reader should know.
    """

    unit: str
    count: int
    failed: int
    growth: Mapping[str, LearnedGrowth]
    lives: LifeDistribution | None = None
    findings: tuple[str, ...] = ()

    KIND: ClassVar = "growth"
    COMPUTED: ClassVar = ("status",)
    TABLE: ClassVar = "growth"
    status: ClassVar = "ok"

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        texts = [
            f"{key}: a median life of {item.life:.4g} {self.unit}, rates within a factor of "
            f"{np.exp(1.6449 * item.spread):.3g} (90 %)"
            for key, item in self.growth.items()
        ]
        if self.lives is not None:
            texts.append(f"lives: Weibull of shape {self.lives.shape:.3g}")
        return f"{self.count} units, {self.failed} failed; {'; '.join(texts)}."

    def text_tables(self) -> list[ReportTable]:
        """Return what was learnt of each fault, and what the covariates do."""
        rows = [
            (key, str(item.units), f"{item.trust:.2f}", f"{item.life:.4g}", f"{item.spread:.2f}",
             "{:.2f} to {:.2f}".format(*item.free.drift))
            for key, item in self.growth.items()
        ]  # fmt: skip
        effects = [
            (key, name, f"{effect:+.3g}")
            for key, item in self.growth.items()
            for name, effect in item.covariates.items()
        ]
        if self.lives is not None:
            pairs = zip(self.lives.names[1:], self.lives.coefficients[1:], strict=True)
            effects += [("lives", name, f"{value:+.3g}") for name, value in pairs]
        columns = ("fault", "units", "follows the law", "median life", "spread", "drift")
        tables = [ReportTable(columns, rows)]
        if effects:
            tables.append(ReportTable(("of", "covariate", "adds to the logarithm"), effects))
        return tables

    @property
    def remarks(self) -> Sequence[str]:
        """What the caller should know."""
        return self.findings

    def tables(self, tables: ResponseTables) -> ResponseTables:
        """Return tables whose laws are as the fleet has them."""
        laws = [
            self.growth[law.key].law(law) if law.key in self.growth else law for law in tables.laws
        ]
        return replace(tables, laws=tuple(laws))

    def priors(self, covariates: Mapping[str, str]) -> dict[str, tuple[GrowthPrior, GrowthPrior]]:
        """Return priors of a unit for a `GrowthFilter`, by fault."""
        return {key: item.priors(covariates) for key, item in self.growth.items()}


def read_lives(path: str | os.PathLike[str]) -> list[FleetUnit]:
    """Read a CSV file of lives: ``unit``, ``use``, ``failed`` (1 or 0), and covariates.

    Raises
    ------
    FormatError
        A column that is missing, a use that is none, a unit that stands there twice.
    """
    place = Path(path).expanduser()
    try:
        text = read_regular(place, _LARGEST).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(f"{place}: is no text: {error}") from error
    rows = list(csv.DictReader(line for line in text.splitlines() if line.strip()))
    out: dict[str, FleetUnit] = {}
    for number, row in enumerate(rows, start=2):
        where = f"{place}:{number}"
        lacking = next((name for name in _NEEDED if row.get(name) is None), None)
        if lacking is not None:
            raise FormatError(f"{where}: has no {lacking!r}; needed: unit, use, failed")
        if row["failed"].strip() not in ("0", "1"):
            raise FormatError(f"{where}: failed = {row['failed']!r} is neither 0 nor 1")
        try:
            use = float(row["use"])
        except ValueError:
            use = -1.0
        if not 0.0 < use <= 1e12:
            raise FormatError(f"{where}: use = {row['use']!r} is not a number above 0")
        name = row["unit"].strip()
        if not name or name in out:
            raise FormatError(f"{where}: the unit {name!r} stands there twice, or has no name")
        others = {k: (v or "").strip() for k, v in row.items() if k not in _NEEDED}
        empty = next((k for k, v in others.items() if not v), None)
        if empty is not None:
            raise FormatError(f"{where}: {empty} is empty")
        out[name] = FleetUnit(name, (), use, row["failed"].strip() == "1", others)
    if not out:
        raise FormatError(f"{place}: has no unit")
    return list(out.values())


def learn_fleet(
    units: Sequence[FleetUnit],
    tables: ResponseTables | None,
    *,
    unit: str,
    lives: Sequence[FleetUnit] = (),
    seed: int = 0,
    progress: Progress | None = None,
) -> FleetGrowth:
    """Learn growth from histories, and the distribution of lives from a file of them.

    Parameters
    ----------
    units : sequence of FleetUnit
        With inspections.
    tables : ResponseTables or None
        What severities do; None without histories.
    unit : str
        Of use.
    lives : sequence of FleetUnit
        Of the file of lives; those with a history are the same units.
    seed : int
        Of chance.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    InputError
        Neither histories nor lives.
    """
    if not units and not lives:
        raise InputError("nothing to learn from: neither histories nor a file of lives")
    findings: list[str] = []
    growth: dict[str, LearnedGrowth] = {}
    if units and tables is not None:
        for k, law in enumerate(tables.laws):
            showing = [item for item in units if _shows(item, law.key)]
            if len(showing) < 2:
                findings.append(f"{law.key}: {len(showing)} histories show it; 2 are needed")
                continue
            growth[law.key] = _learned(showing, tables, k, seed, progress)
    distribution = fit_lives(
        np.array([item.use for item in lives]),
        np.array([item.failed for item in lives]),
        [item.covariates for item in lives],
    ) if lives and any(item.failed for item in lives) else None  # fmt: skip
    if lives and distribution is None:
        findings.append("no unit of the file of lives has failed: their distribution is not known")
    every = {item.name: item for item in (*lives, *units)}
    failed = sum(item.failed for item in every.values())
    return FleetGrowth(unit, len(every), failed, growth, distribution, tuple(findings))


def _shows(item: FleetUnit, key: str) -> bool:
    seen = (i.seen.get(key) for i in item.inspections)
    return sum(s is not None and s.severity is not None for s in seen) > 0


def _learned(
    units: Sequence[FleetUnit], tables: ResponseTables, k: int, seed: int, progress: Progress | None
) -> LearnedGrowth:
    """Learn one fault's growth: form and lives, then what its rates do by the evidence of all."""
    law = replace(tables.laws[k], dormant=0.0)
    shapes = Process(replace(tables, laws=_with(tables.laws, k, law))).shapes[k]
    form = _form(units, law.key, shapes.start, shapes.limit)
    names, matrix, reference = _design(units)
    finished = np.array([item.failed for item in units])
    of_lives = -np.log(np.array([item.use for item in units]))[finished]
    free = replace(WITHOUT_LAW, slope=0.0 if form else WITHOUT_LAW.slope)
    learned = LearnedGrowth(len(units), law.trust, prior_of(law), free, 0.0, form)
    if len(of_lives) >= _FINISHED + matrix.shape[1]:
        exact = np.full(len(of_lives), _EXACT**2)
        rate, spread, effect = _population(of_lives, exact, _WIDE, matrix[finished])
        learned = replace(
            learned, life=float(np.exp(-rate)), free=replace(free, spread=spread),
            with_law=replace(learned.with_law, spread=spread), reference=reference,
            covariates=dict(zip(names, effect.tolist(), strict=True)),
        )  # fmt: skip
    histories = _Fleet(units, tables, k, law, seed)
    tried = [(name, scale) for name, scales in _SCALES.items() for scale in scales]
    best = histories.evidence(learned)
    for number, (name, scale) in enumerate(tried):
        other = replace(
            learned, free=_scaled(free, learned.free, name, scale),
            with_law=_scaled(BESIDE_LAW, learned.with_law, name, scale),
        )  # fmt: skip
        evidence = histories.evidence(other)
        if evidence > best:
            best, learned = evidence, other
        if progress is not None and progress((number + 1) / len(tried)) is False:
            raise Interrupted("interrupted while growth was learnt")
    return _updated(
        learned, histories.filters(learned), histories.process(learned), k, learned.life > 0.0
    )


#: By how much what may differ from what is ASSUMED is tried, one after the other.
_SCALES: Mapping[str, tuple[float, ...]] = {
    "drift": (0.5, 0.25, 0.1, 0.03),
    "slope_spread": (0.6, 0.3, 0.1),
    "changes": (0.3, 0.1, 0.01),
    "path": (0.3, 2.0),
}


def _scaled(assumed: GrowthPrior, now: GrowthPrior, name: str, scale: float) -> GrowthPrior:
    """Return a prior with one number, or range, that of the ASSUMED one times a scale."""
    value = getattr(assumed, name)
    changed: dict[str, Any] = {
        name: tuple(scale * x for x in value) if isinstance(value, tuple) else scale * value
    }
    return replace(now, **changed)


@dataclass(frozen=True)
class _Fleet:
    """Histories of one fault, filtered by any priors."""

    units: Sequence[FleetUnit]
    tables: ResponseTables
    number: int
    law: Law
    seed: int

    def process(self, learned: LearnedGrowth) -> Process:
        """Return how the fault grows by what is learned."""
        laws = _with(self.tables.laws, self.number, learned.law(self.law))
        return Process(replace(self.tables, laws=laws))

    def filters(self, learned: LearnedGrowth) -> list[FaultFilter]:
        """Return what each history says."""
        process = self.process(learned)
        return [_filtered(item, process, self.number, learned, self.seed) for item in self.units]

    def evidence(self, learned: LearnedGrowth) -> float:
        """Return the logarithm of the probability of all histories together."""
        return float(sum(item.evidence for item in self.filters(learned)))


def _with(laws: Sequence[Law], k: int, law: Law) -> tuple[Law, ...]:
    return (*laws[:k], law, *laws[k + 1 :])


def _form(
    units: Sequence[FleetUnit], key: str, start: float, limit: float
) -> tuple[tuple[float, float], ...]:
    """Return the mean course of finished units, as shares of severity and of life; or none."""
    at = np.linspace(0.0, 1.0, _KNOTS)
    rows = []
    for item in units:
        seen = [(i.usage / item.use, i.seen[key]) for i in item.inspections if key in i.seen]
        points = [(u, (s.severity - start) / (limit - start)) for u, s in seen
                  if s.severity is not None and s.probability >= 0.5 and u < 1.0]  # fmt: skip
        if item.failed and len(points) >= _FINISHED:
            use, severity = np.array([(0.0, 0.0), *points, (1.0, 1.0)]).T
            severity = np.clip(severity, 0.0, 1.0)
            # Halfway between the least and the greatest monotone course through scattered points.
            upper = np.maximum.accumulate(severity)
            lower = np.minimum.accumulate(severity[::-1])[::-1]
            course = 0.5 * (upper + lower) + 1e-9 * np.arange(len(use))
            rows.append(np.interp(at, course, use))
    if len(rows) < _FINISHED:
        return ()
    steps = np.maximum(np.diff(np.mean(rows, axis=0)), _SLOWEST / (_KNOTS - 1))
    use = np.concatenate(([0.0], np.cumsum(steps)))
    return tuple(zip(at.tolist(), (use / use[-1]).tolist(), strict=True))


def _filtered(
    item: FleetUnit, process: Process, k: int, learned: LearnedGrowth, seed: int
) -> FaultFilter:
    """Return what a unit's history says of its growth: its end is a sighting at the limit."""
    key, limit = process.laws[k].key, process.shapes[k].limit
    flt = GrowthFilter(process, seed=seed, priors={key: learned.priors(item.covariates)})
    for i in item.inspections:
        flt.update(i)
    if item.use > flt.usage:
        deviation = _AT_END * limit
        if item.failed:
            flt.update(Inspection(item.use, {key: Seen(limit, deviation, deviation)}))
        else:
            flt.update(Inspection(item.use, {key: Seen(None, deviation, deviation,
                                                       detectable=limit)}))  # fmt: skip
    return flt.faults[k]


def _updated(
    learned: LearnedGrowth,
    filters: Sequence[FaultFilter],
    process: Process,
    k: int,
    lives: bool,
) -> LearnedGrowth:
    """Return what all units together say of rates, unless their lives do, of scatter and misses."""
    trust = float(np.mean([item.by_law() for item in filters]))
    priors = []
    for free, prior in ((False, learned.with_law), (True, learned.free)):
        if (1.0 - trust if free else trust) < _SEEN:
            priors.append(prior)
            continue
        scatter = np.concatenate([np.log(item.manner.scatter) for item in filters])
        weight = np.concatenate([item.weight / item.weight.sum() for item in filters])
        mean = float(np.average(scatter, weights=weight))
        deviation = float(np.sqrt(np.average((scatter - mean) ** 2, weights=weight)))
        known = replace(
            prior, scatter=(mean, max(deviation, 0.05)), missed=_pooled(filters, "missed", free)
        )
        if not lives:
            moments = np.array([_moments(item, free) for item in filters])
            none = np.zeros((len(filters), 0))
            rate, spread, _ = _population(moments[:, 0], moments[:, 1], prior, none)
            known = replace(known, rate=rate, spread=spread)
        priors.append(known)
    life = learned.life or float(process.lives[k][-1])
    return replace(learned, trust=trust, with_law=priors[0], free=priors[1], life=life)


def _moments(item: FaultFilter, free: bool) -> tuple[float, float]:
    """Return mean and variance of a unit's rate when new."""
    chosen = item.shapes.free[item.manner.row] == free
    weight = np.where(chosen, item.weight, 0.0) + 1e-300
    weight = weight / weight.sum()
    rate = item.new_rates()
    mean = float(weight @ rate)
    return mean, float(weight @ ((rate - mean) ** 2 + item.rate_variance()))


def _population(
    mean: Floats, variance: Floats, prior: GrowthPrior, matrix: Floats
) -> tuple[float, float, Floats]:
    """Return mean and deviation of a number over the units, and what covariates add to it.

    Each unit's posterior is taken apart into its prior and what its history says; the population's
    moments follow by expectation and maximisation, widened for the number of units.
    """
    share = np.minimum(variance / prior.spread**2, _KNOWN)  # of the prior in the posterior
    value = prior.rate + (mean - prior.rate) / (1.0 - share)
    precision = (1.0 - share) / np.maximum(variance, 1e-6)
    basis = np.column_stack((np.ones(len(mean)), matrix))
    spread = prior.spread
    effect: Floats = np.zeros(basis.shape[1])
    for _ in range(60):
        weight = 1.0 / (spread**2 + 1.0 / precision)
        normal = basis.T @ (weight[:, None] * basis) + np.diag([0.0, *[1e-3] * matrix.shape[1]])
        effect = np.asarray(np.linalg.solve(normal, basis.T @ (weight * value)), dtype=np.float64)
        off = value - basis @ effect
        shrunk = spread**2 * weight * off
        left = spread**2 * (1.0 / precision) * weight
        spread = float(np.sqrt(np.mean(shrunk**2 + left)))
    free = max(len(mean) - basis.shape[1], 1)
    wider = np.sqrt((1.0 + 1.0 / len(mean)) * (free + 2.0) / free)
    return float(effect[0]), max(spread * float(wider), 0.02), effect[1:]


def _pooled(filters: Sequence[FaultFilter], name: str, free: bool) -> tuple[float, float]:
    """Return a range that most of the units' parameters lie in."""
    values, weights = [], []
    for item in filters:
        chosen = item.shapes.free[item.manner.row] == free
        values.append(getattr(item.manner, name)[chosen])
        weights.append(item.weight[chosen] / max(float(item.weight[chosen].sum()), 1e-300))
    value, weight = np.concatenate(values), np.concatenate(weights)
    order = np.argsort(value)
    shares = np.cumsum(weight[order]) / weight.sum()
    index = np.minimum(np.searchsorted(shares, _RANGE), len(value) - 1)
    low, high = value[order][index].tolist()
    return low, max(high, 1.01 * low)


def _design(units: Sequence[FleetUnit]) -> tuple[list[str], Floats, dict[str, float]]:
    """Return columns of covariates about their means, and the means."""
    known: dict[str, None] = {}
    rows = [_columns(item.covariates, {}, item.name) for item in units]
    for row in rows:
        known.update(dict.fromkeys(row))
    names = [name for name in known if len({row.get(name, 0.0) for row in rows}) > 1]
    table = np.array([[row.get(name, 0.0) for name in names] for row in rows])
    table = table.reshape(len(units), len(names))
    means = table.mean(axis=0)
    return names, table - means, dict(zip(names, means.tolist(), strict=True))


def _columns(
    covariates: Mapping[str, str], known: Mapping[str, float], place: str
) -> dict[str, float]:
    """Return covariates as numbers; a class is a column of its own, ``NAME=CLASS``."""
    out: dict[str, float] = {}
    for name, text in covariates.items():
        try:
            out[name] = float(text)
        except ValueError:
            out[f"{name}={text}"] = 1.0
        key = name if name in out else f"{name}={text}"
        if known and key not in known and not any(k.startswith(f"{name}=") for k in known):
            raise unknown("covariate", name, [k.partition("=")[0] for k in known], place)
    for key in known:
        name, _, kind = key.partition("=")
        if kind and name in covariates:
            out.setdefault(key, 0.0)
    return out


def by_life(
    item: FleetUnit, lives: LifeDistribution, unit: str, rng: np.random.Generator
) -> Prognosis:
    """Predict a unit of which only the use is known.

    Parameters
    ----------
    item : FleetUnit
        In use.
    lives : LifeDistribution
        Of its type.
    unit : str
        Of use.
    rng : Generator
        Of chance.
    """
    remaining = lives.remaining(item.use, item.covariates, _DRAWN, rng)
    end = item.use + remaining
    course = np.zeros((1, 0, 3))
    future = Future(item.use, end, np.zeros(len(end), dtype=np.intp), np.array([item.use]), course)
    return Prognosis(unit, item.use, LEVEL, future, ("failure",), (), (), (), item.name)
