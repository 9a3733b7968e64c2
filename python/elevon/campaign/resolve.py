"""A plan becomes a list of runs, each complete in itself."""

from __future__ import annotations

import copy
import itertools
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.campaign.draw import ABSENT, axis_values, random_values
from elevon.campaign.plan import Case, Plan, Target
from elevon.documents import Document
from elevon.errors import InputError, unknown
from elevon.scenario import Scenario
from elevon.simulate import Run

__all__ = ["PlannedRun", "resolve_plan"]


@dataclass(frozen=True)
class PlannedRun:
    """One run of a plan.

    Attributes
    ----------
    run : Run
        What is simulated; ``run.number`` is its place in the plan.
    values : mapping
        Name of each varied quantity to its value in this run, as written.
    split : str
        Which part of the data it belongs to; empty without a split.
    """

    run: Run
    values: Mapping[str, Any]
    split: str = ""


@dataclass
class _Variant:
    """What one combination changes."""

    values: dict[str, Any] = field(default_factory=dict)
    parameters: dict[str, Any] = field(default_factory=dict)
    faults: list[Any] = field(default_factory=list)
    scenario: list[tuple[str, Any]] = field(default_factory=list)
    top: dict[str, Any] = field(default_factory=dict)


def resolve_plan(plan: Plan, document: Document) -> list[PlannedRun]:
    """Return every run of a plan: cases x axes x random draws x seeds, the last fastest.

    Parameters
    ----------
    plan : Plan
        As read.
    document : Document
        Where it came from: names places in errors, and is where relative files are looked for.

    Returns
    -------
    list of PlannedRun
        Numbered from 0.

    Raises
    ------
    InputError
        The plan is empty, or anything in it cannot be; the run and the place are named.
    """
    actuator = _actuator(plan, document)
    base = _base_scenario(plan, actuator, document)
    variants = list(_variants(plan, document))
    if not variants or not plan.seeds:
        raise InputError(f"{document.place()}: the plan is empty: it holds no run")
    splits = _splits(plan, len(variants))
    planned: list[PlannedRun] = []
    for index, variant in enumerate(variants):
        scenario, changed = _apply(variant, base, actuator, f"{document.place()}: run {index}")
        for seed in plan.seeds:
            number = len(planned)
            run = Run(changed, scenario, seed, f"{plan.name}-{number:06d}", number)
            planned.append(PlannedRun(run, {**variant.values, "seed": seed}, splits[index]))
    return planned


def _actuator(plan: Plan, document: Document) -> Actuator:
    reference = plan.actuator
    if reference.endswith(".toml") and document.folder is not None:
        near = document.folder / reference
        reference = str(near) if near.is_file() else reference
    actuator = Actuator.load(reference)
    return actuator.with_values(
        plan.parameters, source="plan", place=document.place(("parameters",))
    )


def _base_scenario(plan: Plan, actuator: Actuator, document: Document) -> dict[str, Any]:
    if isinstance(plan.scenario, str):
        path = plan.scenario
        if document.folder is not None and (document.folder / path).is_file():
            path = str(document.folder / path)
        return Scenario.load(path).to_dict()
    data = plan.scenario if plan.scenario is not None else actuator.default_scenario
    if data is None:
        raise InputError(f"{document.place()}: 'scenario' is missing")
    return Scenario.from_dict(data, document.place(("scenario",))).to_dict()


def _variants(plan: Plan, document: Document) -> Iterator[_Variant]:
    """Yield one variant for each combination of cases, axes and draws."""
    cases: list[Case | None] = list(plan.case) if plan.case is not None else [None]
    grids = [
        axis_values(axis, document.place(("vary", index))) for index, axis in enumerate(plan.vary)
    ]
    draws: list[list[Any]] = [[]]
    quantities: tuple[Target, ...] = ()
    if plan.random is not None:
        draws = random_values(plan.random, document.place(("random",)))
        quantities = plan.random.draw
    targets = [*plan.vary, *quantities]
    _no_twins(targets, document)
    for case, grid, draw in itertools.product(cases, itertools.product(*grids), draws):
        variant = _Variant()
        if case is not None:
            variant.values["case"] = case.name
            variant.parameters.update(case.parameters)
            variant.faults.extend(case.faults)
            variant.top.update(case.scenario)
        for target, value in zip(targets, [*grid, *draw], strict=True):
            _change(variant, target, value)
        yield variant


def _no_twins(targets: list[Any], document: Document) -> None:
    names = [target.name for target in targets]
    for index, name in enumerate(names):
        if name in names[:index]:
            raise InputError(f"{document.place()}: {name!r} is varied twice")


def _change(variant: _Variant, target: Target, value: Any) -> None:
    variant.values[target.name] = value
    if target.parameter is not None:
        variant.parameters[target.parameter] = value
    elif target.scenario is not None:
        variant.scenario.append((target.scenario, value))
    elif value is not ABSENT:
        kind, place = str(target.fault).split("@")
        fault = {"kind": kind, "place": place, "severity": value, **target.attributes}
        variant.faults.append(
            fault if target.profile is None else fault | {"profile": target.profile}
        )


def _apply(
    variant: _Variant, base: Mapping[str, Any], actuator: Actuator, place: str
) -> tuple[Scenario, Actuator]:
    data = {**copy.deepcopy(dict(base)), **copy.deepcopy(variant.top)}
    for path, value in variant.scenario:
        _set(data, path, value, place)
    if variant.faults:
        data["fault"] = [*data.get("fault", []), *variant.faults]
    scenario = Scenario.from_dict(data, place)
    return scenario, actuator.with_values(variant.parameters, source="plan", place=place)


_STEP = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)|\[(\d+)\]")


def _set(data: Any, path: str, value: Any, place: str) -> None:
    """Set one place of nested mappings and lists; the place must be one the scenario has."""
    steps: list[Any] = [m[1] if m[1] else int(m[2]) for m in _STEP.finditer(path)]
    written = "".join(f"[{s}]" if isinstance(s, int) else f".{s}" for s in steps).lstrip(".")
    if not steps or written != path:
        raise InputError(
            f"{place}: scenario = {path!r} is not a place such as command.terms[0].phase"
        )
    for step, following in itertools.pairwise(steps):
        if isinstance(step, int):
            if not isinstance(data, list) or step >= len(data):
                raise InputError(f"{place}: the scenario has no {path!r} (no entry {step})")
            data = data[step]
        elif not isinstance(data, dict):
            raise InputError(f"{place}: the scenario has no {path!r}")
        elif step in data:
            data = data[step]
        elif isinstance(following, int):
            raise unknown("place of the scenario", path, data, place)
        else:
            data = data.setdefault(step, {})
    last = steps[-1]
    if isinstance(last, int) and (not isinstance(data, list) or last >= len(data)):
        raise InputError(f"{place}: the scenario has no {path!r} (no entry {last})")
    data[last] = value


def _splits(plan: Plan, count: int) -> list[str]:
    """Deal the variants (never parts of a run, nor seeds of one variant) to the parts."""
    if not plan.split:
        return [""] * count
    order = np.random.default_rng(plan.split_seed).permutation(count)
    names, shares = list(plan.split), np.cumsum(list(plan.split.values()))
    dealt = [""] * count
    for rank, index in enumerate(order):
        part = int(np.searchsorted(shares, (rank + 0.5) / count, side="right"))
        dealt[int(index)] = names[min(part, len(names) - 1)]
    return dealt
