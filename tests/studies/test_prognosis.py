"""The run-to-failure histories: what inspections say of them, the figures, the command."""

import json
import math
from functools import partial

import numpy as np
import pytest

from elevon import Actuator
from elevon.errors import InputError, Interrupted
from elevon.prognose import ResponseTables
from elevon.prognose.future import Life
from elevon.prognose.metrics import Track
from elevon.prognose.response import Grid
from studies import main
from studies.prognosis import campaign
from studies.prognosis.campaign import (
    InspectionPlan,
    campaign_mission,
    study_prognosis,
)
from studies.prognosis.result import PrognosisResult, UnitResult
from studies.prognosis.truth import (
    BASELINE_DAYS,
    FAULTS,
    INSPECTION_DAYS,
    INSPECTIONS,
    Inspector,
    UnitTruth,
    _of_the_baselines,
    other_law,
)
from studies.side_by_side import side_by_side


def unit(law, error, number=0):
    usage = np.arange(5.0, 100.0, 5.0)
    true = 100.0 - usage
    track = Track(usage, true * (1.0 + error), 0.8 * true, 1.2 * true, 100.0)
    far = Track(usage, 3.0 * true, 2.0 * true, 4.0 * true, 100.0)
    return UnitResult(number, law, "tracking error", track, far, 0.1)


def inspected(truth, count=1000, **options):
    """Inspections at even uses over a life."""
    inspector = Inspector(truth, campaign_mission().laws(), 0, **options)
    uses = np.linspace(0.0, truth.life.end, count, endpoint=False)
    return [inspector.at(float(usage)) for usage in uses]


def test_the_next_inspection_is_due_in_a_tenth_of_what_is_surely_left():
    plan = InspectionPlan(interval=100.0, soonest=10.0)
    assert [plan.wait(least) for least in (1e7, 500.0, 50.0, 0.0)] == [100.0, 50.0, 10.0, 10.0]


def test_inspections_err_as_stated_and_name_what_they_do_not_see():
    base = Actuator.load("torino-rotary")
    usage = np.linspace(0.0, 1e5, 50)
    life = Life(usage, np.full((50, 1), 0.2), 1e5, 0)
    truth = UnitTruth(2, "insulation", life, base)
    seen = inspected(truth)
    severities = np.array([item.seen["short@motor.phase_a"].severity for item in seen])
    drawn = INSPECTIONS["insulation"]
    offset = severities.mean() - 0.2 - float(drawn.mean(np.array(0.2)))
    assert abs(offset) < 3.0 * float(drawn.common(np.array(0.2)))
    assert severities.std() == pytest.approx(float(drawn.per_visit(np.array(0.2))), rel=0.1)
    stated = [item.seen["short@motor.phase_a"].high for item in seen]
    np.testing.assert_allclose(stated, drawn.stated(severities), rtol=1e-6)
    assert all(item.seen["backlash@transmission"].severity is None for item in seen)


def test_friction_is_stated_against_the_healthy_days_and_not_beyond_what_diagnosis_looks_at():
    """(1 + said) scatters as (1 + severity) does; an edge leaves open what is above it."""
    drawn, rng = INSPECTIONS["lubricant_loss"], np.random.default_rng(0)
    drawn_values = np.array([drawn.estimate_of(1.0, (0.0, 0.0, 0.03), rng) for _ in range(2000)])
    day = np.log1p(drawn_values - float(drawn.mean(np.array(1.0)))) - np.log(2.0)
    assert day.mean() == pytest.approx(-0.03, abs=0.002)
    whole = np.hypot(drawn.of_the_day / np.sqrt(INSPECTION_DAYS), 0.5 * drawn.absolute)
    assert day.std() == pytest.approx(whole, rel=0.08)
    base, usage = Actuator.load("torino-rotary"), np.linspace(0.0, 1e4, 50)
    truth = UnitTruth(1, "lubricant_loss", Life(usage, np.full((50, 1), 2.6), 1e4, 0), base)
    inspections = inspected(truth, 100)
    seen = [item.seen["friction@transmission"] for item in inspections]
    assert max(item.severity for item in seen) == 2.0
    assert np.median([item.high for item in seen]) > 2.0


