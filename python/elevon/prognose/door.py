"""The doors `elevon.predict`, `next_inspection`, `fleet` and `learn_growth`."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np

from elevon.diagnose.engine.answer import Diagnosis
from elevon.diagnose.engine.candidates import CandidateFault, candidates_of
from elevon.errors import InputError
from elevon.option import Option
from elevon.prognose.answer import Prognosis
from elevon.prognose.fleet import Costs, FleetPlan, plan_fleet
from elevon.prognose.fleet_growth import (
    FleetGrowth,
    FleetUnit,
    by_life,
    learn_fleet,
    read_lives,
)
from elevon.prognose.history import History, diagnosed, read_history
from elevon.prognose.mission import CountedUse, Mission
from elevon.prognose.next_inspection import Assumed, NextInspection, assumptions
from elevon.prognose.next_inspection import next_inspection as when_to_look
from elevon.prognose.observation import Inspection, inspection
from elevon.prognose.page import prognosis_page
from elevon.prognose.predict import predict_by_tables
from elevon.prognose.tabulate import respond
from elevon.prognose.value_history import VALUE, read_value_history, value_tables
from elevon.progress import Progress, part
from elevon.simulate.prepare import ActuatorLike, as_actuator

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.prognose.manner import GrowthPrior
    from elevon.prognose.response import ResponseTables
    from elevon.report import Report

#: Inspections as the filters take them, or the use at each diagnosis and the diagnosis.
_Seen = Sequence[tuple[float, Diagnosis]] | Sequence[Inspection | tuple[float, Diagnosis]]
GrowthLike = FleetGrowth | str | os.PathLike[str]
Limit = Annotated[str, Option(metavar="QUANTITY")]
Bias = Annotated[float, Option(min=0.0)]
Covariates = Annotated[Sequence[str], Option(metavar="NAME=VALUE")]
Risk = Annotated[float, Option(metavar="P")]
#: A folder of inspections, or one that is read, too.
HistoryLike = Annotated[str | os.PathLike[str] | History | _Seen, Option(reads="path")]
MissionLike = str | os.PathLike[str] | Mission


@dataclass(frozen=True)
class _Given:
    """What a prediction is told beside the history: a fleet's growth, a bias, covariates."""

    growth: FleetGrowth | None
    covariates: Mapping[str, str]
    bias: float
    limit: str | None

    @classmethod
    def of(
        cls, growth: GrowthLike | None, covariate: Sequence[str], bias: float, limit: str | None
    ) -> _Given:
        """Read what was given.

        Raises
        ------
        InputError
            A growth file that is none, a covariate without a value, a bias outside 0 to 1.
        """
        if not 0.0 <= bias < 1.0:
            raise InputError(f"--bias {bias:g}: is not a share of the severity from 0 to 1")
        pairs = [item.partition("=") for item in covariate]
        wrong = next((c for c, pair in zip(covariate, pairs, strict=True) if not pair[2]), None)
        if wrong is not None:
            raise InputError(f"--covariate {wrong!r}: is not NAME=VALUE")
        read = growth if growth is None or isinstance(growth, FleetGrowth) else _growth(growth)
        return cls(read, {name.strip(): v.strip() for name, _, v in pairs}, bias, limit)

    def priors(self) -> dict[str, tuple[GrowthPrior, GrowthPrior]]:
        """Return what the fleet says of units with these covariates."""
        return {} if self.growth is None else self.growth.priors(self.covariates)


def _growth(path: str | os.PathLike[str]) -> FleetGrowth:
    from elevon.results import load

    read = load(path)
    if not isinstance(read, FleetGrowth):
        raise InputError(f"{os.fspath(path)}: is no growth file (elevon learn-growth writes one)")
    return read


@dataclass(frozen=True)
class _Case:
    """One unit to predict.

    Attributes
    ----------
    seen : sequence of Inspection
        Of it.
    tables : ResponseTables
        What its severities do.
    counted : Mission or CountedUse
        What is counted, and the loads to come.
    serial : str
        Its name.
    priors : mapping
        Of its growth, by fault.
    actuator : str
        What it is called on its page.
    findings : tuple of str
        What the reader should know of how it was read.
    """

    seen: Sequence[Inspection]
    tables: ResponseTables
    counted: Mission | CountedUse
    serial: str
    priors: Mapping[str, tuple[GrowthPrior, GrowthPrior]]
    actuator: str
    findings: tuple[str, ...] = ()


