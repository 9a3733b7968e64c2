"""The study of a campaign that is learnt: its plan, its counts; one small run of it."""

import numpy as np
import pytest

from elevon.campaign import load_plan, resolve_plan
from studies.learned_campaign import LearnedCampaign, plan_text, study_learned_campaign


def test_units_that_judge_are_no_units_that_were_learnt(tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text(plan_text(10, 5, "low", 0))
    index = resolve_plan(*load_plan(path)).index
    units = {part: set(index.unit[index.split == part]) for part in ("train", "test")}
    assert (len(units["train"]), len(units["test"])) == (10, 5)
    assert not units["train"] & units["test"]
    assert len(np.unique(index.unit)) == 15


def test_what_is_too_slow_or_calls_too_many_healthy_units_faulty_fails():
    row = {"baselines": 1, "healthy": 200, "false_alarms": 10, "severities": 400, "covered": 360}
    assert all(check.passed for check in LearnedCampaign([row], {}, 0.001).checks)
    bad = {**row, "false_alarms": 40, "covered": 300}
    assert [c.passed for c in LearnedCampaign([bad], {}, 0.02).checks] == [False] * 3


@pytest.mark.long
def test_a_small_campaign_is_learnt_and_judged(tmp_path):
    result = study_learned_campaign(tmp_path / "set", units=30, judged=8, fidelity="low")
    assert [row["baselines"] for row in result.rows] == [0, 1, 3]
    with_baseline = result.rows[1]
    assert with_baseline["single_first"] > 0.8 * with_baseline["singles"]
    assert result.seconds < 0.010
