"""`python -m studies diagnosis-limits`: its plan, its judgement, its table; one small campaign."""

import json
from dataclasses import replace

import numpy as np
import pytest

from elevon.diagnose.engine.answer import Cause, Diagnosis
from elevon.errors import InputError, Interrupted
from studies import main
from studies.diagnosis_limits.campaign import Campaign, run_campaign
from studies.diagnosis_limits.judge import Injected, judged
from studies.diagnosis_limits.page import limits_report
from studies.diagnosis_limits.plan import FAULTS, planned
from studies.diagnosis_limits.result import DiagnosisLimits
from studies.diagnosis_limits.unit import draw_unit, of_the_day

UNITS = 8


def answer(*best, status="faulty", ambiguous_with=()):
    causes = tuple(
        Cause(kind, place, "1", 0.9, value, (value - 1e-3, value + 1e-3), ambiguous_with)
        for kind, place, value in best
    )
    keys = tuple(f"{kind}@{place}" for kind, place, _ in best)
    return Diagnosis(
        ("log",), status, 0.9, 0.05, 1e-4, causes, keys, 0.9, (), {}, (), (), seconds=0.1
    )


def perfect(item):
    """The row of a diagnosis that is right in everything."""
    status = "faulty" if item.truth else "healthy"
    result = answer(*[(t.kind, t.place, t.severity) for t in item.truth], status=status)
    return judged(result, item.trial.name, test=item.trial.test, group=item.group, unit=0,
                  truth=item.truth)  # fmt: skip


@pytest.fixture(scope="module")
def plan():
    return [item for unit in range(UNITS) for item in planned(0, unit)]


def test_the_plan_has_the_logs_it_must_have(plan):
    groups = [item.group for item in plan]
    assert groups.count("healthy") >= 200
    assert len(plan) - groups.count("healthy") >= 400
    assert len({item.trial.name for item in plan}) == len(plan)
    assert len({item.trial.seed for item in plan}) == len(plan)
    for fault in FAULTS:
        at = {
            abs(item.truth[0].severity)
            for item in plan
            if item.group == "single" and item.truth[0].kind == fault.kind
        }
        assert min(at) == pytest.approx(min(fault.limit, fault.loaded))
        assert max(at) == pytest.approx(fault.range)


def test_an_answer_counts_only_when_it_names_all_and_nothing_else():
    backlash, short = (
        Injected("backlash", "transmission", 0.01),
        Injected("short", "motor.phase_b", 0.2),
    )
    places = (("short", "motor.phase_b"), ("short", "motor.phase_c"))
    given = answer(("short", "motor.phase_a", 0.2), ambiguous_with=places)
    row = {"test": "noload", "group": "single", "unit": 0}
    assert judged(given, "x", **row, truth=[short]).named
    assert not judged(given, "x", **row, truth=[backlash]).named
    assert not judged(given, "x", **row, truth=[short, backlash]).named
    other = answer(("short", "motor.phase_a", 0.2), ambiguous_with=(*places, ("friction", "x")))
    assert not judged(other, "x", **row, truth=[short]).named
    assert not judged(replace(given, status="healthy"), "x", **row, truth=[short]).named
    healthy = judged(given, "x", **row, truth=[])
    assert healthy.alarm
    assert not healthy.named


def test_the_table_of_a_perfect_diagnosis(plan):
    result = DiagnosisLimits(Campaign(0, UNITS, tuple(perfect(item) for item in plan)))
    document = json.loads(json.dumps(result.to_dict()))
    failed = [check["name"] for check in document["checks"] if not check["passed"]]
    assert failed == ["share of 90 % intervals that cover, at most"]  # they all cover
    assert document["status"] == "fail"
    assert document["false_alarm_rate"] == 0.0
    assert sum(row["logs"] for row in document["rows"]) == len(plan)
    assert "Detection curve" in limits_report(result).html()


def test_days_differ_and_the_unit_stays():
    unit = draw_unit(3, 1)
    days = [of_the_day(unit, seed).parameters for seed in (1, 2)]
    assert days[0].value("friction.dynamic") != days[1].value("friction.dynamic")
    assert days[0].value("backlash.total") == days[1].value("backlash.total")
    ratio = [day.value("friction.dynamic") / unit.actuator.parameters.value("friction.dynamic")
             for day in days]  # fmt: skip
    assert np.abs(np.array(ratio) - 1.0).max() < 0.13


def test_bad_input_and_interruption(tmp_path):
    with pytest.raises(InputError, match="at least one"):
        run_campaign(units=0)
    with pytest.raises(Interrupted):
        run_campaign(units=1, folder=tmp_path, progress=lambda _: False)


@pytest.mark.long
def test_a_campaign_of_one_unit(tmp_path, capsys):
    """Another seed than the published one; a second call finds its logs finished."""
    out = tmp_path / "out"
    for _ in range(2):
        main(["diagnosis-limits", "--runs", "1", "--seed", "41", "--out", str(out),
              "--force", "--json"])  # fmt: skip
        document = json.loads(capsys.readouterr().out)
        assert document["faulty_logs"] == 68
    by_name = {check["name"]: check for check in document["checks"]}
    assert by_name["pairs named together"]["value"] >= 0.7
    assert by_name["false-alarm rate, lower end of its 95 % interval"]["passed"]
