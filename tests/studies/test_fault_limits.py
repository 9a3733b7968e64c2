"""`python -m studies fault-limits`: its rows, its checks."""

import pytest

from elevon import Actuator
from elevon.diagnose.engine.answer import Cause, Diagnosis
from elevon.errors import InputError, Interrupted, UnknownNameError
from studies.fault_limits import limits as fault_limits
from studies.fault_limits.limits import (
    FaultLimits,
    Limit,
    LimitsPlan,
    default_actuators,
    names_it,
    study_fault_limits,
)
from studies.fault_limits.standard import standard_tests
from studies.fault_limits.table import limits_table


def limit(**given):
    entry = {"actuator": "a", "test": "t", "kind": "backlash", "place": "transmission", "unit": "m"}
    return Limit(**{**entry, "limit": 1e-3, **given})


def test_a_fault_counts_where_it_is_named_or_equivalent():
    cause = Cause(
        "friction", "transmission", "1", 0.9, 0.3, (0.2, 0.4), (("backlash", "transmission"),)
    )
    answer = Diagnosis(("log",), "faulty", 0.9, 0.05, 1e-4, (cause,), (), 0.9, (), {}, (), (), 0.1)
    assert names_it(answer, limit())
    assert names_it(answer, limit(kind="friction"))
    assert not names_it(answer, limit(kind="short", place="motor.phase_a"))


def test_checks_count_alarms_and_what_was_named():
    rows = (limit(named=True, alarm=True), limit(named=False, alarm=True), limit())
    good = FaultLimits((rows[0],), {"a": (1, 20)}, "low", 0).to_dict()
    assert (good["status"], [c["value"] for c in good["checks"]][1]) == ("pass", 1.0)
    poor = FaultLimits(rows, {"a": (15, 20)}, "low", 0).to_dict()
    assert [check["passed"] for check in poor["checks"]] == [False, False]
    assert poor["checks"][1]["value"] == 0.5


def test_standard_tests_are_those_that_ask_for_a_motion():
    names = {
        name: [t.name for t in standard_tests(Actuator.load(name))] for name in default_actuators()
    }
    assert ["backlash", "chirp", "loaded-1"] in names.values()
    assert all(names.values())
    assert not any(
        "heating" in name or name.startswith("ff") for listed in names.values() for name in listed
    )


def test_bad_plans_are_refused():
    with pytest.raises(InputError, match="at least one"):
        study_fault_limits(LimitsPlan(days=0))
    with pytest.raises(UnknownNameError):
        study_fault_limits(LimitsPlan(fidelity="middle"))


def test_what_is_finished_is_not_run_again(tmp_path, monkeypatch):
    calls = []

    def once(actuator, test, plan, progress):
        calls.append(test.name)
        if len(calls) == 2:
            raise Interrupted("stopped")
        return [limit(actuator=actuator.name, test=test.name)], 1

    monkeypatch.setattr(fault_limits, "_test_limits", once)
    given = {"actuators": ["torino-rotary"], "folder": tmp_path}
    with pytest.raises(Interrupted):
        study_fault_limits(LimitsPlan(days=3), **given)
    result = study_fault_limits(LimitsPlan(days=3), **given)
    assert calls == ["backlash", "chirp", "chirp", "loaded-1"]
    assert result.healthy == {"torino-rotary": (3, 9)}
    assert [row.test for row in result.limits] == ["backlash", "chirp", "loaded-1"]
    assert result.limits[0] == limit(actuator="torino-rotary", test="backlash")
    study_fault_limits(LimitsPlan(days=4), **given)  # other work
    assert len(calls) == 7


def test_a_stop_is_heard_between_logs(monkeypatch):
    actuator = Actuator.load("torino-rotary")
    test = standard_tests(actuator)[0]
    monkeypatch.setattr(fault_limits, "day_logs", lambda a, t, days, *options: [None] * len(days))
    monkeypatch.setattr(fault_limits, "diagnosed", lambda *given: None)
    with pytest.raises(Interrupted, match="fault-limits was stopped"):
        fault_limits._test_limits(
            actuator, test, LimitsPlan(days=3), lambda fraction: fraction < 0.5
        )


def test_the_table_has_each_fault_in_each_test():
    rows = (
        limit(named=True, alarm=True, injected=2e-3),
        limit(test="u", limit=None, reason="moves nothing"),
        limit(kind="sag", place="supply", unit="1", limit=None, reason="moves nothing"),
        limit(kind="sag", place="supply", unit="1", test="u", limit=0.25),
    )
    text = limits_table(FaultLimits(rows, {"a": (1, 20)}, "low", 3), "elevon x")
    assert "| `backlash@transmission` [m] | 0.001 | - |" in text
    assert "| `sag@supply` | - | 0.25 |" in text
    assert "1 of 20 (0 to 25 %) healthy logs called faulty" in text
    assert "* `backlash@transmission` (u), `sag@supply` (t): moves nothing" in text
    assert "    elevon x --table FILE" in text
