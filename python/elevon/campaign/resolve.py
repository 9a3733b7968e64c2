"""A plan becomes a table of runs, one row each, complete in itself: no file is needed again."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.campaign.design import Points, design_points
from elevon.campaign.draw import axis_values, column_of, random_values
from elevon.campaign.embed import Embedder
from elevon.campaign.grammar import Axis, Target
from elevon.campaign.limits import check_counts
from elevon.campaign.plan import Plan
from elevon.campaign.population import Units, units_of
from elevon.campaign.resolved import CaseChanges, Index, Resolved
from elevon.campaign.split import split_index
from elevon.documents import Document, read_toml, validated
from elevon.errors import InputError
from elevon.faults import Fault
from elevon.scenario import Scenario
from elevon.scenario.scenario import check_units, with_texts

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
    quantities = list(_quantities(plan, parts, places, lengths))
    _no_twins([target for target, _, _ in quantities], base, document)
    resolved = Resolved(
        name=plan.name,
        text=plan.text,
        actuator=actuator,
        fidelity=plan.fidelity,
        record=plan.record if plan.record is None else _texts(plan.record),
        features=_texts(plan.features),
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
        split_index(resolved, _dealing(plan), document.place(("split",)))
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


def _quantities(
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
    """Return what each run is: unit, age, case, draw, block, replicate, seed, part of the data."""
    ages, drawn, count = places[0], places[-2], len(places[0])
    units, points = parts.units, parts.points
    none = np.zeros(count, dtype=np.int64)
    if points is not None:
        draw = ages * (int(points.draw.max()) + 1) + points.draw[drawn]
    elif plan.random is not None:
        draw = ages * lengths[-2] + drawn
    else:
        draw = _distinct(places[:-1])
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


def _texts(record: str | Sequence[str]) -> list[str]:
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


def _no_twins(targets: Sequence[Target], base: dict[str, Any], document: Document) -> None:
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


def _dealing(plan: Plan) -> dict[str, Any]:
    """Return how the plan deals its runs to parts."""
    if not plan.split:
        return {}
    shares = {name: float(share) for name, share in plan.split.items()}
    by = "draw" if plan.population is None else "unit"
    return {"shares": shares, "by": by, "seed": plan.split_seed}


def _distinct(axes: Sequence[Any]) -> Any:
    """Number the combinations of several axes."""
    number = np.zeros(len(axes[0]), dtype=np.int64)
    for axis in axes:
        number = number * (int(axis.max()) + 1) + axis
    return number
