"""Maintenance of a fleet against costs that can be worked out by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest
import tomlkit

from elevon.errors import InputError, RangeError
from elevon.prognose.answer import Prognosis
from elevon.prognose.fleet import Costs, fleet_figure, plan_fleet
from elevon.prognose.future import Future
from tests.cli.conftest import elevon_cli  # noqa: F401 - a fixture
from tests.prognose.test_predict import FLIGHT, folder


def unit(*ends, kind="flights"):
    end = np.array(ends, dtype=float)
    first = np.zeros(len(end), dtype=np.intp)
    future = Future(0.0, end, first, np.zeros(1), np.zeros((1, 1, 3)))
    return Prognosis(kind, 0.0, 0.9, future, ("r",), (), (), ())


def test_one_unit_is_done_just_before_the_earliest_end_when_failures_are_dear():
    ends = np.linspace(1000.0, 2000.0, 101)
    plan = plan_fleet({"a": unit(*ends)}, Costs(early=1.0, late=1e6, visit=0.0))
    assert plan.alone["a"] == pytest.approx(1000.0, abs=6.0)
    assert plan.alone["a"] <= 1000.0
    assert plan.cost == pytest.approx(500.0, abs=6.0)


def test_when_failures_cost_little_parts_are_used_up():
    ends = np.linspace(1000.0, 2000.0, 101)
    plan = plan_fleet({"a": unit(*ends)}, Costs(early=1.0, late=1.0, visit=0.0))
    assert plan.alone["a"] == pytest.approx(1950.0, rel=0.01)  # the last instant looked at


def test_neighbours_share_a_visit_where_it_saves_more_than_their_lives():
    fleet = {"a": unit(1000.0), "b": unit(1100.0), "c": unit(3000.0)}
    apart = plan_fleet(fleet, Costs(1.0, 1e6, visit=50.0))
    assert [v.units for v in apart.visits] == [("a",), ("b",), ("c",)]
    two = plan_fleet(fleet, Costs(1.0, 1e6, visit=500.0))
    assert [v.units for v in two.visits] == [("a", "b"), ("c",)]
    assert two.visits[0].use == pytest.approx(1000.0, abs=8.0)
    assert two.cost == pytest.approx(1000.0 + 100.0, abs=25.0)
    assert two.cost_alone == pytest.approx(1500.0, abs=25.0)
    together = plan_fleet(fleet, Costs(1.0, 1e6, visit=1e5))
    assert len(together.visits) == 1
    assert fleet_figure(two).axes


def test_a_unit_that_ends_soon_beside_one_that_lasts_is_done_when_it_would_be_alone():
    ends = np.linspace(1000.0, 2000.0, 101)
    costs = Costs(early=1.0, late=1e6, visit=0.0)
    alone = plan_fleet({"a": unit(*ends)}, costs)
    together = plan_fleet({"a": unit(*ends), "b": unit(1e7)}, costs)
    assert together.alone["a"] == pytest.approx(alone.alone["a"])
    assert together.visit_of("b") == pytest.approx(1e7, rel=0.01)


def test_what_a_prediction_must_be_read_with_is_said_of_the_fleet():
    thin = replace(unit(1000.0), findings=("two are needed",))
    plan = plan_fleet({"a": unit(900.0), "b": thin}, Costs(1.0, 1e6, visit=50.0))
    assert plan.to_dict()["findings"] == ["b: two are needed"]


def test_fleets_that_are_none():
    with pytest.raises(InputError, match="at least one"):
        plan_fleet({}, Costs(1.0, 1.0, 1.0))
    with pytest.raises(InputError, match="several units"):
        plan_fleet({"a": unit(1.0), "b": unit(1.0, kind="hours")}, Costs(1.0, 1.0, 1.0))
    with pytest.raises(RangeError, match="late"):
        Costs(1.0, -1.0, 1.0)


def test_the_command_line(elevon_cli, tmp_path):  # noqa: F811
    places = [folder(tmp_path / name, serial=[name] * 4) for name in ("A", "B")]
    flight = tmp_path / "flight.toml"
    flight.write_text(tomlkit.dumps(FLIGHT))
    options = ("--actuator", "torino-rotary", "--mission", flight, "--json")
    got = elevon_cli("fleet", *places, *options, "--report", tmp_path / "page.html")
    assert got.code == 0, got.err
    answer = json.loads(got.out)
    assert [row["unit"] for row in answer["rows"]] == ["A", "B"]
    assert len(answer["visits"]) == 1
    assert elevon_cli("fleet", places[0], places[0], *options).code == 2
