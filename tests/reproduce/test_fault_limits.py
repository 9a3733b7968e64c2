"""`elevon reproduce fault-limits`: its rows, its checks."""

import pytest

from elevon import Actuator
from elevon.diagnose.bymodel.answer import Cause, Diagnosis
from elevon.diagnose.standard import standard_tests
from elevon.errors import InputError, UnknownNameError
from elevon.reproduce.fault_limits import (
    FaultLimits,
    Limit,
    Plan,
    default_actuators,
    names_it,
    reproduce_fault_limits,
)


def limit(**given):
    own = {"actuator": "a", "test": "t", "kind": "play", "place": "transmission", "unit": "m"}
    return Limit(**{**own, "limit": 1e-3, **given})


def test_a_fault_counts_where_it_is_named_or_equivalent():
    cause = Cause(
        "friction", "transmission", "1", 0.9, 0.3, (0.2, 0.4), (("play", "transmission"),)
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
        "heating" in name or name.startswith("ff") for own in names.values() for name in own
    )


def test_bad_plans_are_refused():
    with pytest.raises(InputError, match="at least one"):
        reproduce_fault_limits(Plan(days=0))
    with pytest.raises(UnknownNameError):
        reproduce_fault_limits(Plan(fidelity="middle"))
