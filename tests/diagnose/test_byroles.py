"""Diagnosis of any actuator by the roles of its logs."""

import numpy as np
import pytest

from elevon import Actuator, Scenario, simulate
from elevon.cli import main
from elevon.diagnose.byroles import diagnose_by_roles
from elevon.diagnose.byroles.candidates import candidates_of, declined_of
from elevon.diagnose.byroles.log import role_log, same_test
from elevon.diagnose.byroles.runs import drawn
from elevon.errors import InputError, UnknownNameError

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
SINE = {"kind": "sine", "amplitude": "20 mm", "frequency": "0.4 Hz"}


@pytest.fixture(scope="module")
def screw():
    return Actuator.load("nasa-ballscrew")


def log(actuator, *faults, day=None):
    unit = actuator if day is None else drawn(actuator, np.random.default_rng(day))
    scenario = Scenario.from_dict(
        {"duration": "5 s", "command": {"mode": "position", "terms": [SINE]}, "fault": list(faults)}
    )
    names = "command,encoder_position,resolver_position,resolver_speed,current_q_meas"
    return simulate(unit, scenario, fidelity="low", record=f"{names}@200 Hz")


def test_play_of_a_screw_is_named_and_a_healthy_day_is_healthy(screw):
    few = ["play@transmission", "gain_drift@control.position"]
    base = [("base", log(screw, day=1))]
    healthy = diagnose_by_roles([("h", log(screw, day=2))], screw, baselines=base, faults=few)
    assert healthy.status == "healthy"
    fault = {"kind": "play", "place": "transmission", "severity": "0.4 mm"}
    worn = diagnose_by_roles([("w", log(screw, fault, day=3))], screw, baselines=base, faults=few)
    assert worn.status == "faulty"
    assert worn.best == ("play@transmission",)
    assert worn.faults[0].interval[0] < 4e-4 < worn.faults[0].interval[1]
    assert worn.unobservable == ()  # both are seen, others were not asked for


def test_what_cannot_be_diagnosed_is_refused(screw):
    good = log(screw)
    with pytest.raises(InputError, match="role 'command'"):
        role_log(good.select(["encoder_position"]), "x")
    with pytest.raises(UnknownNameError):
        diagnose_by_roles([("x", good)], screw, faults=["play@moon"])
    with pytest.raises(InputError, match="commanded by actions"):
        diagnose_by_roles([("x", good)], Actuator.load("pisa-landing-gear"))
    with pytest.raises(InputError, match="at least one"):
        diagnose_by_roles([], screw)


def test_every_fault_is_a_candidate_or_declined_with_a_reason(screw):
    from elevon.faults import catalogue

    said = {(c.kind, p) for c in candidates_of(screw) for p in (c.place, *c.same)}
    said |= {(item["kind"], item["place"]) for item in declined_of(screw)}
    assert said == {(r.kind, p) for r in catalogue(screw.wiring) for p in r.places}
    assert all(item["reason"] for item in declined_of(screw))
    assert same_test(role_log(log(screw), "a"), role_log(log(screw, day=4), "b"))


def test_the_command_line(screw, tmp_path, capsys):
    path = tmp_path / "log.csv"
    log(screw, day=5).save(path)
    code = main(["diagnose", str(path), "--actuator", "nasa-ballscrew", "--fault",
                 "play@transmission", "--json"])  # fmt: skip
    assert code == 0
    assert '"status": "healthy"' in capsys.readouterr().out
    asked = ["--actuator", "nasa-ballscrew", "--method", "surrogate"]
    assert main(["diagnose", str(path), *asked]) == 2
