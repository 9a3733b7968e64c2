"""Detection limit of each fault in each standard test of each actuator, and what stands behind it.

The limit is the least severity that moves a test's numbers by three deviations of a healthy unit
that has one healthy log as baseline. It is checked by logs of other days: healthy ones, and some
with a fault of twice the limit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.actuator import Actuator
from elevon.diagnose.learning.fit import share_interval
from elevon.errors import DivergedError, InputError, unknown
from elevon.progress import part
from elevon.report import Check, verdict
from elevon.worklog import finished
from studies.common import Row, advance
from studies.fault_limits.standard import Day, StandardTest, day_logs, diagnosed, standard_tests

if TYPE_CHECKING:
    from pathlib import Path

    from elevon.diagnose.engine.answer import Diagnosis
    from elevon.logs.log import Log
    from elevon.progress import Progress

__all__ = ["FaultLimits", "Limit", "LimitsPlan", "default_actuators", "study_fault_limits"]

FALSE_ALARM, NAMED = 0.05, 0.90
OVER = 2.0  # times the limit: severity of the logs that check it
_WHOLE = 1.0  # severity of what is there or not


@dataclass(frozen=True)
class Limit(Row):
    """One fault in one test.

    Attributes
    ----------
    actuator, test, kind, place, unit : str
        Which.
    limit : float or None
        Least severity that is seen; None where no severity is.
    reason : str
        Why none is.
    injected : float or None
        Severity of the log that checked it, if one did.
    alarm, named : bool or None
        Whether that log was called faulty, and the fault named or ambiguous with a named one.
    """

    actuator: str
    test: str
    kind: str
    place: str
    unit: str
    limit: float | None
    reason: str = ""
    injected: float | None = None
    alarm: bool | None = None
    named: bool | None = None


@dataclass(frozen=True)
class LimitsPlan:
    """What is done in each test.

    Attributes
    ----------
    days : int
        Healthy logs, beside the baseline.
    injected : int
        Faults that are checked by a log of twice the limit, spread over the list.
    fidelity : str
        Of the logs; the diagnosis uses the reduced-order model.
    seed : int
        Of the days.
    """

    days: int = 10
    injected: int = 12
    fidelity: str = "low"
    seed: int = 0


@dataclass(frozen=True)
class FaultLimits:
    """What was found out.

    Attributes
    ----------
    limits : tuple of Limit
        One a fault, test and actuator.
    healthy : dict of str to (int, int)
        Actuator to healthy logs called faulty, and healthy logs.
    fidelity, seed : str, int
        Of the logs.
    """

    limits: tuple[Limit, ...]
    healthy: dict[str, tuple[int, int]]
    fidelity: str
    seed: int

    @property
    def checks(self) -> list[Check]:
        """Each actuator's false alarms, and its faults of twice the limit."""
        out = []
        for name, (alarms, logs) in self.healthy.items():
            if logs:
                out.append(Check(f"{name}: false alarms, lower end of the 95 % interval",
                                 share_interval(alarms, logs)[0], FALSE_ALARM))  # fmt: skip
            tried = [x for x in self.limits if x.actuator == name and x.named is not None]
            if tried:
                share = float(np.mean([x.named for x in tried]))
                out.append(Check(f"{name}: faults of {OVER:g} times the limit named", share,
                                 NAMED, at_least=True))  # fmt: skip
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return what `--json` prints."""
        checks = self.checks
        return {
            **verdict(checks),
            "fidelity": self.fidelity,
            "seed": self.seed,
            "healthy": {
                name: {
                    "alarms": alarms,
                    "logs": logs,
                    "interval": list(share_interval(alarms, logs)),
                }
                for name, (alarms, logs) in self.healthy.items()
                if logs
            },
            "rows": [item.to_dict() for item in self.limits],
        }


def default_actuators() -> tuple[str, ...]:
    """Return the shipped actuator files, one of each wiring."""
    from elevon.actuator import list_actuators

    first: dict[str, str] = {}
    for name in list_actuators():
        first.setdefault(Actuator.load(name).wiring, name)
    return tuple(first.values())


def study_fault_limits(
    plan: LimitsPlan | None = None,
    *,
    actuators: Sequence[str] = (),
    folder: Path | None = None,
    progress: Progress | None = None,
) -> FaultLimits:
    """Find the limits and check them.

    Parameters
    ----------
    plan : LimitsPlan, optional
        Days, faults, fidelity, seed.
    actuators : sequence of str
        Names or files of sets; default: a shipped one of each wiring.
    folder : path, optional
        Where finished tests are noted, so that an interrupted run goes on; default: nowhere.
    progress : callable, optional
        As everywhere.

    Raises
    ------
    InputError
        Fewer than one day, an unknown fidelity.
    Interrupted
        `progress` returned False.
    """
    plan = plan or LimitsPlan()
    if plan.days < 1:
        raise InputError(f"--days {plan.days}: at least one")
    if plan.fidelity not in ("high", "low"):
        raise unknown("fidelity", plan.fidelity, ["high", "low"])
    names = actuators or default_actuators()
    work = [(a, t) for a in map(Actuator.load, names) for t in standard_tests(a)]
    limits: list[Limit] = []
    healthy = {a.name: (0, 0) for a, _ in work}
    with finished(folder, f"fault-limits {plan}") as done:
        for k, (actuator, test) in enumerate(work):
            share = part(progress, k / len(work), (k + 1) / len(work))
            name = f"{actuator.hash} {test.name}"
            if done is not None and name in done.items:
                rows, alarms = _noted(done.items[name].data)
            else:
                rows, alarms = _test_limits(actuator, test, plan, share)
                if done is not None:
                    done.note(name, [], rows=[row.to_dict() for row in rows], alarms=alarms)
            limits += rows
            before = healthy[actuator.name]
            healthy[actuator.name] = (before[0] + alarms, before[1] + plan.days)
    return FaultLimits(tuple(limits), healthy, plan.fidelity, plan.seed)


def _noted(data: dict[str, Any]) -> tuple[list[Limit], int]:
    return [Limit.from_dict(row) for row in data["rows"]], data["alarms"]


def _test_limits(
    actuator: Actuator, test: StandardTest, plan: LimitsPlan, progress: Progress | None
) -> tuple[list[Limit], int]:
    """Limits of one test, and how many of its healthy logs were called faulty."""
    first = 1000 * plan.seed
    whole = [Day((), first + k) for k in range(plan.days + 1)]
    base, *logs = day_logs(actuator, test, whole, plan.fidelity, part(progress, 0.0, 0.3))
    answers = []
    for k, log in enumerate(logs):
        answers.append(diagnosed(actuator, log, [base]))
        advance(progress, 0.3 + 0.3 * (k + 1) / len(logs), "fault-limits")
    rows = _rows(actuator, test, answers[0])
    tried = _spread([k for k, row in enumerate(rows) if row.limit is not None], plan.injected)
    severities = [_over(actuator, rows[k]) for k in tried]
    days = [
        Day((f"{rows[k].kind}@{rows[k].place}={severity!r}",), first + 500 + k)
        for k, severity in zip(tried, severities, strict=True)
    ]
    broken = _broken_logs(actuator, test, days, plan.fidelity)
    for done, (k, severity, faulty) in enumerate(zip(tried, severities, broken, strict=True)):
        if faulty is not None:
            rows[k] = _judged(rows[k], severity, diagnosed(actuator, faulty, [base]))
        advance(progress, 0.6 + 0.4 * (done + 1) / len(tried), "fault-limits")
    return rows, sum(answer.alarm for answer in answers)


def _broken_logs(
    actuator: Actuator, test: StandardTest, days: Sequence[Day], fidelity: str
) -> list[Log | None]:
    """Logs with faults, together; one by one where that fails, None for what this fidelity refuses.

    A log is the same to the bit either way.
    """
    try:
        return list(day_logs(actuator, test, days, fidelity))
    except (InputError, DivergedError):
        pass
    out: list[Log | None] = []
    for day in days:
        try:
            out += day_logs(actuator, test, [day], fidelity)
        except (InputError, DivergedError):
            out.append(None)
    return out


def _rows(actuator: Actuator, test: StandardTest, answer: Diagnosis) -> list[Limit]:
    """Every fault of the catalogue that the answer says something of."""
    from elevon.faults import catalogue

    units = {(r.kind, p): r.unit for r in catalogue(actuator.wiring) for p in r.places}
    rows = []
    for key, limit in answer.detectable.items():
        kind, _, place = key.partition("@")
        rows.append(Limit(actuator.name, test.name, kind, place, units[kind, place], limit))
    for item in answer.unobservable:
        kind, place = item["kind"], item["place"]
        unit = units[kind, place]
        rows.append(Limit(actuator.name, test.name, kind, place, unit, None, item["reason"]))
    return rows


def _spread(items: Sequence[int], count: int) -> list[int]:
    """As many of the items, evenly over their order."""
    if count >= len(items):
        return list(items)
    return [items[int(k)] for k in np.linspace(0, len(items) - 1, count)] if count else []


def _over(actuator: Actuator, row: Limit) -> float:
    """Twice the limit, within the catalogue's range; what is there or not is there."""
    from elevon.faults import find_record

    record = find_record(row.kind, row.place, actuator.wiring)
    if record.whole or record.switched:
        return _WHOLE
    assert row.limit is not None
    return min(OVER * row.limit, record.maximum)


def _judged(row: Limit, severity: float, answer: Diagnosis) -> Limit:
    alarm = answer.alarm
    return replace(row, injected=severity, alarm=alarm, named=alarm and names_it(answer, row))


def names_it(answer: Diagnosis, fault: Limit) -> bool:
    """Whether an answer names a fault, or has it among those a cause is ambiguous with."""
    wanted = (fault.kind, fault.place)
    return any(wanted in {(c.kind, c.place), *c.ambiguous_with} for c in answer.faults)
