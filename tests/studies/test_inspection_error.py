"""`python -m studies inspection-error`: its plan, its fit, its figures; one small run."""

import json

import numpy as np
import pytest

from elevon.errors import InputError
from studies import main
from studies.diagnosis_limits.unit import DAILY, draw_unit
from studies.inspection_error import campaign, plan
from studies.inspection_error.campaign import Inspected, friction_of, inspect_units
from studies.inspection_error.fit import _surprise, fitted, fitted_interval, stated
from studies.inspection_error.plan import (
    BASELINES,
    DAYS,
    FAULTS,
    Growing,
    healthy_trials,
    visits,
)
from studies.inspection_error.result import InspectionErrors
from studies.prognosis.truth import INSPECTIONS

LAW = {fault.law: fault for fault in FAULTS}


def test_an_inspection_is_one_log_a_test_of_one_day_and_no_day_comes_twice():
    of_fault = visits(5, 2)
    assert len(of_fault) == 40
    for visit in of_fault:
        assert [t.test for t in visit.trials] == ["noload", "chirp", "loaded"]
        assert len({t.day for t in visit.trials}) == 1
        assert len({t.seed for t in visit.trials}) == 3
    days = [t.day for u in (2, 3) for t in healthy_trials(5, u)]
    days += [v.trials[0].day for u in (2, 3) for v in visits(5, u)]
    assert len(set(days)) == 2 * (BASELINES + 40)
    seeds = [t.seed for u in (2, 3) for v in visits(5, u) for t in v.trials]
    assert len(set(seeds)) == len(seeds)
    severities = {v.severity for v in of_fault if v.law == "insulation" and v.level == 0}
    assert len(severities) == 1
    assert severities.pop() == pytest.approx(0.05, rel=0.11)


def test_the_fit_recovers_what_the_errors_were_drawn_with():
    rng = np.random.default_rng(3)
    groups = []
    for _ in range(60):
        s = np.repeat([0.1, 0.5, 2.0], 6)
        unit = 0.03 * rng.standard_normal() + 0.05 * rng.standard_normal() * s
        groups.append((s, unit + np.hypot(0.04 * s, 0.02) * rng.standard_normal(len(s))))
    scatter = fitted(groups)
    assert scatter.relative == pytest.approx(0.04, rel=0.1)
    assert scatter.absolute == pytest.approx(0.02, rel=0.1)
    assert scatter.common_relative == pytest.approx(0.05, rel=0.25)
    assert scatter.common_absolute == pytest.approx(0.03, rel=0.25)
    s, r = groups[0]
    cover = np.diag((0.04 * s) ** 2 + 0.02**2) + 0.05**2 * np.outer(s, s) + 0.03**2
    whole = 0.5 * (np.linalg.slogdet(cover)[1] + r @ np.linalg.solve(cover, r))
    assert _surprise(np.array([0.04, 0.02, 0.05, 0.03]), groups)[0] == pytest.approx(whole)
    low, high = fitted_interval(groups[:12], seed=0)
    assert low.relative < 0.04 < high.relative
    assert low.common_relative < 0.05 < high.common_relative
    estimates = np.array([0.1, 0.3, 1.0, 2.0])
    assert stated(estimates, np.hypot(0.08 * estimates, 0.02)) == pytest.approx(
        (0.08, 0.02), rel=1e-3
    )


def drawn(seed, *, worse=1.0, units=6):
    """Inspections as the histories draw them, errors and days worse than that by a factor."""
    rng, out = np.random.default_rng(seed), []
    for unit in range(units):
        for law, error in INSPECTIONS.items():
            common = (*rng.standard_normal(2), 0.04 / np.sqrt(3.0) * rng.standard_normal())
            for level, severity in enumerate(LAW[law].levels):
                for k in range(DAYS):
                    estimates = severity + worse * (
                        error.estimate_of(severity, common, rng) - severity
                    )
                    deviation = float(error.stated(np.array(estimates)))
                    days = DAYS if law == "lubricant_loss" and k == 0 else 1
                    out.append(
                        Inspected(f"{unit}-{law}-{level}-{k}", unit, law, level, severity, days,
                                  1.0, estimates, deviation, deviation, error.detectable, ())
                    )  # fmt: skip
    return tuple(out)


@pytest.mark.long
def test_the_histories_pass_their_own_checks_and_worse_inspections_do_not():
    values = InspectionErrors(0, 6, drawn(0)).to_dict()
    assert values["status"] == "pass"
    json.dumps(values)
    failed = [c.name for c in InspectionErrors(0, 6, drawn(0, worse=4.0)).checks if not c.passed]
    assert sum("RMS" in name for name in failed) == 3


@pytest.mark.long
def test_the_rows_say_what_the_inspections_err_by():
    result = InspectionErrors(0, 6, drawn(1))
    rows = {(row["fault"], row["days"]): row for row in result.rows()}
    assert list(rows) == [("backlash@transmission", 1), ("friction@transmission", 1),
                          ("friction@transmission", 3), ("short@motor.phase_a", 1)]  # fmt: skip
    short, expected = rows["short@motor.phase_a", 1], INSPECTIONS["insulation"]
    np.testing.assert_allclose(
        [error for _, error in short["offset"]],
        expected.mean(np.array([s for s, _ in short["offset"]])), atol=0.012,
    )  # fmt: skip
    assert short["absolute"] == pytest.approx(expected.absolute, rel=0.5)
    assert short["stated_relative"] == pytest.approx(expected.stated_relative, rel=1e-3)


def test_the_friction_of_the_days_is_taken_out():
    unit = draw_unit(31, 0)
    healthy = healthy_trials(31, 0)
    assert friction_of(unit, healthy) == pytest.approx(
        np.mean([friction_of(unit, [trial]) for trial in healthy])
    )
    ratio = friction_of(unit, healthy[:1]) / unit.actuator.parameters.value("friction.dynamic")
    assert 0.0 < abs(ratio - 1.0) < 3.0 * DAILY["friction.dynamic"]
    row = Inspected("a", 0, "lubricant_loss", 1, 1.0, 1, 1.1, 1.2, 0.1, 0.1, 0.1, ())
    assert row.error == pytest.approx(0.0)


def test_one_unit_is_refused():
    with pytest.raises(InputError, match="--units 1: at least two"):
        inspect_units(units=1)


@pytest.mark.long
def test_a_small_run_goes_on_where_it_stopped(tmp_path, monkeypatch, capsys):
    """Two units, a severity of backlash and one of friction, another seed than the judged one."""
    small = (
        Growing("gear_wear", "backlash@transmission", (2e-3,)),
        Growing("lubricant_loss", "friction@transmission", (1.0,)),
    )
    monkeypatch.setattr(plan, "FAULTS", small)
    rows = inspect_units(seed=77, units=2, folder=tmp_path)
    monkeypatch.setattr(campaign, "_severity", None)
    assert inspect_units(seed=77, units=2, folder=tmp_path) == rows
    backlash = [row for row in rows if row.law == "gear_wear"]
    assert max(abs(row.error) for row in backlash) < 0.1 * 2e-3
    friction = [row for row in rows if row.law == "lubricant_loss"]
    assert {row.days for row in friction} == {1, 3}
    assert max(abs(row.error) for row in friction) < 0.15
    assert main(["inspection-error", "--units", "1"]) == 2
    assert capsys.readouterr().out == ""
