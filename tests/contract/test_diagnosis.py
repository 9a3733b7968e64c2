"""Every fault of every actuator, injected into its stand's tests, is found or reported as unseen.

The registry of actuators and their stands' procedures say what is run; none is known by name. Logs
are the reduced-order model's, of another day than the baseline's.
"""

from __future__ import annotations

from typing import Any

import pytest

from elevon import _core
from elevon.diagnose.engine.candidates import candidates_of
from elevon.units import parse_quantity
from studies.fault_limits.standard import Day, StandardTest, day_logs, diagnosed, standard_tests
from tests.contract import shipped

TESTED = [name for name in shipped.names() if standard_tests(shipped.actuator(name))]
#: Severities, of the largest that is considered.
PARTS = (1.0, 0.25, 0.0625)


def every(count: int | None, name: str) -> list[Any]:
    """Faults that the reduced-order model has, or some of them, spread over the catalogue."""
    known = candidates_of(shipped.actuator(name))
    return list(known if count is None else known[:: max(1, len(known) // count)][:count])


def severities(fault: Any, parts: tuple[float, ...]) -> tuple[float, ...]:
    """What is there or not is there; the rest at parts of the largest."""
    return (1.0,) if fault.whole else tuple(part * fault.high for part in parts)


def missed(
    name: str, test: StandardTest, faults: list[Any], parts: tuple[float, ...], limited: bool
) -> list[str]:
    """Faults that are neither named, nor ambiguous with a named one, nor reported as unseen."""
    actuator = shipped.actuator(name)
    chosen = [f.key for f in faults] if limited else None
    wanted = [(f, s) for f in faults for s in severities(f, parts)]
    days = [Day((f.text(s),), 10 + k) for k, (f, s) in enumerate(wanted)]
    baseline, *logs = day_logs(actuator, test, [Day((), 1), *days])
    out = []
    for (fault, severity), log in zip(wanted, logs, strict=True):
        answer = diagnosed(actuator, log, [baseline], chosen)
        named = {n for c in answer.faults for n in ((c.kind, c.place), *c.ambiguous_with)}
        if answer.status == "faulty" and (fault.kind, fault.place) in named:
            continue
        unseen = {(i["kind"], i["place"]): i["reason"] for i in answer.unobservable}
        limit = answer.detectable.get(fault.key)
        if unseen.get((fault.kind, fault.place)) or (limit is not None and severity < limit):
            continue
        out.append(f"{test.name}: {fault.key}={severity:g} (limit {limit}): said {answer.best}")
    return out


def halved(test: StandardTest) -> StandardTest:
    """The test's first half: what it requests is under way by then."""
    *before, trace = test.procedure.step
    seconds = 0.5 * parse_quantity(trace.duration, "s", "duration")
    short = trace.model_copy(update={"duration": f"{seconds:g} s"})
    steps = (*before, short)
    return StandardTest(test.name, test.procedure.model_copy(update={"step": steps}))


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.long if shipped.takes_actions(n) else ()) for n in TESTED],
)
def test_some_faults_are_found_or_reported_as_unseen(name: str) -> None:
    """The largest severity of a few faults of the catalogue, in half of one test."""
    test = halved(standard_tests(shipped.actuator(name))[0])
    able = every(None, name)
    few = able[:: max(1, len(able) // 3)][:3]
    assert missed(name, test, few, PARTS[:1], limited=True) == []


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "test"),
    [
        pytest.param(name, test, id=f"{name}-{test.name}")
        for name in TESTED
        for test in standard_tests(shipped.actuator(name))
    ],
)
def test_every_fault_at_three_severities(name: str, test: StandardTest) -> None:
    """Named, among those it is ambiguous with, below its stated limit, or unseen with reason."""
    assert missed(name, test, every(None, name), PARTS, limited=False) == []


@pytest.mark.long
@pytest.mark.parametrize("name", TESTED)
def test_every_fault_of_the_catalogue_is_a_candidate_or_reported_as_unseen(name: str) -> None:
    """What the healthy log's answer says covers the catalogue, each with a limit or a reason."""
    actuator = shipped.actuator(name)
    test = standard_tests(actuator)[0]
    baseline, log = day_logs(actuator, test, [Day((), 1), Day((), 2)])
    answer = diagnosed(actuator, log, [baseline])
    covered = {(i["kind"], i["place"]) for i in answer.unobservable if i["reason"]}
    for key in answer.detectable:
        kind, _, place = key.partition("@")
        c = next(c for c in candidates_of(actuator) if c.key == key)
        covered |= {*((kind, p) for p in (place, *c.same)), *c.ambiguous}
    whole = {(r["kind"], p) for r in _core.faults(actuator.wiring) for p in r["places"]}
    assert whole - covered == set()