def predict(
    history: HistoryLike,
    actuator: ActuatorLike | None = None,
    mission: MissionLike | None = None,
    *,
    limit: Limit | None = None,
    growth: GrowthLike | None = None,
    covariate: Covariates = (),
    bias: Bias = 0.0,
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
        diagnosis, in the mission's unit, and the diagnosis. With `limit` a CSV file of
        measurements: use, severity, sd, p.
    actuator : Actuator, str or path, optional
        The unit, calibrated; not with `limit`.
    mission : Mission or path, optional
        What it does and must; not with `limit`.
    limit : str, optional
        Value at which the life of a measured unit ends, with its unit.
    growth : FleetGrowth or path, optional
        What a fleet says of growth (`learn_growth`).
    covariate : sequence of str
        ``NAME=VALUE`` of the unit, of the covariates of `growth`.
    bias : float
        Deviation of what all severities err by alike, as a share of them; a history cannot show it.
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
    given = _Given.of(growth, covariate, bias, limit)
    model, flown = _of_mission(actuator, mission, given)
    tables = _tables(model, flown, snapshots=snapshots, progress=part(progress, 0.0, 0.5))
    case = _case(history, model, flown, tables, given, progress=part(progress, 0.5, 1.0))
    return _one(case, survive=survive, particles=particles, seed=seed)


def _of_mission(
    actuator: ActuatorLike | None, mission: MissionLike | None, given: _Given
) -> tuple[Actuator | None, Mission | None]:
    """Return the actuator and its mission, or none of them where a value has a limit."""
    if given.limit is not None:
        if actuator is not None or mission is not None:
            raise InputError("--limit: is for a history without an actuator and a mission")
        return None, None
    if actuator is None or mission is None:
        raise InputError(
            "an actuator (--actuator) and a mission (--mission) are needed; a CSV file of "
            "measurements needs --limit instead"
        )
    return as_actuator(actuator), mission if isinstance(mission, Mission) else Mission.load(mission)


def _tables(
    model: Actuator | None, flown: Mission | None, *, snapshots: bool = False,
    progress: Progress | None = None,
) -> ResponseTables | None:  # fmt: skip
    if model is None or flown is None:
        return None
    return respond(model, flown, snapshots=snapshots, progress=progress)


def _case(
    history: HistoryLike,
    model: Actuator | None,
    flown: Mission | None,
    tables: ResponseTables | None,
    given: _Given,
    *,
    serial: str = "",
    progress: Progress | None = None,
) -> _Case:
    """Read one unit's history."""
    if given.limit is not None:
        return _measured(history, given)
    assert model is not None
    assert flown is not None
    assert tables is not None
    read = _read(history, flown)
    if isinstance(read, History):
        serial = serial or read.serial
    known = tables if given.growth is None else given.growth.tables(tables)
    seen = _biased(_inspections(read, model, tables, progress), given.bias)
    return _Case(seen, known, flown, serial, given.priors(), model.name)


def _measured(history: HistoryLike, given: _Given) -> _Case:
    """Read a CSV file of one unit's measurements."""
    if not isinstance(history, (str, os.PathLike)):
        raise InputError("--limit: the history is a CSV file of measurements")
    read = read_value_history(history, given.limit or "")
    learned = given.growth.growth.get(VALUE) if given.growth else None
    tables = value_tables(read, learned.life if learned else None)
    if given.growth is not None:
        tables = given.growth.tables(tables)
    findings = () if read.start == 0.0 else (
        f"severities are shares of the way from {read.start:g} {read.unit} of the new unit",
    )  # fmt: skip
    return _Case(
        _biased(read.inspections, given.bias), tables, CountedUse(read.unit_of_use), read.name,
        given.priors(), read.name, findings,
    )  # fmt: skip


def _biased(seen: Sequence[Inspection], bias: float) -> list[Inspection]:
    """Add what all severities err by alike."""
    return [
        replace(
            item,
            seen={
                key: replace(s, common=float(np.hypot(s.common, bias * (s.severity or 0.0))))
                for key, s in item.seen.items()
            },
        )
        for item in seen
    ]


def _read(given: HistoryLike, mission: Mission) -> History | _Seen:
    if isinstance(given, (str, os.PathLike)):
        return read_history(os.fspath(given), unit=mission.unit)
    return given


def _one(
    case: _Case, *, survive: Sequence[float] = (), particles: int = 2000, seed: int = 0
) -> Prognosis:
    result = predict_by_tables(
        case.seen, case.counted, case.tables, priors=case.priors, particles=particles,
        seed=seed, serial=case.serial,
    )  # fmt: skip

    def page(answer: Prognosis, date: str | None) -> Report:
        assumed = _assumed(case, answer.level, seed)
        return prognosis_page(
            answer, case.seen, case.tables.laws, actuator=case.actuator, assumed=assumed, date=date
        )

    findings = (*case.findings, *result.findings)
    return replace(result, horizons=tuple(survive), page=page, findings=findings)


def _assumed(case: _Case, level: float, seed: int) -> tuple[Assumed, ...]:
    return assumptions(
        case.seen, case.tables, case.counted.usage, priors=case.priors, level=level, seed=seed
    )


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
    actuator: ActuatorLike | None = None,
    mission: MissionLike | None = None,
    *,
    limit: Limit | None = None,
    growth: GrowthLike | None = None,
    covariate: Covariates = (),
    bias: Bias = 0.0,
    risk: Risk = 0.01,
    early: float = 1.0,
    late: float = 10_000.0,
    visit: float = 500.0,
    particles: int = 2000,
    seed: int = 0,
    progress: Progress | None = None,
) -> NextInspection:
    """Say when to look at a unit again, and with which test; or to replace it, or to wait.

    Parameters
    ----------
    history, actuator, mission, particles, seed, progress
        As `predict`.
    limit : str, optional
        Value at which the life of a measured unit ends, with its unit.
    growth : FleetGrowth or path, optional
        What a fleet says of growth (`learn_growth`).
    covariate : sequence of str
        ``NAME=VALUE`` of the unit, of the covariates of `growth`.
    bias : float
        Deviation of what all severities err by alike, as a share of them; a history cannot show it.
    risk : float
        Accepted probability of failing before.
    early : float
        Cost of one unit of use thrown away.
    late : float
        Cost of a failure in service.
    visit : float
        Cost of a visit, or of an inspection.

    Raises
    ------
    InputError
        As `predict`; a risk that the futures cannot show.
    """
    costs = Costs(early, late, visit)
    given = _Given.of(growth, covariate, bias, limit)
    model, flown = _of_mission(actuator, mission, given)
    tables = _tables(model, flown, progress=part(progress, 0.0, 0.5))
    case = _case(history, model, flown, tables, given, progress=part(progress, 0.5, 0.8))
    result = _one(case, particles=particles, seed=seed)
    assumed = _assumed(case, result.level, seed)
    test, findings = (None, []) if model is None else _test(
        history if not isinstance(history, (str, os.PathLike)) else _read(history, flown),  # type: ignore[arg-type]
        model, part(progress, 0.8, 1.0),
    )  # fmt: skip
    return when_to_look(result, risk, costs, test=test, assumed=assumed, findings=findings)


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
    histories: Annotated[Sequence[HistoryLike], Option(metavar="HISTORY")] = (),
    actuator: ActuatorLike | None = None,
    mission: MissionLike | None = None,
    *,
    limit: Limit | None = None,
    growth: GrowthLike | None = None,
    running: str | os.PathLike[str] | None = None,
    bias: Bias = 0.0,
    early: float = 1.0,
    late: float = 10_000.0,
    visit: float = 500.0,
    risk: Risk | None = None,
    horizon: float | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> FleetPlan:
    """Predict several units of one type and group their maintenance.

    Parameters
    ----------
    histories : sequence of path, History or sequence of Inspection
        One folder of inspections a unit, or with a limit a CSV of measurements; none with
        `running`.
    actuator, mission, seed, progress
        As `predict`.
    limit : str, optional
        Value at which the life of a measured unit ends, with its unit.
    growth : FleetGrowth or path, optional
        What a fleet says of growth (`learn_growth`).
    bias : float
        Deviation of what all severities err by alike, as a share of them; a history cannot show it.
    running : path, optional
        Units in use of which no severity is known: a CSV file as `learn_growth` takes it; their
        lives are those of `growth`.
    early : float
        Cost of one unit of use thrown away.
    late : float
        Cost of a failure in service.
    visit : float
        Cost of a visit, for all units at it.
    risk : float, optional
        Probability of failing before its visit that no unit may exceed.
    horizon : float, optional
        Use from now on that costs are counted over.

    Raises
    ------
    InputError
        As `predict`; two histories of one unit.
    """
    costs = Costs(early, late, visit)
    given = _Given.of(growth, (), bias, limit)
    units: dict[str, Prognosis] = {}
    if running is not None:
        units |= _by_life(running, given, seed)
    if histories:
        model, flown = _of_mission(actuator, mission, given)
        tables = _tables(model, flown, progress=progress)
        for number, item in enumerate(histories):
            case = _case(item, model, flown, tables, given)
            name = case.serial or _name(item, number)
            if name in units:
                raise InputError(f"two histories are of the unit {name}")
            units[name] = _one(replace(case, serial=name), particles=_OF_FLEET, seed=seed)
    return plan_fleet(units, costs, risk=risk, horizon=horizon)


