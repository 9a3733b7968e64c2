"""The doors `elevon.predict`, `elevon.next_inspection` and `elevon.fleet`."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from elevon.diagnose.engine.answer import Diagnosis
from elevon.diagnose.engine.candidates import CandidateFault, candidates_of
from elevon.errors import InputError
from elevon.option import Option
from elevon.prognose.answer import Prognosis
from elevon.prognose.fleet import Costs, FleetPlan, plan_fleet
from elevon.prognose.history import History, diagnosed, read_history
from elevon.prognose.mission import Mission
from elevon.prognose.next_inspection import NextInspection, assumptions
from elevon.prognose.next_inspection import next_inspection as when_to_look
from elevon.prognose.observation import Inspection, inspection
from elevon.prognose.page import prognosis_page
from elevon.prognose.predict import predict as look_ahead
from elevon.prognose.tabulate import respond
from elevon.progress import Progress, part
from elevon.simulate.prepare import ActuatorLike, as_actuator

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.prognose.response import ResponseTables
    from elevon.report import Report

#: Inspections as the filters take them, or the use at each diagnosis and the diagnosis.
_Seen = Sequence[tuple[float, Diagnosis]] | Sequence[Inspection | tuple[float, Diagnosis]]
#: A folder of inspections, or one that is read, too.
HistoryLike = Annotated[str | os.PathLike[str] | History | _Seen, Option(reads="path")]
MissionLike = str | os.PathLike[str] | Mission


def predict(
    history: HistoryLike,
    actuator: ActuatorLike,
    mission: MissionLike,
    *,
    survive: Annotated[Sequence[float], Option(metavar="N")] = (),
    particles: int = 2000,
    snapshots: bool = False,
    seed: int = 0,
    progress: Progress | None = None,
) -> Prognosis:
    """Predict how long a unit will do what it must.

    Parameters
    ----------
    history : path, History, or sequence of (float, Diagnosis) or Inspection
        Folder of dated diagnoses or logs, or what was read of one; or the unit's use at each
        diagnosis, in the mission's unit, and the diagnosis.
    actuator : Actuator, str or path
        The unit, calibrated.
    mission : Mission or path
        What it does and must.
    survive : sequence of float
        N of the probability to survive the next N; default: round ones.
    particles : int
        Possible units that are flown to their ends.
    snapshots : bool
        Whether the tables are corrected by runs at high fidelity.
    seed : int
        Of the filter.
    progress : callable, optional
        Called with the done fraction; returns False to stop.

    Raises
    ------
    InputError
        A history or mission that cannot be, logs that cannot be diagnosed, N below 0.
    """
    if any(not n >= 0.0 for n in survive):
        raise InputError("--survive: N must be 0 or more")
    model, flown = as_actuator(actuator), _mission(mission)
    given = _read(history, flown)
    tables = respond(model, flown, snapshots=snapshots, progress=part(progress, 0.0, 0.5))
    return _one(
        given, model, flown, tables, survive=survive, particles=particles, seed=seed,
        progress=part(progress, 0.5, 1.0),
    )  # fmt: skip


def _mission(given: MissionLike) -> Mission:
    return given if isinstance(given, Mission) else Mission.load(given)


def _read(given: HistoryLike, mission: Mission) -> History | _Seen:
    if isinstance(given, (str, os.PathLike)):
        return read_history(os.fspath(given), unit=mission.unit)
    return given


def _one(
    history: History | _Seen,
    model: Actuator,
    mission: Mission,
    tables: ResponseTables,
    *,
    survive: Sequence[float] = (),
    particles: int = 2000,
    seed: int = 0,
    serial: str = "",
    progress: Progress | None = None,
) -> Prognosis:
    if isinstance(history, History):
        serial = serial or history.serial
    seen = _inspections(history, model, tables, progress)
    result = look_ahead(
        seen, model, mission, response=tables, particles=particles, seed=seed, serial=serial
    )

    def page(answer: Prognosis, date: str | None) -> Report:
        assumed = assumptions(seen, tables, mission.usage, level=answer.level, seed=seed)
        return prognosis_page(
            answer, seen, tables.laws, actuator=model.name, assumed=assumed, date=date
        )

    return replace(result, horizons=tuple(survive), page=page)


def _inspections(
    history: History | _Seen, model: Actuator, tables: ResponseTables, progress: Progress | None
) -> list[Inspection]:
    candidates = candidates_of(model)
    if not isinstance(history, History):
        return [_inspected(item, tables, candidates) for item in history]
    read = diagnosed(history, model, progress=progress)
    return read.inspections(tables.laws, tables.units_by_name, candidates)


def next_inspection(
    history: HistoryLike,
    actuator: ActuatorLike,
    mission: MissionLike,
    *,
    risk: Annotated[float, Option(metavar="P")] = 0.01,
    particles: int = 2000,
    seed: int = 0,
    progress: Progress | None = None,
) -> NextInspection:
    """Say when to look at a unit again, and with which test.

    Parameters
    ----------
    history, actuator, mission, particles, seed, progress
        As `predict`.
    risk : float
        Accepted probability of failing before.

    Raises
    ------
    InputError
        As `predict`; a risk that the futures cannot show.
    """
    model, flown = as_actuator(actuator), _mission(mission)
    given = _read(history, flown)
    tables = respond(model, flown, progress=part(progress, 0.0, 0.5))
    seen = _inspections(given, model, tables, part(progress, 0.5, 0.8))
    serial = given.serial if isinstance(given, History) else ""
    result = look_ahead(
        seen, model, flown, response=tables, particles=particles, seed=seed, serial=serial
    )
    assumed = assumptions(seen, tables, flown.usage, level=result.level, seed=seed)
    test, findings = _test(given, model, part(progress, 0.8, 1.0))
    return when_to_look(result, risk, test=test, assumed=assumed, findings=findings)


def _test(
    history: History | _Seen, model: Actuator, progress: Progress | None
) -> tuple[str | None, list[str]]:
    """Return the test that tells most after the last diagnosis; or why none is named."""
    from elevon.nexttest.door import next_test

    last: list[Diagnosis | Mapping[str, object]] = []
    if isinstance(history, History):
        last += [e.diagnosis for e in history.entries[-1:] if e.diagnosis and not e.logs]
    try:
        return next_test(model, last, progress=progress).next.name, []
    except InputError as error:
        return None, [f"which test to look with is not known: {error}"]


def _inspected(
    item: Inspection | tuple[float, Diagnosis],
    tables: ResponseTables,
    candidates: Sequence[CandidateFault],
) -> Inspection:
    if isinstance(item, Inspection):
        return item
    usage, answer = item
    name = f"use {usage:g}"
    return inspection(
        answer.to_dict(stored=False), tables.laws, usage=float(usage), name=name,
        candidates=candidates,
    )  # fmt: skip


def fleet(
    histories: Annotated[Sequence[HistoryLike], Option(metavar="HISTORY")],
    actuator: ActuatorLike,
    mission: MissionLike,
    *,
    early: float = 1.0,
    late: float = 10_000.0,
    visit: float = 500.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> FleetPlan:
    """Predict several units of one type and group their maintenance.

    Parameters
    ----------
    histories : sequence of path, History or sequence of Inspection
        One folder of inspections a unit.
    actuator, mission, seed, progress
        As `predict`.
    early : float
        Cost of one unit of use thrown away.
    late : float
        Cost of a failure in service.
    visit : float
        Cost of a visit, for all units at it.

    Raises
    ------
    InputError
        As `predict`; two histories of one unit.
    """
    costs = Costs(early, late, visit)
    model, flown = as_actuator(actuator), _mission(mission)
    read = [_read(item, flown) for item in histories]
    pairs = zip(read, histories, strict=True)
    names = [_name(item, given, k) for k, (item, given) in enumerate(pairs)]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"two histories are of the unit {twice}")
    tables = respond(model, flown, progress=progress)
    units = {
        name: _one(item, model, flown, tables, seed=seed, serial=name)
        for name, item in zip(names, read, strict=True)
    }
    return plan_fleet(units, costs)


def _name(read: object, given: HistoryLike, number: int) -> str:
    if isinstance(read, History) and read.serial:
        return read.serial
    return Path(given).name if isinstance(given, (str, os.PathLike)) else f"unit {number + 1}"
