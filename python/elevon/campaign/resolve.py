"""A plan becomes a table of runs, one row each, complete in itself: no file is needed again."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.campaign.design import Points, design_points
from elevon.campaign.draw import axis_values, column_of, random_values, ranged
from elevon.campaign.grammar import Axis, Growth, Plan, Population, Spread, Target
from elevon.campaign.resolved import CaseChanges, Embedder, Index, Resolved, split_index
from elevon.documents import Document, read_toml, validated
from elevon.errors import InputError
from elevon.faults import Fault
from elevon.parameters.records import record_of
from elevon.scenario import Scenario
from elevon.scenario.scenario import check_units, with_texts
from elevon.units import parse_quantity

#: Runs of a plan. ASSUMED: the table of ten million runs takes some 2 GB while a plan is resolved;
#: a larger experiment is split into several plans.
MOST_RUNS = 10_000_000
#: Axes of the product of all that varies: NumPy's arrays have 64 dimensions at most.
_MOST_AXES = 60
#: Kinds of a design whose points are all combinations of the factors' levels.
_ALL_LEVELS = {"full_factorial"}


def check_counts(plan: Plan, place: str) -> int:
    """Return an upper bound of the number of runs.

    Raises
    ------
    InputError
        More than `MOST_RUNS`, or one number alone is; it is named. More axes than arrays have.
    """
    if len(plan.vary) > _MOST_AXES:
        raise InputError(f"{place}: {len(plan.vary)} axes in 'vary'; the limit is {_MOST_AXES}")
    counts = dict(_axis_lengths(plan))
    total = math.prod(counts.values())
    if total > MOST_RUNS:
        listed = " x ".join(f"{count} {name}" for name, count in counts.items() if count > 1)
        raise InputError(f"{place}: {listed} = {total} runs; the limit is {MOST_RUNS}")
    return total


def _axis_lengths(plan: Plan) -> dict[str, int]:
    counts = {"seeds": max(len(plan.seeds), 1), "cases": max(len(plan.case or ()), 1)}
    if plan.population is not None:
        counts["units"] = plan.population.units
        counts["ages"] = len(plan.population.ages or ()) or plan.population.points or 1
    for k, axis in enumerate(plan.vary):
        counts[f"values of vary[{k}]"] = len(axis.values or ()) or axis.count or 1
    if plan.random is not None:
        counts["random draws"] = max(plan.random.count, 1)
    if plan.design is not None:
        counts["points of the design"] = _design_points_bound(plan.design)
    return counts


def _design_points_bound(design: Any) -> int:
    """Return an upper bound of a design's points, replicates and centre points among them."""
    if design.kind in _ALL_LEVELS:
        points = math.prod(_levels(factor) for factor in design.factor)
    else:
        points = design.runs or design.count or 1
    return int(points * design.replicates + design.centre * design.blocks)


def _levels(factor: Any) -> int:
    return len(factor.values or ()) or 2


@dataclass(frozen=True)
class Units:
    """Every unit at every age, the ages of one unit following each other.

    Attributes
    ----------
    targets, columns : list
        What differs, with unit and values, shape (units * ages,).
    unit, age : ndarray, shape (units * ages,)
        Number and age (0 to 1).
    """

    targets: list[Target]
    columns: list[tuple[str, Any]]
    unit: npt.NDArray[np.int64]
    age: Floats


def units_of(population: Population, actuator: Actuator, place: str) -> Units:
    """Return the units of a population.

    Raises
    ------
    InputError
        An unknown name, a wrong unit, a choice that has no spread; the place is named.
    """
    ages = _ages(population)
    count = population.units
    unit, age = np.repeat(np.arange(count), len(ages)), np.tile(ages, count)
    # Each quantity has a generator of its own: one more leaves the others as they are.
    seeds = np.random.SeedSequence(population.seed).spawn(
        len(population.spread) + len(population.growth)
    )
    targets: list[Target] = [*population.spread, *population.growth]
    columns: list[tuple[str, Any]] = []
    for k, spread in enumerate(population.spread):
        generator = np.random.default_rng(seeds[k])
        unit_text, values = _unit_values(spread, actuator, count, generator, f"{place}.spread[{k}]")
        columns.append((unit_text, values[unit]))
    for k, growth in enumerate(population.growth):
        generator = np.random.default_rng(seeds[len(population.spread) + k])
        columns.append(
            _growth_values(growth, actuator.wiring, (unit, age), generator, f"{place}.growth[{k}]")
        )
    return Units(targets, columns, unit, age)


