"""The safety campaign: each hazard can be seen, what is refused, a short form of it."""

from __future__ import annotations

import csv
import json
import tomllib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import elevon
from elevon.cli import main
from elevon.faults.catalogue import catalogue
from elevon.recording import Recording
from elevon.safety import Hazard, Watched, campaign, lasting, safety
from elevon.safety.gear import ENVIRONMENTS, GearRow, population
from elevon.safety.gear_hazards import HAZARDS, RECORD, distances, limits
from elevon.safety.hazards import observe
from elevon.safety.reasons import reason
from elevon.safety.rows import Failure, failures
from elevon.safety.study import Study, study_of

NAME = "pisa-landing-gear"
NAMES = RECORD.partition("@")[0].split(",")
TIME = np.arange(0.0, 20.0, 0.01)


def run(row: GearRow, status: str = "ok", **signals: Any) -> dict[str, float]:
    """Hazards of a made recording: a retracted leg at rest, but for what is given."""
    values = {name: np.zeros_like(TIME) for name in NAMES}
    values |= {name: np.broadcast_to(value, TIME.shape) for name, value in signals.items()}
    return observe(Watched(TIME, values, row, status, {}), HAZARDS)


IDLE = GearRow("made", (), 0.75e-3, ())
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
def test_each_hazard_is_seen(name: str, row: GearRow, signals: dict[str, Any]) -> None:
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
    """Each place of the catalogue in each group; each pair in its phases; all surroundings."""
    every = failures(elevon.Actuator.load(NAME), "low", {})
    rows = list(population(every, 0))
    places = {failure.name for failure in every}
    known = {f"{r.kind}@{p}" for r in catalogue("landing_gear") if "low" in r.fidelities
             for p in r.places}  # fmt: skip
    assert {name.partition("=")[0] for name in places} == known
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


def test_pairs_come_in_both_orders() -> None:
    """Late, each of the two is the last one of some row; from the start, both are."""
    first = Failure("jam", "screw", 1e4)
    second = Failure("proximity_on", "sensor.proximity_100", 1.0)
    rows = [row for row in population([first, second], 0) if row.group == "two failures"]
    assert {row.last for row in rows if row.late} == {(first.name,), (second.name,)}
    assert {row.last for row in rows if not row.late} == {tuple(sorted((first.name, second.name)))}
    assert {row.phase for row in rows if row.late and row.last == (first.name,)} == {
        "extension", "retraction", "free fall"}  # fmt: skip


def test_a_single_failure_is_never_listed_for_a_catastrophe() -> None:
    """There only combinations have reasons, and only the hazards that they explain."""
    known = {hazard.name: hazard for hazard in HAZARDS}
    switch = Failure("proximity_on", "sensor.proximity_100", 1.0)
    jam = Failure("jam", "screw", 1e4)
    wheels = Failure("proximity_off", "sensor.weight_on_wheels", 1.0)
    for hazard in HAZARDS:
        assert reason(hazard, replace(FALL, faults=(switch,))) == ""
        alone = reason(hazard, replace(UP, faults=(wheels,), wheels=((0.0, 9.0),)))
        assert bool(alone) == (hazard.name == "retraction on wheels")
    chatter = wheels.when("intermittent", start=0.0, period=0.1, duty=0.5)
    on_ground = replace(UP, faults=(chatter,), wheels=((0.0, 9.0),))
    assert reason(known["retraction on wheels"], on_ground) == ""
    assert reason(known["false locked"], replace(FALL, faults=(switch, jam)))
    assert reason(known["false locked"], replace(DOWN, faults=(switch, jam))) == ""


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The folder of a short campaign."""
    folder = tmp_path_factory.mktemp("safety")
    main(["safety", NAME, "--every", "8000", "--high", "0", "--out", str(folder)])
    return folder


def test_a_short_campaign(short: Any) -> None:
    """Counts, hazards, failures, fidelity and rules in result.json, tables and rows beside it."""
    values = json.loads((short / "result.json").read_text())
    assert values["status"] == ("pass" if all(c["passed"] for c in values["checks"]) else "fail")
    assert [item["name"] for item in values["hazards"]] == [item.name for item in HAZARDS]
    assert all({"class", "mean", "worst", "interval", "target", "met", "cut_sets"} <= set(h)
               for h in values["hazards"])  # fmt: skip
    assert all({"rate", "rate_low", "rate_high", "alpha", "evident", "interval_h"} <= set(f)
               for f in values["failures"])  # fmt: skip
    assert {"near_limit", "rerun_high", "not_rerun", "changed_outcome"} <= set(values["fidelity"])
    assert values["runs"] == sum(values["groups"].values()) > 10
    table = list(csv.DictReader((short / "fmea.csv").read_text().splitlines()))
    assert set(table[0]) == {
        "failure", "place", "rate", "phase", "local_effect", "end_effect", "detection", "latency_s",
        "message", "compensation", "class", "scenario"}  # fmt: skip
    assert all((short / row["scenario"]).exists() for row in table)
    page = (short / "report.html").read_text()
    assert all(text in page for text in ("Rules", "25.1309(b)", "FMEA", "switching model"))


def test_rows_replay_to_the_bit(short: Any, tmp_path: Any) -> None:
    """A row's file, run by `simulate` at both fidelities, gives the samples of the batch."""
    study = study_of(elevon.Actuator.load(NAME), None, None, ())
    path = min((short / "rows").glob("*.toml"))
    scenario = elevon.Scenario.load(path)
    row = next(row for row in study.rows(0) if row.scenario().to_dict() == _read(path))
    for fidelity in ("low", "high"):
        out = tmp_path / f"{fidelity}.parquet"
        assert main(["simulate", NAME, "--scenario", str(path), "--fidelity", fidelity, "--record",
                     RECORD, "--out", str(out)]) == 0  # fmt: skip
        batch = elevon.simulate_batch(
            [elevon.Run(NAME, row.scenario()), elevon.Run(NAME, scenario)],
            fidelity=fidelity, record=RECORD,
        )  # fmt: skip
        replayed = Recording.load(out)
        for name in NAMES:
            for other in batch:
                assert np.array_equal(replayed[name].values, other[name].values)


