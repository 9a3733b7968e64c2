"""The study on logs of another program: its counts, its page, and one small run of it."""

from dataclasses import replace

import pytest

from studies.independent import IndependentResult, Plan, study_independent
from studies.independent.bench import (
    AND,
    CAUSES,
    TESTS,
    changed,
    injected,
    of_day,
    pairs,
    singles,
    together,
    units,
)
from studies.independent.campaign import Judged
from studies.independent.table import independent_table

PLAN = Plan(1, 4, 0, 7, 2, (0, 1, 3))


def judged(what, name="", status="healthy", best=(), p_other=0.0, most=0.0, moved=True):
    return Judged("foreign", what, name, "noload", 0, 400.0, 1, status, best, p_other, most,
                  moved, status == "faulty", 0.1)  # fmt: skip


def test_counts_are_those_of_the_answers():
    key = "backlash@transmission"
    rows = [
        judged("healthy"), judged("healthy", status="unknown_fault"),
        judged("healthy", status="model_does_not_fit"),
        judged("cause", "a", "unknown_fault"), judged("cause", "b", "faulty", (key,), most=0.95),
        judged("cause", "c", "faulty", (key,), p_other=0.5), judged("cause", "d", moved=False),
        judged("fault", key, "faulty", (key,)), judged("fault", key, "faulty", (key, "x@y")),
        judged("pair", f"{key}{AND}x@y", "faulty", ("x@y", key)),
        judged("pair", f"{key}{AND}x@y", "faulty", (key,)),
        replace(judged("healthy", status="faulty"), learned=True),
    ]  # fmt: skip
    result = IndependentResult(tuple(rows), PLAN, 1.0)
    found = {row["what"]: (row["hits"], row["logs"]) for row in result.rows}
    assert found["foreign, healthy, 1 baselines: alarms"] == (1, 3)
    assert found["foreign, healthy, 1 baselines: gated"] == (1, 3)
    assert found["causes that move the log: unknown"] == (2, 3)
    assert found["the same: a candidate above 0.9"] == (1, 3)
    assert found["single faults isolated"] == (1, 2)
    assert found["a wrong second fault"] == (1, 2)
    assert found["pairs of faults isolated"] == (1, 2)
    assert found["foreign, healthy, 1 baselines, spread learnt: alarms"] == (1, 1)
    page = independent_table(result, "python -m studies independent")
    assert "| causes that move the log: unknown | 2 of 3 | 66.7 % |" in page
    assert page.count("| yes |") + page.count("| no |") >= len(result.checks)


def test_two_faults_move_the_bench_as_each_does():
    unit = units(3, 1)[0]
    assert len(pairs(unit)) == 15
    for faults in [*singles(unit), *pairs(unit)]:
        both = changed(unit.bench, unit.sensors, together(faults))
        one = (unit.bench, unit.sensors)
        for fault in faults:
            one = changed(*one, fault.cause)
        assert both == one


def test_units_already_judged_are_not_judged_again(tmp_path, monkeypatch):
    made = []

    def unit_rows(unit, plan):
        made.append(unit.number)
        return [judged("healthy")]

    monkeypatch.setattr("studies.independent.campaign._of_unit", unit_rows)
    for count in (1, 2):
        plan = replace(PLAN, units=count)
        result = study_independent(plan, folder=tmp_path / "runs", processes=1)
        assert len(result.judged) == count
    assert made == [0, 1]


def test_causes_and_faults_change_the_bench_that_they_name():
    import numpy as np

    assert len({cause.name for cause in CAUSES}) == len(CAUSES) >= 30
    for unit in units(3, 4):
        bench, sensors = of_day(unit, np.random.default_rng(1))
        for cause in [*CAUSES, *(fault.cause for fault in injected(unit))]:
            same = changed(bench, sensors, cause) == (bench, sensors)
            assert not same or cause.counts != 1.0 or unit.bench.elastic


@pytest.mark.long
def test_a_unit_of_another_program_is_calibrated_and_judged():
    result = study_independent(PLAN, processes=1)
    assert len(result.of("healthy", baselines=1)) == PLAN.healthy * len(TESTS)
    assert {row.unit for row in result.judged} == {0}
