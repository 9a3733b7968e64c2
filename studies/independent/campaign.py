"""Logs of foreign units, made, read and diagnosed as a user does: healthy, faults, unknowns."""

from __future__ import annotations

import time as clock
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from elevon.diagnose.by_model import reading_of
from elevon.diagnose.engine.candidates import candidates_of
from elevon.diagnose.engine.case import case_of
from elevon.diagnose.engine.diagnosis import answer_of
from elevon.errors import ElevonWarning, InputError
from elevon.progress import Progress
from elevon.threads import one_blas_thread
from elevon.worklog import finished
from studies.common import Row
from studies.independent.bench import (
    AND,
    CAUSES,
    RATES,
    TESTS,
    Cause,
    Injected,
    Unit,
    pairs,
    singles,
    together,
    units,
    written,
)
from studies.side_by_side import side_by_side

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.answer import Diagnosis
    from elevon.diagnose.engine.reading import Reading
    from elevon.diagnose.engine.spread import LearnedSpread
    from elevon.logs.log import Log
    from studies.independent.result import IndependentResult

_RATE = 0.05  # of false alarms that is set
_FEW = (1, 3)  # baselines that a healthy log of another actuator is given
_BEYOND = 5.0  # deviations of the unit's healthy days, of one feature: a cause has moved the log
#: Actuators whose logs the switching model makes, for want of another program: test of each.
SWITCHING = (("nasa-ballscrew", "sine-opposing"), ("pisa-landing-gear", "extension-nominal"))


@dataclass(frozen=True)
class Plan:
    """How much is judged.

    Attributes
    ----------
    units, healthy : int
        Units of the foreign bench; healthy logs of each in each of three tests.
    switching : int
        Healthy logs of each other actuator, by the switching model.
    seed : int
        Of everything.
    learned : int
        Days of each test from which a unit's spread is learnt, none of them judged or a baseline.
    baselines : tuple of int
        Numbers of baselines that each healthy log is given.
    """

    units: int
    healthy: int
    switching: int
    seed: int
    learned: int = 7
    baselines: tuple[int, ...] = (0, 1, 3, 10)

    @property
    def key(self) -> str:
        """What tells its work from another's; units do not know how many they are."""
        return f"independent {replace(self, units=0)}"


@dataclass(frozen=True)
class Judged(Row):
    """One answer.

    Attributes
    ----------
    program : str
        That made the log: ``foreign``, or the actuator of the switching model.
    what : str
        ``healthy``, ``fault``, ``pair`` or ``cause``.
    name, test : str
        Of the faults (joined by `AND`) or cause; of the test.
    unit, rate, baselines : int, float, int
        Number of the unit, Hz of its logs, baselines.
    status, best : str, tuple of str
        Of the answer; ``refused`` where the log was.
    p_other, most : float
        Probability of no candidate, and of the most probable candidate.
    moved : bool
        Whether the log is beyond the unit's healthy days.
    covered : bool
        Whether each true severity lies in its interval.
    seconds : float
        Processor time.
    learned : bool
        Whether the spread was learnt from the unit's other days.
    """

    program: str
    what: str
    name: str
    test: str
    unit: int
    rate: float
    baselines: int
    status: str
    best: tuple[str, ...]
    p_other: float
    most: float
    moved: bool
    covered: bool
    seconds: float
    learned: bool = False