_OF_FLEET = 1000  # possible units of each unit of a fleet


def _by_life(running: str | os.PathLike[str], given: _Given, seed: int) -> dict[str, Prognosis]:
    """Predict units of which only the use is known, by the distribution of lives."""
    if given.growth is None or given.growth.lives is None:
        raise InputError(
            "--running: needs --growth FILE with a distribution of lives "
            "(elevon learn-growth --censored FILE)"
        )
    rng = np.random.default_rng([18, seed])
    return {
        item.name: by_life(item, given.growth.lives, given.growth.unit, rng)
        for item in read_lives(running)
        if not item.failed
    }


def _name(given: HistoryLike, number: int) -> str:
    return Path(given).name if isinstance(given, (str, os.PathLike)) else f"unit {number + 1}"


def learn_growth(
    histories: Annotated[Sequence[HistoryLike], Option(metavar="HISTORY")] = (),
    actuator: ActuatorLike | None = None,
    mission: MissionLike | None = None,
    *,
    limit: Limit | None = None,
    censored: str | os.PathLike[str] | None = None,
    unit: str = "flights",
    seed: int = 0,
    progress: Progress | None = None,
) -> FleetGrowth:
    """Learn from a fleet how faults grow, from unit to unit, and how long lives are.

    Parameters
    ----------
    histories : sequence of path or History
        Folders of inspections, or with a limit CSVs of measurements: finished, removed or running.
    actuator, mission, seed, progress
        As `predict`.
    limit : str, optional
        Value at which the life of a measured unit ends, with its unit.
    censored : path, optional
        CSV file of lives: ``unit``, ``use``, ``failed`` (1 or 0), and covariates such as ``load``
        or ``site``. A unit whose name is a history's ended so; without any, histories are running.
    unit : str
        Of use, where no history says it.

    Raises
    ------
    InputError
        As `predict`; neither histories nor a file of lives.
    """
    given = _Given.of(None, (), 0.0, limit)
    lives = [] if censored is None else read_lives(censored)
    ends = {item.name: item for item in lives}
    if not histories:
        return learn_fleet([], None, unit=unit, lives=lives, seed=seed)
    model, flown = _of_mission(actuator, mission, given)
    tables = _tables(model, flown, progress=part(progress, 0.0, 0.3))
    units, counted = [], unit
    for number, item in enumerate(histories):
        case = _case(item, model, flown, tables, given)
        name = case.serial or _name(item, number)
        counted = case.counted.unit
        known = ends.get(name)
        last = max((i.usage for i in case.seen), default=0.0)
        if known is not None and known.use < last:
            raise InputError(
                f"{name}: its life ends at {known.use:g}, before its last inspection at {last:g}"
            )
        end = FleetUnit(name, (), last, failed=False) if known is None else known
        units.append(replace(end, inspections=tuple(case.seen)))
        tables = tables or case.tables
    return learn_fleet(
        units, tables, unit=counted, lives=lives, seed=seed, progress=part(progress, 0.3, 1.0)
    )