def _ages(population: Population) -> Floats:
    if population.ages:
        return np.array(population.ages, dtype=np.float64)
    points = population.points or 1
    return np.linspace(0.0, 1.0, points) if points > 1 else np.zeros(1)


def _unit_values(
    spread: Spread, actuator: Actuator, count: int, generator: np.random.Generator, place: str
) -> tuple[str, Floats]:
    """Return the values of one parameter of all units."""
    path = str(spread.parameter)
    record = record_of(actuator.wiring, path, place)
    if record.choices is not None:
        raise InputError(f"{place}: {path} is a choice: it has no spread")
    if spread.distribution == "uniform":
        return ranged(spread, generator.random(count), actuator.wiring, place)
    nominal = actuator.parameters.value(path)
    sd, relative = _deviation(spread, record.unit, place)
    normal = _truncated_normal(generator.random(count), float(spread.cut))
    if spread.distribution == "lognormal":
        if not relative:
            raise InputError(f"{place}: the 'sd' of a lognormal spread is a fraction: '3 %'")
        return record.unit, nominal * np.exp(sd * normal)
    return record.unit, nominal + (nominal * sd if relative else sd) * normal


def _deviation(spread: Spread, unit: str, place: str) -> tuple[float, bool]:
    """Return the standard deviation, and whether it is a fraction of the value."""
    text = spread.sd
    if isinstance(text, str) and text.strip().endswith("%"):
        sd, relative = parse_quantity(text, "1", f"{place}: sd"), True
    else:
        sd, relative = parse_quantity(text or 0.0, unit or "1", f"{place}: sd"), False
    if sd <= 0.0:
        raise InputError(f"{place}: sd = {text} must be positive")
    return sd, relative


def _truncated_normal(uniform: Floats, cut: float) -> Floats:
    """Return standard normal values cut at so many standard deviations, from uniform ones."""
    from scipy.special import ndtr, ndtri

    low, high = ndtr(-cut), ndtr(cut)
    values: Floats = ndtri(low + (high - low) * uniform)
    return values


def _growth_values(
    growth: Growth,
    wiring: str,
    where: tuple[npt.NDArray[np.int64], Floats],
    generator: np.random.Generator,
    place: str,
) -> tuple[str, Floats]:
    """Return the severity or value at every age of every unit."""
    unit, age = where
    text, ends = ranged(growth, np.array([0.0, 1.0]), wiring, place)
    count = int(unit.max()) + 1
    onset = growth.onset[0] + (growth.onset[1] - growth.onset[0]) * generator.random(count)
    factor = np.exp(growth.spread * _truncated_normal(generator.random(count), 3.0))
    grows = generator.random(count) < growth.probability
    fraction = np.clip((age - onset[unit]) / (1.0 - onset[unit]), 0.0, 1.0)
    size = np.where(grows, (ends[1] - ends[0]) * factor, 0.0)
    return text, ends[0] + size[unit] * _law(growth, fraction)


def _law(growth: Growth, fraction: Floats) -> Floats:
    if growth.law == "linear":
        return fraction
    if growth.law == "power":
        return fraction ** float(growth.exponent)
    rate = float(growth.exponent)
    grown: Floats = np.expm1(rate * fraction) / np.expm1(rate)
    return grown


Quantity = tuple[Target, str, Any]


@dataclass(frozen=True)
class _Parts:
    """What a plan combines: units at their ages, cases, axes, draws or points, and seeds."""

    units: Units | None
    variants: list[CaseChanges]
    axes: list[tuple[Axis, str, Any]]
    draws: list[tuple[str, Any]]
    points: Points | None

    def lengths(self, plan: Plan) -> list[int]:
        """Return the length of each axis of the product."""
        ages = 1 if self.units is None else len(self.units.unit)
        drawn = 1 if plan.random is None else plan.random.count
        drawn = drawn if self.points is None else len(self.points.draw)
        grid = [len(values) for _, _, values in self.axes]
        return [ages, len(self.variants), *grid, drawn, len(plan.seeds)]