def _read(path: Any) -> dict[str, Any]:
    """A row's file as Python reads it, numbers as numbers."""
    return elevon.Scenario.from_dict(tomllib.loads(path.read_text())).to_dict()


def test_a_planted_error_of_the_unit_fails_the_campaign(monkeypatch: pytest.MonkeyPatch) -> None:
    """A current that any motion takes, taken for the stop's: a switch stuck on is a lock."""
    switch = Failure("proximity_on", "sensor.proximity_100", 1.0)
    row = GearRow("one failure", (switch,), 0.230, ((2.0, "free_fall"),))
    monkeypatch.setattr(Study, "rows", lambda *_: iter([row]))
    monkeypatch.setattr(Study, "switching_rows", lambda *_: iter([]))
    monkeypatch.setattr(campaign, "TRIPLES", 0)
    actuator = elevon.Actuator.load(NAME)
    assert safety(actuator).to_dict()["status"] == "pass"
    planted = actuator.with_values({"control.drag_extension": 0.1, "control.confirm_time": 1e-3})
    result = safety(planted)
    failed = {check.name for check in result.checks if not check.passed}
    for name in ("false locked", "free fall refused"):
        assert {f"{name}: rows not listed", f"25.1309(b)(1)(ii) {name}: single failures"} <= failed
    assert result.to_dict()["status"] == "fail"
    assert {f.fidelity for item in result.hazards for f in item.findings} == {"high"}


def test_a_hazard_of_a_user_is_ten_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """A function and a line; it is judged in every row, with class and target."""

    def far(run: Watched) -> float | None:
        return lasting(run, abs(run["output_position"]) > 0.05, 0.1)

    monkeypatch.setattr(campaign, "TRIPLES", 0)
    every = [Failure("jam", "screw", 1e4)]
    rows = [GearRow("one failure", (failure,), 0.75e-3, ((0.1, "extend"),)) for failure in every]
    monkeypatch.setattr(Study, "rows", lambda *_: iter(rows))
    monkeypatch.setattr(Study, "switching_rows", lambda *_: iter([]))
    mine = Hazard("too far", "the ram is far out", far, "minor")
    result = safety(NAME, hazards=[mine], high=0)
    assert [item.name for item in result.hazards] == ["too far"]
    assert result.hazards[0].target == 1e-3
    assert result.hazards[0].healthy > 0


def test_other_actuators_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """With the wirings that have a campaign, on stderr; bad options with what is allowed."""
    for arguments, word in (
        (["torino-rotary", "--target", "severe=1e-3"], "major"),
        (["torino-rotary", "--target", "major=2"], "at most at 1"),
        (["torino-rotary", "--flight-time", "-1 h"], "longer than zero"),
    ):
        assert main(["safety", *arguments]) == 2
        streams = capsys.readouterr()
        assert streams.out == ""
        assert word in streams.err


@pytest.mark.long
def test_the_whole_campaign() -> None:
    """No catastrophe by one failure, none without a failure, nothing unlisted."""
    result = safety(elevon.Actuator.load(NAME), seed=5)
    failed = [check.name for check in result.checks if not check.passed]
    assert [name for name in failed if "mean of a flight hour" not in name] == []


def test_distances_from_limits() -> None:
    """A current that nearly warns, a fall nearly too long, a supply that nearly fails."""
    bounds = limits(elevon.Actuator.load(NAME))

    def nearest(**signals: Any) -> tuple[float, str]:
        values = {name: np.zeros_like(TIME) for name in NAMES} | {"supply_voltage": 28.0 + 0 * TIME}
        values |= {name: np.broadcast_to(value, TIME.shape) for name, value in signals.items()}
        return min((x, name) for name, x in distances(Watched(TIME, values, IDLE, "ok", bounds)))

    assert nearest()[0] > 0.5
    pushing = np.where((TIME > 2.0) & (TIME < 2.6), 0.95 * bounds["drag_extension"], 0.0)
    assert nearest(current_mean=pushing) == (pytest.approx(0.05), "current")
    assert nearest(current_mean=np.where(TIME < 0.2, pushing.max(), 0.0))[0] > 0.5
    assert nearest(supply_voltage=28.0 - 15.0 * (TIME > 3.0)) == (pytest.approx(1 / 12), "voltage")
    assert nearest(state=np.where(TIME < 9.9, 5.0, 4.0)) == (pytest.approx(0.01, abs=0.005), "time")
    slow = 1.02 * bounds["stall_speed"]
    assert nearest(state=1.0, brake_released=1.0, motor_speed=slow) == (
        pytest.approx(0.02), "force")  # fmt: skip