def study_independent(
    plan: Plan,
    *,
    folder: Path | None = None,
    processes: int | None = None,
    progress: Progress | None = None,
) -> IndependentResult:
    """Judge diagnosis on units, days and causes of another program.

    With a folder, finished units and actuators are noted there, and interrupted work goes on.

    Raises
    ------
    InputError
        Nothing to judge.
    Interrupted
        `progress` returned False.
    """
    from studies.independent.result import IndependentResult

    if plan.units < 1 or plan.healthy < 4:
        raise InputError("at least 1 unit and 4 healthy logs of each test are needed")
    begin = clock.perf_counter()
    calls = {f"unit {u.number}": partial(_of_unit, u, plan) for u in units(plan.seed, plan.units)}
    for name, test in SWITCHING if plan.switching else ():
        calls[name] = partial(_switching, name, test, plan)
    rows: dict[str, list[Judged]] = {}
    with finished(folder, plan.key) as done:
        noted = {} if done is None else done.items
        rows |= {
            n: [Judged.from_dict(r) for r in noted[n].data["rows"]] for n in calls if n in noted
        }
        left = {name: call for name, call in calls.items() if name not in rows}
        for name, found in side_by_side(left, processes=processes, progress=progress):
            rows[name] = found
            if done is not None:
                done.note(name, [], rows=[row.to_dict() for row in found])
    every = tuple(row for name in calls for row in rows[name])
    return IndependentResult(every, plan, clock.perf_counter() - begin)


@one_blas_thread()
def _of_unit(unit: Unit, plan: Plan) -> list[Judged]:
    """Calibrate a unit on a log of each test, then judge its other days."""
    from elevon import calibrate
    from elevon.diagnose.learning.spread import learned_spread

    out: list[Judged] = []
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", ElevonWarning)
        make = _Maker(unit, Path(folder), plan.seed).log
        actuator = calibrate([make(test, 0) for test in TESTS], "torino-rotary").actuator
        others = [make(test, 50 + n) for test in TESTS for n in range(plan.learned)]
        spread = learned_spread(others, actuator) if others else None
        for test in TESTS:
            base = [reading_of(make(test, 1 + n), actuator) for n in range(max(plan.baselines))]
            out += _of_test(_Judge(unit, test, actuator, base, spread), plan, make)
    return out


def _of_test(judge: _Judge, plan: Plan, make: Callable[..., Log]) -> list[Judged]:
    """Judge a unit's other days in one test: healthy, with one fault, with two, with a cause."""
    test, turn = judge.test, list(TESTS).index(judge.test)
    days = [make(test, 100 + n) for n in range(plan.healthy)]
    out = []
    for log in days:
        out += [judge.of("healthy", "", log, b) for b in plan.baselines]
        if judge.spread is not None:
            out.append(judge.of("healthy", "", log, 1, learned=True))
    usual = _usual([*judge.base, *(reading_of(log, judge.actuator) for log in days)])
    for n, faults in enumerate(singles(judge.unit)):
        if n % 2 == (judge.unit.number + turn) % 2:
            log = make(test, 1000 + n, together(faults))
            out.append(judge.injected(faults, log))
            if judge.spread is not None:
                out.append(judge.injected(faults, log, learned=True))
    for n, faults in enumerate(pairs(judge.unit)):
        if n % 5 == (judge.unit.number + turn) % 5:
            out.append(judge.injected(faults, make(test, 1500 + n, together(faults))))
    for n, cause in enumerate(CAUSES):
        if (n + judge.unit.number * len(TESTS) + turn) % 6 == 0:
            log = make(test, 2000 + n, cause)
            out.append(judge.of("cause", cause.name, log, 1, usual=usual))
    return out


@dataclass(frozen=True)
class _Maker:
    """Makes logs of a unit in a folder."""

    unit: Unit
    folder: Path
    seed: int

    def log(self, test: str, number: int, cause: Cause | None = None) -> Log:
        """Make one log, and read it as a user does."""
        from elevon.logs.read import read_logs

        run = 10_000 * (100 * self.seed + self.unit.number) + 3000 * list(TESTS).index(test)
        place = self.folder / str(number)
        return read_logs([written(self.unit, test, place, run + number, cause)])[0]


def _usual(items: Sequence[Reading]) -> dict[str, tuple[float, float]]:
    """Mean of each feature over healthy days, and the deviation of another day from it."""
    names = [n for n in items[0].features.names if all(n in i.features.names for i in items)]
    values = np.array([item.features.only(names).values for item in items])
    wide = values.std(axis=0, ddof=1) * np.sqrt(1.0 + 1.0 / len(items))
    return dict(zip(names, zip(values.mean(axis=0), wide, strict=True), strict=True))


