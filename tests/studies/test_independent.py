"""The study on logs of another program: its counts, its page, and one small run of it."""

import pytest

from studies.independent import IndependentResult, Plan, study_independent
from studies.independent.bench import CAUSES, TESTS, changed, injected, of_day, units
from studies.independent.campaign import Judged
from studies.independent.table import independent_table

PLAN = Plan(1, 4, 0, 7)


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
    ]  # fmt: skip
    result = IndependentResult(tuple(rows), PLAN, 1.0)
    found = {row["what"]: (row["hits"], row["logs"]) for row in result.rows}
    assert found["foreign, healthy, 1 baselines: alarms"] == (1, 3)
    assert found["foreign, healthy, 1 baselines: gated"] == (1, 3)
    assert found["causes that move the log: unknown"] == (2, 3)
    assert found["the same: a candidate above 0.9"] == (1, 3)
    assert found["single faults isolated"] == (1, 2)
    assert found["a wrong second fault"] == (1, 2)
    page = independent_table(result, "python -m studies independent")
    assert "| causes that move the log: unknown | 2 of 3 | 66.7 % |" in page
    assert page.count("| yes |") + page.count("| no |") >= len(result.checks)


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