def test_measured_requirements_are_the_truths_with_the_scatter_of_a_day():
    base, usage = Actuator.load("torino-rotary"), np.linspace(0.0, 1e5, 50)
    requirements = campaign_mission().requirement[:2]
    law = campaign_mission().laws()[0]
    grid = Grid((np.array([0.0, law.highest]),))
    values = np.array([[0.02, 0.5], [0.06, 0.7]])
    response = ResponseTables(
        (law,),
        requirements,
        (0.02, 0.88),
        ("rad", "A"),
        grid,
        {"hours": np.ones(2)},
        values,
        2,
        "high",
    )
    life = Life(usage, np.full((50, 1), 0.25 * law.highest), 1e5, 0)
    truth = UnitTruth(0, "gear_wear", life, base, response)
    seen, measured = inspected(truth), inspected(truth, measured=True)
    assert [item.seen for item in measured] == [item.seen for item in seen]
    for name, value, spread in (("tracking error", 0.03, 0.002), ("current", 0.55, 0.024)):
        severities = np.array([item.measured[name].value for item in measured])
        assert severities.mean() == pytest.approx(
            value, rel=3.0 * spread / np.sqrt(len(severities))
        )
        assert severities.std() == pytest.approx(spread * value, rel=0.1)
        assert measured[0].measured[name].deviation == pytest.approx(spread * value)


def test_the_calibrated_set_has_the_friction_of_the_healthy_days():
    """What is said against those days is looked at in a set of those days: their part cancels."""
    deviations = np.array([_of_the_baselines(k, 0) for k in range(400)])
    day = INSPECTIONS["lubricant_loss"].of_the_day / np.sqrt(BASELINE_DAYS)
    assert deviations.std() == pytest.approx(day, rel=0.1)
    assert _of_the_baselines(3, 0) == deviations[3]


def test_the_truth_has_other_laws_than_the_filter():
    rng = np.random.default_rng(0)
    for law in campaign_mission().laws():
        other = other_law(law, rng)
        assert other.grain > law.grain
        damage = law.damage(np.array([0.5 * law.highest]))
        drivers = {name: np.full(1, 420.0) for name in law.drivers}
        assert other.growth(damage, drivers) != law.growth(damage, drivers)
    assert [law.name for law in campaign_mission().laws()] == list(FAULTS)


def test_the_figures_are_those_of_the_tracks():
    good = PrognosisResult((unit("gear_wear", 0.1), unit("insulation", -0.05)), 0, 1.0)
    assert good.accuracy() == pytest.approx(0.925, abs=1e-6)
    assert good.accuracy("insulation") == pytest.approx(0.95, abs=1e-6)
    assert good.accuracy(track="unaided") == pytest.approx(-1.0)
    assert good.covered() == 1.0
    failed = [check.name for check in good.checks if not check.passed]
    assert failed == ["coverage of the 90 % interval, at most"]
    values = good.to_dict()
    assert values["status"] == "fail"
    assert values["summary"][-1]["law"] == "all"
    json.dumps(values)


def test_too_few_histories_are_refused():
    with pytest.raises(InputError, match="at least 3"):
        study_prognosis(histories=2)


def test_an_interrupted_campaign_goes_on_from_its_finished_histories(tmp_path, monkeypatch):
    """Each history is done once, and what is noted gives the same figures to the last bit."""
    calls = []

    def history(number, seed, _expected, *, measured):
        assert not measured
        calls.append(number)
        if number == 4:
            return {"left_out": "history 4: no inspection"}
        return {"unit": unit(FAULTS[number % 3], 0.01 * number + 1e-3 * seed, number).noted()}

    monkeypatch.setattr(campaign, "_history", history)
    monkeypatch.setattr(campaign, "_expected", dict)
    work = {"histories": 6, "seed": 7, "processes": 1}
    whole = study_prognosis(**work)
    with pytest.raises(Interrupted):
        study_prognosis(**work, folder=tmp_path, progress=lambda done: done < 0.4)
    assert calls[6:] == [0, 1, 2]
    again = study_prognosis(**work, folder=tmp_path)
    assert calls[9:] == [3, 4, 5]
    assert {**again.to_dict(), "seconds": 0.0} == {**whole.to_dict(), "seconds": 0.0}
    assert again.left_out == ("history 4: no inspection",)
    assert len(study_prognosis(**{**work, "histories": 3}, folder=tmp_path).units) == 3
    assert len(calls) == 12


@pytest.mark.parametrize("processes", [1, 2])
def test_work_side_by_side_is_the_same_work(processes):
    calls = {f"root of {n}": partial(math.sqrt, n) for n in range(5)}
    done = []
    results = side_by_side(calls, processes=processes, progress=lambda d: done.append(d) or True)
    assert dict(results) == {f"root of {n}": math.sqrt(n) for n in range(5)}
    assert done[-1] == 1.0


@pytest.mark.long
def test_the_command(tmp_path, capsys):
    words = ["prognosis", "--histories", "3", "--out", str(tmp_path), "--json"]
    code = main(words)
    values = json.loads(capsys.readouterr().out)
    assert code in (0, 1)  # three lives decide nothing
    assert [row["law"] for row in values["rows"]] == list(FAULTS)
    assert (tmp_path / "report.html").is_file()
    assert main([*words, "--force", "--processes", "1"]) == code
    again = json.loads(capsys.readouterr().out)
    assert {**again, "seconds": 0.0} == {**values, "seconds": 0.0}  # from the finished histories