@dataclass(frozen=True)
class _Judge:
    """Diagnoses logs of one unit in one test."""

    unit: Unit
    test: str
    actuator: Actuator
    base: Sequence[Reading]
    spread: LearnedSpread | None = None

    def injected(self, faults: Sequence[Injected], log: Log, *, learned: bool = False) -> Judged:
        """Return the answer to a log with one fault or two."""
        truth = {fault.key: fault.severity for fault in faults}
        what = "fault" if len(faults) == 1 else "pair"
        return self.of(what, AND.join(truth), log, 1, truth=truth, learned=learned)

    def of(
        self,
        what: str,
        name: str,
        log: Log,
        count: int,
        *,
        usual: dict[str, tuple[float, float]] | None = None,
        truth: dict[str, float] | None = None,
        learned: bool = False,
    ) -> Judged:
        """Return the answer to a log with so many baselines."""
        begin = clock.process_time()
        row = Judged("foreign", what, name, self.test, self.unit.number, self.unit.rate, count,
                     "refused", (), 0.0, 0.0, True, False, 0.0, learned)  # fmt: skip
        spread = self.spread if learned else None
        try:
            item = reading_of(log, self.actuator)
            answer = _answer(item, self.actuator, self.base[:count], spread)
        except InputError:
            return row
        return replace(
            row,
            status=answer.status,
            best=answer.best,
            p_other=answer.p_other,
            most=max([c.probability for c in answer.faults], default=0.0),
            moved=usual is not None and _far(item, usual) > _BEYOND,
            covered=truth is not None and _covered(answer, truth),
            seconds=clock.process_time() - begin,
        )


def _covered(answer: Diagnosis, truth: dict[str, float]) -> bool:
    """Whether the answer lists all faults, each with an interval that holds its severity."""
    ends = {f"{c.kind}@{c.place}": c.interval for c in answer.faults}
    return all(k in ends and ends[k][0] <= x <= ends[k][1] for k, x in truth.items())


def _far(item: Reading, usual: dict[str, tuple[float, float]]) -> float:
    """Largest deviation of a feature from the unit's healthy days, in theirs."""
    seen = zip(item.features.names, item.features.values.tolist(), strict=True)
    return float(max(abs(v - usual[n][0]) / usual[n][1] for n, v in seen if n in usual))


def _answer(
    item: Reading, actuator: Actuator, base: Sequence[Reading], spread: LearnedSpread | None
) -> Diagnosis:
    candidates = candidates_of(actuator)
    return answer_of([case_of(item, candidates, base, spread)], candidates, _RATE, spread)


@one_blas_thread()
def _switching(name: str, title: str, plan: Plan) -> list[Judged]:
    """Healthy days of another actuator, made by the package's own switching model.

    Each has the days after it as baselines: one bad baseline spoils one answer, not all.
    """
    from elevon import Actuator
    from studies.fault_limits.standard import Day, day_logs, standard_tests

    actuator = Actuator.load(name)
    test = next(t for t in standard_tests(actuator) if t.name == title)
    most = max(_FEW)
    days = [Day((), 100_000 * plan.seed + n) for n in range(most + plan.switching)]
    unit = Unit(0, None, None, RATES[0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ElevonWarning)
        logs = [
            replace(log, name=f"day {k}")
            for k, log in enumerate(day_logs(actuator, test, days, "high"))
        ]
        read = [reading_of(log, actuator) for log in logs]
        rows = []
        for k, log in enumerate(logs[: plan.switching]):
            base = [read[(k + 1 + j) % len(read)] for j in range(most)]
            judge = _Judge(unit, title, actuator, base).of
            rows += [judge("healthy", "", log, count) for count in _FEW]
    return [replace(row, program=name) for row in rows]
