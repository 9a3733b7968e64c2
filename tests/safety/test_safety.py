"""The safety campaign: each hazard can be seen, what is refused, a short form of it."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import elevon
from elevon.cli import main
from elevon.faults.catalogue import catalogue
from elevon.safety import HAZARDS, Row, campaign, observe, population, safety
from elevon.safety.campaign import judged
from elevon.safety.hazards import RECORD
from elevon.safety.reasons import reason
from elevon.safety.rows import ENVIRONMENTS, Failure, triples

NAME, WIRING = "pisa-landing-gear", "landing_gear"
NAMES = RECORD.partition("@")[0].split(",")
TIME = np.arange(0.0, 20.0, 0.01)


def run(row: Row, status: str = "ok", **signals: Any) -> dict[str, float]:
    """Hazards of a made recording: a retracted leg at rest, but for what is given."""
    values = {name: np.zeros_like(TIME) for name in NAMES}
    values |= {name: np.broadcast_to(value, TIME.shape) for name, value in signals.items()}
    channels = {name: SimpleNamespace(time=TIME, values=value) for name, value in values.items()}

    class Made(dict):  # type: ignore[type-arg]
        """A recording by name, with a status."""

    made: Any = Made(channels)
    made.status = status
    return observe(made, row)


IDLE = Row("made", (), 0.75e-3, ())
UP = replace(IDLE, steps=((0.1, "retract"),))
DOWN = replace(IDLE, steps=((0.1, "extend"),))
FALL = replace(IDLE, steps=((1.0, "free_fall"),))


def test_a_leg_at_rest_shows_no_hazard() -> None:
    """Neither does a leg that is where it was sent."""
    assert run(IDLE) == {}
    assert run(UP) == {}
    assert run(DOWN, state=2.0, locked=1.0, nut_position=0.267) == {}


@pytest.mark.parametrize(
    ("name", "row", "signals"),
    [
        ("false locked", IDLE, {"state": 2.0}),
        ("false retracted", IDLE, {"nut_position": 0.01}),
        ("unlocked by itself", DOWN, {"state": 6.0, "locked": (TIME < 5.0) * 1.0}),
        ("motion against the lock", UP,
         {"state": 3.0, "locked": 1.0, "current_mean": np.where(TIME > 2.0, -40.0, 0.0)}),
        ("retraction on wheels", replace(UP, wheels=((0.0, 99.0),)),
         {"state": 3.0, "brake_released": 1.0, "output_position": 0.2 - 0.01 * TIME}),
        ("free fall refused", FALL, {"state": 4.0}),
        ("current against a stop", DOWN, {"state": 1.0, "current_mean": 40.0}),
        ("wrong end with status ok", DOWN, {"state": 4.0, "nut_position": 0.1}),
    ],
)  # fmt: skip
def test_each_hazard_is_seen(name: str, row: Row, signals: dict[str, Any]) -> None:
    """A planted course of signals shows it; that of the healthy leg does not."""
    assert name in run(row, **signals)
    assert name not in run(row, status="tripped") or name == "free fall refused"


def test_hazards_have_their_limits() -> None:
    """50 ms of a false indication, a second against a stop, a fall that opens within 0.5 s."""
    assert "false locked" not in run(IDLE, state=np.where((TIME > 3) & (TIME < 3.045), 2.0, 4.0))
    press = (TIME > 3) & (TIME < 3.9)
    assert "current against a stop" not in run(IDLE, state=4.0, current_mean=40.0 * press)
    assert "free fall refused" not in run(FALL, state=5.0, released=(TIME > 1.3) * 1.0)
    assert "unlocked by itself" not in run(UP, state=3.0, locked=(TIME < 0.5) * 1.0)
    cable = replace(FALL, faults=(Failure("release_cable_failed", "release", 1.0),))
    assert "free fall refused" not in run(cable, state=5.0)


def test_the_population_has_every_failure_and_pair() -> None:
    """Each place of the catalogue in each group; each pair in twelve phases; all surroundings."""
    rows = list(population(WIRING, "low", 0))
    records = catalogue(WIRING)
    places = {f"{r.kind}@{r.place}" for r in _carried(records)}
    for group in ("one failure", "power cycle", "two failures"):
        seen = {failure.name for row in rows if row.group == group for failure in row.faults}
        assert seen == places
    pairs = {row.combination for row in rows if row.group == "two failures"}
    assert len(pairs) > 0.9 * len(places) * (len(places) - 1) / 2
    assert {row.environment for row in rows} == set(range(len(ENVIRONMENTS)))
    for first in range(3):
        for second in range(first + 1, 3):
            levels = {(item[first], item[second]) for item in ENVIRONMENTS}
            assert len(levels) == 9


def _carried(records: Any) -> list[Any]:
    return [
        SimpleNamespace(kind=record.kind, place=place)
        for record in records
        if "low" in record.fidelities
        for place in record.places
    ]


def test_a_single_failure_is_never_listed_for_a_severe_hazard() -> None:
    """There only combinations have reasons, and only the hazards that they explain."""
    switch = Failure("proximity_on", "sensor.proximity_100", 1.0)
    jam = Failure("jam", "screw", 1e4)
    wheels = Failure("proximity_off", "sensor.weight_on_wheels", 1.0)
    for hazard in HAZARDS:
        assert reason(hazard.name, replace(FALL, faults=(switch,))) == ""
        alone = reason(hazard.name, replace(UP, faults=(wheels,), wheels=((0.0, 9.0),)))
        assert bool(alone) == (hazard.name == "retraction on wheels")
    chatter = wheels.when("intermittent", start=0.0, period=0.1, duty=0.5)
    on_ground = replace(UP, faults=(chatter,), wheels=((0.0, 9.0),))
    assert reason("retraction on wheels", on_ground) == ""
    assert reason("false locked", replace(FALL, faults=(switch, jam)))
    assert reason("false locked", replace(DOWN, faults=(switch, jam))) == ""


def test_a_short_campaign(capsys: pytest.CaptureFixture[str], tmp_path: Any) -> None:
    """Counts, hazards and checks as one JSON object, a page beside it."""
    code = main(["safety", NAME, "--every", "2000", "--json", "--out", str(tmp_path)])
    values = json.loads(capsys.readouterr().out)
    assert code == (0 if values["status"] == "pass" else 1)
    assert [item["name"] for item in values["hazards"]] == [item.name for item in HAZARDS]
    assert all({"rows", "listed", "single", "per_hour"} <= set(h) for h in values["hazards"])
    assert values["runs"] == sum(values["groups"].values()) > 20
    assert (tmp_path / "report.html").exists()
    assert json.loads((tmp_path / "result.json").read_text()) == values


def test_a_planted_error_of_the_unit_fails_the_campaign(monkeypatch: pytest.MonkeyPatch) -> None:
    """A current that any motion takes, taken for the stop's: a switch stuck on is a lock."""
    switch = Failure("proximity_on", "sensor.proximity_100", 1.0)
    row = Row("planted", (switch,), 0.230, ((2.0, "free_fall"),))
    monkeypatch.setattr(campaign, "population", lambda *_: iter([row]))
    monkeypatch.setattr(campaign, "triples", lambda *_: iter([]))
    actuator = elevon.Actuator.load(NAME)
    assert safety(actuator).to_dict()["status"] == "pass"
    planted = actuator.with_values({"control.drag_extension": 0.1, "control.confirm_time": 1e-3})
    result = safety(planted)
    failed = {check.name for check in result.checks if not check.passed}
    severe = ("false locked", "free fall refused")
    assert failed == {f"{name}: {what}" for name in severe
                      for what in ("rows not listed", "single failures")}  # fmt: skip
    assert result.to_dict()["status"] == "fail"
    assert {f.fidelity for item in result.hazards for f in item.findings} == {"high"}


def test_other_actuators_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """With the reason, on stderr."""
    assert main(["safety", "torino-rotary"]) == 2
    streams = capsys.readouterr()
    assert streams.out == ""
    assert "no control unit" in streams.err


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_three_failures_leave_no_single_failure_hazard(seed: int) -> None:
    """A hundred random scenarios: a severe hazard is none that one of its failures alone has."""
    actuator = elevon.Actuator.load(NAME)
    severe = {hazard.name for hazard in HAZARDS if hazard.severe}
    rows = list(triples(WIRING, "low", seed, 100))
    seen = [(name, row) for name, row, _ in judged(actuator, rows, "low") if name in severe]
    alone = [replace(row, faults=(one,)) for _, row in seen for one in row.faults]
    assert [name for name, _, _ in judged(actuator, alone, "low") if name in severe] == []


@pytest.mark.long
def test_the_whole_campaign() -> None:
    """Nothing unlisted, no severe hazard by one failure."""
    result = safety(elevon.Actuator.load(NAME), seed=5)
    assert [check.name for check in result.checks if not check.passed] == []