def resolve_plan(plan: Plan, document: Document, *, allow_outside: bool = False) -> Resolved:
    """Return every run of a plan: units x ages x cases x axes x draws x seeds, the last fastest.

    Parameters
    ----------
    plan : Plan
        As read.
    document : Document
        Where it came from: names places in errors, and is where relative files are looked for.
    allow_outside : bool
        Whether the plan may name files that are not in its own folder or below.

    Returns
    -------
    Resolved
        Runs numbered from 0. The content of the plan's files is in it.

    Raises
    ------
    InputError
        The plan is empty, asks for too many runs, or anything in it cannot be; the place is named.
    """
    check_counts(plan, document.place())
    files = Embedder(document.folder, None if allow_outside else document.folder)
    actuator = _actuator(plan, document, files)
    base = _base_scenario(plan, actuator, document, files)
    parts = _parts(plan, actuator, document, files)
    lengths = parts.lengths(plan)
    if 0 in lengths:
        raise InputError(f"{document.place()}: the plan is empty: it holds no run")
    places = [axis.reshape(-1) for axis in np.indices(lengths, dtype=np.int64)]
    quantities = list(_varied_quantities(plan, parts, places, lengths))
    _check_varied_once([target for target, _, _ in quantities], base, document)
    resolved = Resolved(
        name=plan.name,
        text=plan.text,
        actuator=actuator,
        fidelity=plan.fidelity,
        record=plan.record if plan.record is None else _record_texts(plan.record),
        features=_record_texts(plan.features),
        scenario=base,
        variants=parts.variants,
        columns=[files.column(column_of(*item), document.place()) for item in quantities],
        index=_index(plan, parts, places, lengths),
        responses=list(plan.responses),
        allow_not_acting=plan.allow_not_acting,
        runs_per_file=plan.runs_per_file,
        files=files.points,
        sources=files.sources,
        design={} if parts.points is None else parts.points.about,
    )
    if plan.split:
        split_index(resolved, _split_rule(plan), document.place(("split",)))
    return resolved


def _parts(plan: Plan, actuator: Actuator, document: Document, files: Embedder) -> _Parts:
    wiring = actuator.wiring
    units = None
    if plan.population is not None:
        units = units_of(plan.population, actuator, document.place(("population",)))
    axes = [
        (axis, *axis_values(axis, wiring, document.place(("vary", k))))
        for k, axis in enumerate(plan.vary)
    ]
    draws: list[tuple[str, Any]] = []
    if plan.random is not None:
        # With a population every unit has draws of its own at every age.
        repeats = 1 if units is None else len(units.unit)
        draws = random_values(plan.random, repeats, wiring, document.place(("random",)))
    points = None
    if plan.design is not None:
        place = document.place(("design",))
        if plan.design.file is not None:
            files.note(plan.design.file)
        points = design_points(plan.design, wiring, document.folder, place)
    return _Parts(units, _variants(plan, document, files), axes, draws, points)


def _varied_quantities(
    plan: Plan, parts: _Parts, places: Sequence[Any], lengths: Sequence[int]
) -> Iterator[Quantity]:
    """Yield every varied quantity with its unit and its value in each run."""
    ages, drawn = places[0], places[-2]
    if parts.units is not None:
        for target, (unit, values) in zip(parts.units.targets, parts.units.columns, strict=True):
            yield target, unit, values[ages]
    for position, (axis, unit, values) in enumerate(parts.axes):
        yield axis, unit, values[places[2 + position]]
    if plan.random is not None:
        for draw, (unit, values) in zip(plan.random.draw, parts.draws, strict=True):
            yield draw, unit, values[ages * lengths[-2] + drawn]
    if parts.points is not None:
        for target, (unit, values) in zip(parts.points.targets, parts.points.columns, strict=True):
            yield target, unit, values[drawn]


