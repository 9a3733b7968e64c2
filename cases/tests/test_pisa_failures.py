"""Failure cases of the landing gear: what the unit indicates is true, or no sensor could know."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import elevon
from elevon.faults.catalogue import catalogue
from elevon_cases.pisa.failures import (
    LISTED,
    PHASES,
    failure_checks,
    failures_page,
    judge,
    reproduce_failures,
    summary,
)
from elevon_cases.pisa.gear import ACTUATOR
from failures_table import matrix
from tests.physics.gear import gear

PAGE = Path(__file__).parents[2] / "docs" / "evidence" / "landing-gear-failures.md"
COLUMNS = {"fault", "phase", "indicated", "true_state", "safe", "detected_by", "time_s"}


def test_a_slipping_brake_never_gives_a_false_indication() -> None:
    """All phases of one fault: rows, report and summary; at rest it is found."""
    result = reproduce_failures(fidelity="low", faults=["brake_slipping"])
    values = result.to_dict()
    assert [row["phase"] for row in values["rows"]] == [phase.name for phase in PHASES]
    assert all(set(row) >= COLUMNS for row in values["rows"])
    assert all(row["safe"] for row in values["rows"])
    at_rest = {row["phase"]: row for row in values["rows"]}["at rest, retracted"]
    assert at_rest["indicated"] == "fault"
    assert at_rest["detected_by"] == "fault: uncommanded motion"
    assert 0.0 < at_rest["time_s"] < 0.3
    assert "at rest, retracted" in failures_page(result, "2000-01-01").html()
    assert len(summary(result)[1]) == len(PHASES)
    assert matrix(result).splitlines()[2] in PAGE.read_text(encoding="utf-8")


def test_a_false_indication_is_judged_unsafe() -> None:
    """The judge itself: a healthy stroke with the truth turned round."""
    rec = gear((0.1, "extend"), duration=9.0, record="all@500 Hz")
    phase = PHASES[1]
    assert judge(rec, phase, "none", None, "landing_gear").safe
    channels = {name: rec[name] for name in rec.names}
    open_lock = SimpleNamespace(time=rec["locked"].time, values=0.0 * rec["locked"].values)
    false: Any = {**channels, "locked": open_lock}
    row = judge(false, phase, "none", None, "landing_gear")
    assert not row.safe
    assert (row.indicated, row.true_state) == ("locked", "between, at rest")
    # The status fails on it unless it is listed, and on a listed row that has become safe.
    assert [check.passed for check in failure_checks([row], 1)] == [False, True, True]
    named = judge(false, phase, "none", "who could see it", "landing_gear")
    assert all(check.passed for check in failure_checks([named], 1))
    stale = judge(rec, phase, "none", "who could see it", "landing_gear")
    assert [check.passed for check in failure_checks([stale], 2)] == [True, False, False]


def test_severities_follow_the_record() -> None:
    """A share whole, any other range half, a range with both signs from both sides."""
    wiring = elevon.Actuator.load(ACTUATOR).wiring
    records = {record.kind: record for record in catalogue(wiring)}
    assert records["hall_high"].tried == (1.0,)
    assert records["jam"].tried == (50e3,)
    assert records["offset"].tried == (0.25, -0.25)


@pytest.mark.long
@pytest.mark.parametrize("fidelity", ["low", "high"])
def test_every_fault_in_every_phase(fidelity: str) -> None:
    """No unsafe row but the listed one, and the listed one is there; sensors are named."""
    result = reproduce_failures(fidelity=fidelity)
    values = result.to_dict()
    assert values["status"] == "pass"
    unsafe = [row for row in result.rows if not row.safe]
    assert len(unsafe) == len(LISTED)
    assert all(row.sensors for row in unsafe)
    records = catalogue(elevon.Actuator.load(ACTUATOR).wiring)
    carried = sum(len(r.places) * len(r.tried) for r in records if fidelity in r.fidelities)
    assert len(result.rows) == carried * len(PHASES)
    if fidelity == "low":
        assert matrix(result) in PAGE.read_text(encoding="utf-8")
    assert np.isfinite([row.position_mm for row in result.rows]).all()
