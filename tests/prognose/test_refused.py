"""What cannot be is refused or stated: units, ranges, uses, loads, edges, laws."""

import json
from dataclasses import replace

import numpy as np
import pytest

from elevon import Actuator
from elevon.diagnose.engine.candidates import candidates_of
from elevon.errors import FormatError, InputError
from elevon.prognose import LAWS, Inspection, Mission, Seen, inspection, predict, respond
from elevon.prognose.answer import Prognosis
from elevon.prognose.fleet import Costs, plan_fleet
from elevon.prognose.future import Future
from elevon.prognose.history import read_history
from elevon.prognose.law import laws_of
from elevon.prognose.next_inspection import next_inspection
from elevon.prognose.tabulate import severity_grid
from tests.prognose.test_predict import FLIGHT, KEY

WEAR = LAWS["gear_wear"]


def cause(**changes):
    return {"faults": [{"kind": "backlash", "place": "transmission", "probability": 0.9,
                        "severity": 0.5, "interval": [0.4, 0.6], **changes}]}  # fmt: skip


def test_a_severity_is_read_in_its_own_unit():
    seen = inspection(cause(unit="deg"), [WEAR], usage=1.0).seen[KEY]
    assert seen.severity == pytest.approx(np.radians(0.5))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"severity": 4.0, "interval": [3.9, 4.1]}, "4 rad is outside 0 to 1"),
        ({"severity": -0.004, "interval": [-0.005, 0.0]}, "outside 0 to 1"),
        ({"unit": "mm"}, "unit"),
        ({"unit": 7}, "is not a text"),
    ],
)
def test_a_severity_that_cannot_be_is_refused(changes, text):
    with pytest.raises(InputError, match=text):
        inspection(cause(**changes), [WEAR], usage=1.0)


def test_edges_are_those_of_the_fault_in_its_own_unit():
    """The rotary's backlash ends at 0.03 rad; a ballscrew's 0.3 mm are far from any edge."""
    law = LAWS["screw_wear"]
    data = cause(severity=3e-4, interval=[2.9e-4, 3.1e-4])
    seen = inspection(data, [law], usage=1.0).seen[law.key]
    assert seen.high == pytest.approx(1e-5 / 1.6449, rel=1e-3)
    screw = candidates_of(Actuator.load("nasa-ballscrew"))
    (edge,) = {c.high for c in screw if c.key == law.key}
    data = cause(severity=0.98 * edge, interval=[0.97 * edge, 0.99 * edge])
    near = [inspection(data, [law], usage=1.0, candidates=c).seen[law.key] for c in (screw, ())]
    assert near[0].high > 2.0 * edge  # it may be more than diagnosis looks at
    assert near[1].high < 0.01 * edge


def test_use_beyond_any_life_is_refused(tmp_path):
    (tmp_path / "a.json").write_text(json.dumps({"usage": 1e14, "unit": "flights", "faults": []}))
    with pytest.raises(FormatError, match="0 to 1e\\+09"):
        read_history(tmp_path, unit="flights")


def test_loads_reach_the_tables_or_are_stated():
    """A median of three is in the tables; futures beyond their ends are a finding."""
    mission = Mission.from_dict({**FLIGHT, "usage": {"load": 3.0}})
    assert severity_grid([WEAR], mission, 3).axes[-1].tolist() == [0.5, 1.0, 6.0]
    spread = Mission.from_dict({**FLIGHT, "usage": {"load_spread": 0.8}})
    unit = Actuator.load("torino-rotary")
    result = predict([], unit, spread)
    assert any("where the tables end" in text for text in result.findings)


def test_three_diagnoses_at_one_use_are_stated():
    unit, mission = Actuator.load("torino-rotary"), Mission.from_dict(FLIGHT)
    seen = [Inspection(500.0, {KEY: Seen(2e-3, 2e-4, 2e-4)}, name=n) for n in "abc"]
    result = predict(seen, unit, mission)
    assert any(text.startswith("3 inspections at use 500 (a, b, c)") for text in result.findings)
    assert result.future.course[0, 0, 1] == pytest.approx(2e-3, rel=0.15)  # where it was seen


def test_only_is_for_a_single_law():
    two = [{"law": "gear_wear", "only": True}, {"law": "lubricant_loss"}]
    with pytest.raises(InputError, match="only = true"):
        Mission.from_dict({**FLIGHT, "growth": two})
    one = Mission.from_dict({**FLIGHT, "growth": [{"law": "gear_wear", "only": True}]})
    assert one.laws()[0].only


def test_a_law_that_does_not_fit_is_refused_with_those_that_do():
    unit, mission = Actuator.load("nasa-ballscrew"), Mission.from_dict(FLIGHT)
    with pytest.raises(
        InputError, match=r"in m, not rad; laws that fit it: screw_wear, .*nut_spall"
    ):
        respond(unit, mission)
    assert {"nut_spall", "screw_lubricant", "return_jam", "preload_loss"} <= set(
        laws_of("ballscrew")
    )
    assert {"leg_screw_friction", "lock_spring", "brake_wear"} <= set(laws_of("landing_gear"))


def lives(*remaining):
    """A prognosis of these ends, from flight 100 on."""
    end = 100.0 + np.array(remaining, dtype=np.float64)
    future = Future(100.0, end, np.zeros(len(end), dtype=np.intp), np.array([100.0]),
                    np.zeros((1, 1, 3)))  # fmt: skip
    return Prognosis("flights", 100.0, 0.9, future, ("backlash",), (), (), ())


def test_no_visit_is_planned_where_no_end_is_in_sight_nor_after_the_end():
    """One sure to end at 1,000; one whose end nobody sees; one that has failed already."""
    units = {"a": lives(*[1000.0] * 20), "b": lives(*[np.inf] * 20),
             "c": lives(*[0.0] * 20)}  # fmt: skip
    plan = plan_fleet(units, Costs(1.0, 2000.0, 1.0))
    rows = {row["unit"]: row for row in plan.table}
    assert rows["b"]["visit"] is None
    assert any(text.startswith("b: no visit is planned") for text in plan.findings)
    assert rows["a"]["visit"] <= 1000.0
    assert rows["c"]["visit"] == 0.0


def test_no_end_in_sight_is_said_in_words():
    assert "inf" not in lives(*[np.inf] * 20).headline


def test_the_next_inspection_comes_before_the_risk_is_reached():
    result = replace(lives(*np.arange(1000.0, 2000.0, 1.0)))
    look = next_inspection(result, 0.05, test="friction")
    assert look.within == pytest.approx(1050.0)
    assert "within 1050 flights with the test friction" in look.headline
    with pytest.raises(InputError, match="futures"):
        next_inspection(result, 1e-6, test=None)