def _index(
    plan: Plan,
    parts: _Parts,
    places: Sequence[Any],
    lengths: Sequence[int],
) -> Index:
    """Return the index of the runs: unit, age, case, draw, block, replicate, seed, part."""
    ages, drawn, count = places[0], places[-2], len(places[0])
    units, points = parts.units, parts.points
    none = np.zeros(count, dtype=np.int64)
    if points is not None:
        draw = ages * (int(points.draw.max()) + 1) + points.draw[drawn]
    elif plan.random is not None:
        draw = ages * lengths[-2] + drawn
    else:
        draw = _number_combinations(places[:-1])
    return Index(
        unit=none - 1 if units is None else units.unit[ages],
        age=np.full(count, np.nan) if units is None else units.age[ages],
        variant=places[1],
        draw=draw,
        block=none if points is None else points.block[drawn],
        replicate=none if points is None else points.replicate[drawn],
        seed=np.array(plan.seeds, dtype=np.int64)[places[-1]],
        split=np.full(count, "", dtype=object),
    )


def _record_texts(record: str | Sequence[str]) -> list[str]:
    return [record] if isinstance(record, str) else list(record)


def _actuator(plan: Plan, document: Document, files: Embedder) -> Actuator:
    reference = plan.actuator
    if reference.endswith(".toml") and document.folder is not None:
        near = files.located(reference)
        reference = str(near) if near.is_file() else reference
    actuator = Actuator.load(reference)
    values = with_texts(plan.parameters) if document.text else plan.parameters
    return actuator.with_values(values, source="plan", place=document.place(("parameters",)))


def _base_scenario(
    plan: Plan, actuator: Actuator, document: Document, files: Embedder
) -> dict[str, Any]:
    if isinstance(plan.scenario, str):
        path = files.located(plan.scenario)
        document = read_toml(path)
        check_units(document)
        inner = Embedder(document.folder, files.root)
        scenario = validated(Scenario, inner.scenario(document.data, document.place()), document)
        files.sources[str(path)] = hashlib.sha256(document.text.encode()).hexdigest()
        files.sources.update(inner.sources)
        return scenario.to_dict()
    data = plan.scenario if plan.scenario is not None else actuator.default_scenario
    if data is None:
        raise InputError(f"{document.place()}: 'scenario' is missing")
    place = document.place(("scenario",))
    if document.text:
        check_units(Document(document.origin, document.text, dict(data), prefix=("scenario",)))
    return Scenario.from_dict(files.scenario(data, place), place).to_dict()


def _variants(plan: Plan, document: Document, files: Embedder) -> list[CaseChanges]:
    if plan.case is None:
        return [CaseChanges()]
    variants = []
    for index, case in enumerate(plan.case):
        place = document.place(("case", index))
        faults = [files.fault(item, place) for item in case.faults]
        read = [Fault.from_dict(item, place).to_dict() for item in faults]
        variants.append(
            CaseChanges(case.name, read, case.parameters, files.scenario(case.scenario, place))
        )
    return variants


def _check_varied_once(targets: Sequence[Target], base: dict[str, Any], document: Document) -> None:
    seen: set[str] = set()
    for target in targets:
        if target.name in seen:
            raise InputError(f"{document.place()}: {target.name!r} is varied twice")
        if target.parameter is not None and target.parameter in base.get("parameters", {}):
            raise InputError(
                f"{document.place()}: {target.name!r} is varied, and set by the scenario's "
                "'parameters' too"
            )
        seen.add(target.name)


def _split_rule(plan: Plan) -> dict[str, Any]:
    """Return how the plan deals its runs to parts."""
    if not plan.split:
        return {}
    shares = {name: float(share) for name, share in plan.split.items()}
    by = "draw" if plan.population is None else "unit"
    return {"shares": shares, "by": by, "seed": plan.split_seed}


def _number_combinations(axes: Sequence[Any]) -> Any:
    """Number the combinations of several axes."""
    number = np.zeros(len(axes[0]), dtype=np.int64)
    for axis in axes:
        number = number * (int(axis.max()) + 1) + axis
    return number
