"""A plan becomes a table of runs, one row each, complete in itself: no file is needed again."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.campaign.draw import axis_values, column_of, random_values
from elevon.campaign.embed import Embedder
from elevon.campaign.grammar import Target
from elevon.campaign.plan import Plan
from elevon.campaign.resolved import Index, Resolved, Variant
from elevon.campaign.split import dealt
from elevon.documents import Document, read_toml, validated
from elevon.errors import InputError
from elevon.faults import Fault
from elevon.scenario import Scenario

__all__ = ["resolve_plan"]


@dataclass(frozen=True)
class _Axis:
    """One axis of the product of all combinations: its length, and values of its targets."""

    length: int
    targets: Sequence[Target]
    columns: Sequence[tuple[str, Any]]


def resolve_plan(plan: Plan, document: Document) -> Resolved:
    """Return every run of a plan: units x ages x cases x axes x draws x seeds, the last fastest.

    Parameters
    ----------
    plan : Plan
        As read.
    document : Document
        Where it came from: names places in errors, and is where relative files are looked for.

    Returns
    -------
    Resolved
        Runs numbered from 0. Whatever the plan's files said is in it.

    Raises
    ------
    InputError
        The plan is empty, or anything in it cannot be; the place is named.
    """
    files = Embedder(document.folder)
    actuator = _actuator(plan, document)
    base = _base_scenario(plan, actuator, document, files)
    variants = _variants(plan, document, files)
    axes = [_axis(axis, actuator.wiring, document, k) for k, axis in enumerate(plan.vary)]
    draws = _draws(plan, actuator.wiring, document)
    lengths = [len(variants), *(axis.length for axis in axes), draws.length, len(plan.seeds)]
    if 0 in lengths:
        raise InputError(f"{document.place()}: the plan is empty: it holds no run")
    _no_twins([t for axis in (*axes, draws) for t in axis.targets], base, document)
    index = _index(lengths)
    columns = [
        files.column(column_of(target, unit, values[index[1 + position]]), document.place())
        for position, axis in enumerate([*axes, draws])
        for target, (unit, values) in zip(axis.targets, axis.columns, strict=True)
    ]
    return Resolved(
        name=plan.name,
        text=plan.text,
        actuator=actuator,
        fidelity=plan.fidelity,
        record=plan.record if plan.record is None else _texts(plan.record),
        scenario=base,
        variants=variants,
        columns=columns,
        index=_labels(plan, index, document),
        responses=list(plan.responses),
        allow_not_acting=plan.allow_not_acting,
        runs_per_file=plan.runs_per_file,
        files=files.points,
        sources=files.sources,
    )


def _texts(record: str | Sequence[str]) -> list[str]:
    return [record] if isinstance(record, str) else list(record)


def _actuator(plan: Plan, document: Document) -> Actuator:
    reference = plan.actuator
    if reference.endswith(".toml") and document.folder is not None:
        near = document.folder / reference
        reference = str(near) if near.is_file() else reference
    actuator = Actuator.load(reference)
    return actuator.with_values(
        plan.parameters, source="plan", place=document.place(("parameters",))
    )


def _base_scenario(
    plan: Plan, actuator: Actuator, document: Document, files: Embedder
) -> dict[str, Any]:
    if isinstance(plan.scenario, str):
        path = files.located(plan.scenario)
        own = read_toml(path)
        inner = Embedder(own.folder)
        scenario = validated(Scenario, inner.scenario(own.data, own.place()), own)
        files.sources[str(path)] = hashlib.sha256(own.text.encode()).hexdigest()
        files.sources.update(inner.sources)
        return scenario.to_dict()
    data = plan.scenario if plan.scenario is not None else actuator.default_scenario
    if data is None:
        raise InputError(f"{document.place()}: 'scenario' is missing")
    place = document.place(("scenario",))
    return Scenario.from_dict(files.scenario(data, place), place).to_dict()


def _variants(plan: Plan, document: Document, files: Embedder) -> list[Variant]:
    if plan.case is None:
        return [Variant()]
    variants = []
    for index, case in enumerate(plan.case):
        place = document.place(("case", index))
        faults = [files.fault(item, place) for item in case.faults]
        read = [Fault.from_dict(item, place).to_dict() for item in faults]
        variants.append(
            Variant(case.name, read, case.parameters, files.scenario(case.scenario, place))
        )
    return variants


def _axis(axis: Any, wiring: str, document: Document, index: int) -> _Axis:
    unit, values = axis_values(axis, wiring, document.place(("vary", index)))
    return _Axis(len(values), [axis], [(unit, values)])


def _draws(plan: Plan, wiring: str, document: Document) -> _Axis:
    if plan.random is None:
        return _Axis(1, [], [])
    place = document.place(("random",))
    columns = random_values(plan.random, 1, wiring, place)
    return _Axis(plan.random.count, plan.random.draw, columns)


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


def _index(lengths: Sequence[int]) -> list[Any]:
    """Return for each axis of the product which of its values each run has."""
    grid = np.indices(lengths, dtype=np.int64)
    return [axis.reshape(-1) for axis in grid]


def _labels(plan: Plan, index: list[Any], document: Document) -> Index:
    count = len(index[0])
    draw = index[-2] if plan.random is not None else _distinct(index[:-1])
    none = np.full(count, -1, dtype=np.int64)
    labels = Index(
        unit=none,
        age=np.full(count, np.nan),
        variant=index[0],
        draw=draw,
        block=np.zeros(count, dtype=np.int64),
        replicate=np.zeros(count, dtype=np.int64),
        seed=np.array(plan.seeds, dtype=np.int64)[index[-1]],
        split=np.full(count, "", dtype=object),
    )
    return _split(labels, plan, document) if plan.split else labels


def _split(labels: Index, plan: Plan, document: Document) -> Index:
    noun = "draw" if plan.population is None else "unit"
    groups = labels.draw if plan.population is None else labels.unit
    shares = {name: float(share) for name, share in plan.split.items()}
    return replace(
        labels, split=dealt(groups, shares, plan.split_seed, document.place(("split",)), noun)
    )


def _distinct(axes: Sequence[Any]) -> Any:
    """Number the combinations of several axes."""
    number = np.zeros(len(axes[0]), dtype=np.int64)
    for axis in axes:
        number = number * (int(axis.max()) + 1) + axis
    return number
