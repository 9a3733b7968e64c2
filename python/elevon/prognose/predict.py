"""From inspections to the remaining useful life."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from itertools import groupby, pairwise
from math import erfc, inf, log, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.errors import InputError
from elevon.number_text import count_text
from elevon.prognose.answer import Branch, KnownFault, OffLaw, Prognosis, Reserve
from elevon.prognose.future import MODEL_ERROR, Future, look_ahead
from elevon.prognose.growth import COUNT, GrowthFilter
from elevon.prognose.observation import Inspection
from elevon.prognose.process import Process
from elevon.prognose.response import ResponseTables, check_start
from elevon.prognose.shapes import FREE
from elevon.prognose.tabulate import respond
from elevon.units import to_display

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.prognose.manner import GrowthPrior
    from elevon.prognose.mission import CountedUse, Mission, Usage
    from elevon.prognose.process import UnitPopulation

LEVEL = 0.9
_OUTSIDE = 0.01  # share of futures beyond the tables' loads that is stated
_LIKELY = 0.5  # probability from which a sighting counts as one
_LEAST = 3  # inspections that saw a fault before its growth counts as known


def predict(
    inspections: Sequence[Inspection],
    actuator: Actuator,
    mission: Mission,
    *,
    response: ResponseTables | None = None,
    snapshots: bool = False,
    particles: int = COUNT,
    level: float = LEVEL,
    seed: int = 0,
    serial: str = "",
) -> Prognosis:
    """Predict a unit's remaining useful life.

    Parameters
    ----------
    inspections : sequence of Inspection
        In the order of use; irregular in time as they come.
    actuator : Actuator
        The healthy unit, calibrated.
    mission : Mission
        What it does, must do, and what grows.
    response : ResponseTables, optional
        Tables made before, for a series of predictions.
    snapshots : bool
        Correct the tables by runs of the switching model.
    particles : int
        Possible units that are flown to their ends.
    level : float
        Of the intervals.
    seed : int
        Of chance.
    serial : str
        Of the unit.

    Raises
    ------
    InputError
        Use goes back; a new unit violates a requirement; the actuator cannot do the mission.
    """
    tables = response or respond(actuator, mission, snapshots=snapshots)
    return predict_by_tables(
        inspections, mission, tables, particles=particles, level=level, seed=seed, serial=serial
    )


def predict_by_tables(
    inspections: Sequence[Inspection],
    counted: Mission | CountedUse,
    tables: ResponseTables,
    *,
    priors: Mapping[str, tuple[GrowthPrior, GrowthPrior]] | None = None,
    particles: int = COUNT,
    level: float = LEVEL,
    seed: int = 0,
    serial: str = "",
) -> Prognosis:
    """Predict a unit's remaining useful life from tables of what severities do.

    Parameters
    ----------
    inspections, particles, level, seed, serial
        As `predict`.
    counted : Mission or CountedUse
        What is counted, and how the loads to come may differ.
    tables : ResponseTables
        Of the unit.
    priors : mapping of str to (GrowthPrior, GrowthPrior), optional
        As `GrowthFilter` takes them.

    Raises
    ------
    InputError
        As `predict`.
    """
    if not 0.0 < level < 1.0:
        raise InputError(f"level {level:g} must be between 0 and 1")
    _check_new(tables)
    made = clock.perf_counter()
    flt = GrowthFilter(Process(tables), seed=seed, priors=priors)
    check_order(inspections)
    for item in inspections:
        flt.update(item)
    updated = clock.perf_counter()
    result = prognosis(
        flt, counted, inspections, level=level, seed=seed, serial=serial, particles=particles
    )
    done = clock.perf_counter()
    result.seconds.update(  # type: ignore[attr-defined]
        {"tables": tables.seconds, "updates": updated - made, "prediction": done - updated}
    )
    return result


def prognosis(
    flt: GrowthFilter,
    mission: Mission | CountedUse,
    inspections: Sequence[Inspection],
    *,
    level: float = LEVEL,
    seed: int = 0,
    serial: str = "",
    particles: int = COUNT,
) -> Prognosis:
    """Look ahead from where a filter stands."""
    rng = np.random.default_rng([17, seed])
    units = flt.drawn(particles, rng)
    future = look_ahead(flt.process, units, mission.usage, rng, model_error=MODEL_ERROR)
    response = flt.process.response
    known = _known(flt, units, inspections, level)
    severity = np.array([item.severity for item in known])
    values = response.measured(severity[None, :])[:, 0]
    reserve = tuple(
        Reserve(
            item.name,
            item.measure,
            _measured(item, float(values[k]), known),
            response.thresholds[k],
            response.units[k],
        )
        for k, item in enumerate(response.requirements)
    )
    result = Prognosis(
        mission.unit,
        units.usage,
        level,
        future,
        tuple(item.name for item in response.requirements),
        known,
        reserve,
        (),
        serial or None,
        branches=_branches(known, inspections, units, future, level=level, unit=mission.unit),
    )
    return _with_findings(result, flt, inspections, mission.usage)


_CERTAIN = 0.02  # probability of either side below which a branch is not told apart


def _branches(
    known: Sequence[KnownFault],
    inspections: Sequence[Inspection],
    units: UnitPopulation,
    future: Future,
    *,
    level: float,
    unit: str,
) -> tuple[Branch, ...]:
    """Return the remaining lives with and without the seen fault that is least certain to be real.

    One branch where all that was seen is certain.
    """
    unsure = [
        (abs(item.growing - 0.5), k)
        for k, item in enumerate(known)
        if _CERTAIN < item.growing < 1.0 - _CERTAIN
        and any(_saw(i, item.key) for i in _since_reset(inspections, item.key))
    ]
    everything = np.ones(len(units), dtype=np.bool_)
    if not unsure:
        return (_branch("all that was seen is real", everything, future, level, unit),)
    real = units.active[:, min(unsure)[1]]
    name = known[min(unsure)[1]].kind.replace("_", " ")
    return (
        _branch(f"the {name} is real", real, future, level, unit),
        _branch(f"the {name} is not real", ~real, future, level, unit),
    )


def _branch(
    what: str, chosen: npt.NDArray[np.bool_], future: Future, level: float, unit: str
) -> Branch:
    ranked, tail = np.sort(future.remaining[chosen]), 0.5 * (1.0 - level)
    low, median, high = (
        float(ranked[min(int(share * len(ranked)), len(ranked) - 1)])
        for share in (tail, 0.5, 1.0 - tail)
    )
    return Branch(what, float(chosen.mean()), median, (low, high), level, unit)


def check_order(inspections: Sequence[Inspection]) -> None:
    """Raise `InputError` where use or date goes back."""
    for before, after in pairwise(inspections):
        if after.usage < before.usage:
            raise InputError(
                f"the history is out of order: use falls from {before.usage:g} ({before.name}) to "
                f"{after.usage:g} ({after.name})"
            )
        if before.date and after.date and after.date < before.date:
            raise InputError(
                f"the history is out of order: {after.name} ({after.date}, use {after.usage:g}) "
                f"is dated before {before.name} ({before.date}, use {before.usage:g})"
            )


def _check_new(response: ResponseTables) -> None:
    new = np.array([law.severity(np.array([law.start]))[0] for law in response.laws])
    broken = check_start(response, new)
    if broken:
        raise InputError(
            "a new unit violates what it must hold, so no life can be predicted: "
            + "; ".join(broken)
        )


def _measured(item: Any, value: float, known: Sequence[KnownFault]) -> float:
    if item.fault is None:
        return value
    return next(k.severity for k in known if f"{k.kind}@{k.place}" == item.fault)


def _known(
    flt: GrowthFilter, units: UnitPopulation, inspections: Sequence[Inspection], level: float
) -> tuple[KnownFault, ...]:
    tail = 0.5 * (1.0 - level)
    severity = flt.process.severity(units.damage)
    factors = flt.process.factors(units)
    out = []
    for k, law in enumerate(flt.process.laws):
        low, middle, high = np.quantile(severity[:, k], [tail, 0.5, 1.0 - tail])
        grows = units.active[:, k]
        paces = factors[grows, k] if grows.any() else np.zeros(1)
        slow, median, fast = np.quantile(paces, [tail, 0.5, 1.0 - tail])
        since = _since_reset(inspections, law.key)
        out.append(
            KnownFault(
                law.kind,
                law.place,
                law.unit,
                law.name,
                float(middle),
                (float(low), float(high)),
                float(median),
                (float(slow), float(fast)),
                sum(1 for i in since if _saw(i, law.key, _LIKELY)),
                float(grows.mean()),
                {law.name: flt.faults[k].by_law(), FREE: 1.0 - flt.faults[k].by_law()},
            )
        )
    return tuple(out)


def _saw(item: Inspection, key: str, least: float = 0.0) -> bool:
    seen = item.seen.get(key)
    return seen is not None and seen.severity is not None and seen.probability >= least


def _since_reset(inspections: Sequence[Inspection], key: str) -> Sequence[Inspection]:
    last = max((n for n, item in enumerate(inspections) if key in item.reset), default=-1)
    return inspections[last + 1 :]


def _with_findings(
    result: Prognosis, flt: GrowthFilter, inspections: Sequence[Inspection], usage: Usage
) -> Prognosis:
    from dataclasses import replace

    process = flt.process
    findings = list(_thin(result, inspections))
    off_law = tuple(OffLaw(*item) for item in flt.contradictions())
    findings += [OffLaw(*item).text for item in flt.surprises]
    findings += _of_one_use(inspections)
    seen = {key for item in inspections for key in item.seen}
    findings += _stray(flt, inspections)
    findings += [
        f"{law.key}: no inspection looked for it; its course is the law's alone"
        for law in process.laws
        if inspections and law.key not in seen
    ]
    at_end = 1.0 - result.survives(0.0)
    if at_end > 0.0:
        findings.append(
            f"the unit has already reached its end of life with a probability of {at_end:.2g}"
        )
    far = float(np.mean(~np.isfinite(result.future.end)))
    if far > 0.0:
        findings.append(f"no end of life is in sight in {100.0 * far:.3g} % of the futures")
    findings += _beyond(result, process) + _loads(process.response, usage)
    return replace(result, findings=tuple(findings), off_law=off_law)


def _stray(flt: GrowthFilter, inspections: Sequence[Inspection]) -> list[str]:
    """Say where the last diagnosis is taken as stray and, if it is true, the unit has failed."""
    if not inspections:
        return []
    last, response = inspections[-1], flt.process.response
    stray = [key for usage, key, score in flt.surprises if usage == last.usage and score > 0.0]
    severity = np.zeros(len(response.laws))
    for k, law in enumerate(response.laws):
        seen = last.seen.get(law.key)
        if law.key in stray and seen is not None and seen.severity is not None:
            severity[k] = seen.severity
    broken = check_start(response, severity) if severity.any() else []
    if not broken:
        return []
    return [
        f"{last.name}: if what it says of {', '.join(stray)} is true, the unit has failed already "
        f"({'; '.join(broken)}); one diagnosis so far off is taken as stray until another agrees"
    ]


def _of_one_use(inspections: Sequence[Inspection]) -> list[str]:
    """Say where inspections were made at the same use: they count as made one after the other."""
    out = []
    for usage, items in groupby(inspections, key=lambda item: item.usage):
        names = [item.name for item in items]
        if len(names) > 1:
            out.append(
                f"{len(names)} inspections at use {usage:g} ({', '.join(names)}): their errors are "
                "taken as independent"
            )
    return out


def _thin(result: Prognosis, inspections: Sequence[Inspection]) -> list[str]:
    """Say where the history is too short, and how wide the answer is."""
    most = max((item.inspections for item in result.known), default=0)
    if most >= _LEAST:
        return []
    low, high = result.interval
    if np.isfinite(high):
        wide = f"{count_text(low)} to {count_text(high)} {result.unit}"
    elif np.isfinite(low):
        wide = f"{count_text(low)} {result.unit} to no end in sight"
    else:
        wide = "no end in sight"
    renewed = " since its part was made new" if any(item.reset for item in inspections) else ""
    return [
        f"{most} inspection(s) saw a growing fault{renewed}; {_LEAST} are needed before its growth "
        "is known. Until then the answer is as wide as the laws' spread: "
        f"{wide} at {result.level:.0%}"
    ]


def _loads(response: ResponseTables, usage: Usage) -> list[str]:
    """Say how many futures have loads that the tables do not cover."""
    if not response.loaded:
        return []
    low, high = (float(response.grid.axes[-1][k]) for k in (0, -1))
    spread = usage.load_spread * sqrt(2.0)
    tails = [abs(log(edge / usage.load)) / spread if spread else inf for edge in (low, high)]
    outside = 0.5 * sum(erfc(tail) for tail in tails)
    if outside < _OUTSIDE:
        return []
    return [
        f"{outside:.0%} of the futures have loads outside {low:g} to {high:g} of the mission's, "
        "where the tables end; they count as there"
    ]


def _beyond(result: Prognosis, process: Process) -> list[str]:
    """Say where severities leave the tables."""
    out = []
    for k, law in enumerate(process.laws):
        if result.future.course[-1, k, 2] > 1.05 * law.highest:
            display = to_display(law.highest, law.unit)
            out.append(
                f"{law.key} grows beyond {display:.3g} {law.unit}, the last of the tables; what "
                "happens beyond is taken as there"
            )
    return out
