"""Stands for linear actuators: which is chosen, what the rod gets, what the recorder writes."""

from pathlib import Path

import numpy as np
import pytest

from elevon import Actuator, Recording
from elevon.bench.acquisition import acquire, internal_steps
from elevon.bench.loaded import ForceLoop, target_force
from elevon.bench.procedure import ForceStep, Procedure, load_procedure, procedure_names
from elevon.bench.run import run_procedure, stand_setups
from elevon.bench.stand import stand_names, stand_of, stands
from elevon.documents import Document, validated
from elevon.errors import InputError
from elevon.parameters.load import set_names

LOOP = ForceLoop(limit=50e3, omega=2 * np.pi * 20.0, damping=0.7, friction=150.0, mass=120.0)
TIME = np.arange(0.0, 4.0, 1e-3)


def procedure(*steps):
    data = {"name": "short", "step": list(steps)}
    return validated(Procedure, data, Document("procedure", "", {}))


def test_each_shipped_actuator_has_a_stand_and_procedures_that_can_be_set_up():
    for name in set_names():
        actuator = Actuator.load(name)
        stand = stand_of(actuator.wiring)
        names = procedure_names(stand.name)
        assert names
        for item in names:
            target = load_procedure(item)
            assert len(stand_setups(target, actuator)) == len(target.traces)
    assert {stand_of(Actuator.load(n).wiring).name for n in set_names()} == set(stand_names())


def test_a_procedure_of_another_stand_is_refused_with_those_of_this_one():
    with pytest.raises(InputError, match="ballscrew-profiles"):
        stand_setups(load_procedure("loaded"), Actuator.load("nasa-ballscrew"))
    with pytest.raises(InputError, match="has no 'backlash'"):
        backlash = {"kind": "backlash", "total": "0.01 rad"}
        trace = {"kind": "trace", "name": "one", "duration": "1 s"}
        stand_setups(procedure(backlash, trace), Actuator.load("nasa-ballscrew"))


def test_a_step_of_force_rises_as_a_loop_of_second_order_does():
    target = np.where(TIME >= 1.0, 1000.0, 0.0)
    force = LOOP.achieved(TIME, target, np.zeros_like(TIME))
    t = TIME[TIME >= 1.0] - 1.0
    w, d = LOOP.omega, LOOP.damping
    r = w * np.sqrt(1.0 - d**2)
    closed = 1000.0 * (1.0 - np.exp(-d * w * t) * (np.cos(r * t) + d * w / r * np.sin(r * t)))
    assert np.abs(force[TIME >= 1.0] - closed).max() < 1000.0 * w * 1e-3
    assert force[-1] == pytest.approx(1000.0)


def test_friction_of_the_load_actuator_shows_until_the_loop_rejects_it():
    speed = np.where(TIME >= 1.0, 0.05, 0.0)
    loop = ForceLoop(50e3, LOOP.omega, LOOP.damping, friction=150.0, mass=0.0)
    force = loop.achieved(TIME, np.zeros_like(TIME), speed)
    assert force.max() == pytest.approx(150.0, rel=0.1)
    assert abs(force[-1]) < 1e-3


def test_more_than_the_load_actuator_has_is_refused():
    with pytest.raises(InputError, match="60000 N"):
        LOOP.achieved(TIME, np.full_like(TIME, 6e4), np.zeros_like(TIME))


def test_a_drive_is_loaded_within_what_it_holds():
    """Its largest force is half of the thrust at the current limit, where a procedure has more."""
    drive = Actuator.load(Path(__file__).parents[2] / "examples" / "linear-drive" / "drive.toml")
    thrust = 6.0 * 0.05 * 5.0 * 2.0 * np.pi / 5e-3  # current, torque constant, gearbox, lead
    largest = {"sine-opposing": 4500.0, "trapezoid-spring": 90e3 * 0.05, "sweep-constant": 2000.0}
    logs = stand_setups(load_procedure("ballscrew-profiles"), drive)
    factor = {item.trace.name: item.factor for item in logs}
    assert factor["sine-free"] == 1.0
    for name, force in largest.items():
        assert factor[name] * force == pytest.approx(0.5 * thrust, rel=1e-6)
    assert "holds 1885 N" in logs[-1].message
    assert logs[-1].truth()["force_factor"] == factor["sweep-constant"]
    strong = stand_setups(load_procedure("ballscrew-heating"), Actuator.load("nasa-ballscrew"))
    assert [(item.factor, item.message) for item in strong] == [(1.0, "")] * len(strong)


def test_target_force_is_of_direction_spring_and_position():
    step = ForceStep(
        kind="force", opposing="100 N", stiffness="2 N/mm", positions=(0.0, 0.1), forces=(0.0, 50.0)
    )
    position, speed = np.array([0.05, 0.05]), np.array([0.1, -0.1])
    got = target_force(step, np.array([10.0, 10.0]), position, speed)
    assert got == pytest.approx([10.0 + 100.0 + 100.0 + 25.0, 10.0 - 100.0 + 100.0 + 25.0])


def fast(wave, rate=250e3):
    time = np.arange(0.0, 0.5, 1.0 / rate)
    return Recording.build(
        time,
        {"vibration": wave(time), "state": (time >= 0.2).astype(float)},
        {"vibration": "m/s2", "state": "1"},
        rate=rate,
    )


def test_64_khz_is_resampled_behind_a_filter_and_says_so():
    stand = next(s for s in stands() if s.name == "load-actuator")
    stand = stand.model_copy(update={"channels": {"vibration": type(stand.channels["load"])()}})
    none = (np.array([0.0, 1.0]), np.zeros(2))
    roles = {"vibration": "vibration"}
    assert internal_steps(64e3, 2e-6) == 1
    assert internal_steps(10.0, 2e-6, 600.0) == 100  # three million samples in ten minutes
    keep = {}
    for hertz in (2e3, 60e3):
        run = fast(lambda t, f=hertz: np.sin(2 * np.pi * f * t))
        log = acquire(run, roles, none, stand, rate=64e3, seed=0)
        middle = (log["vibration"].time > 0.1) & (log["vibration"].time < 0.4)
        keep[hertz] = np.sqrt(2.0) * np.std(log["vibration"].values[middle])
    assert np.diff(log["vibration"].time[:3]) == pytest.approx(1 / 64e3)
    assert keep[2e3] == pytest.approx(1.0, abs=0.01)
    assert keep[60e3] < 0.01  # would have folded onto 4 kHz
    origin = log.meta["acquisition"]
    assert origin["resampled"] is True
    assert "25600 Hz" in origin["anti_alias"]
    with pytest.raises(InputError, match="steps"):
        internal_steps(64e3, 1e-4)


def test_states_are_not_filtered():
    stand = next(s for s in stands() if s.name == "hydraulic-rig")
    none = (np.array([0.0, 1.0]), np.zeros(2))
    log = acquire(fast(np.sin), {"state": "state"}, none, stand, rate=500.0, seed=0)
    assert set(np.unique(log["state"].values)) == {0.0, 1.0}
    assert log.roles == {"state": "state", "load": "rig_force"}


def test_a_log_of_the_rig_carries_roles_and_the_stand_but_nothing_hidden(tmp_path):
    force = {"kind": "force", "positions": [0.0, 0.264], "forces": [-1994.2, -756.7]}
    trace = {
        "kind": "trace",
        "name": "one",
        "duration": "2 s",
        "command": {"mode": "gear", "steps": [{"time": "0.1 s", "action": "extend"}]},
    }
    actuator = Actuator.load("pisa-landing-gear")
    fault = "demagnetisation@motor=0.1"
    result = run_procedure(
        procedure(force, trace), actuator, tmp_path, fidelity="low", faults=[fault], seed=3
    )
    assert result.to_dict()["status"] == "ok"
    log = Recording.load(tmp_path / "one.csv")
    assert {"command", "state", "output_position", "load", "supply_current"} <= log.roles.keys()
    assert log.meta["stand"]["parameters"]["supply.current_limit"] == "50 A"
    text = (tmp_path / "one.csv").read_text() + (tmp_path / "one.csv.json").read_text()
    assert "demagnetisation" not in text
    assert log["rig_force"].values[:10].mean() == pytest.approx(-1994.2, abs=20.0)
    again = run_procedure(
        procedure(force, trace), actuator, tmp_path, fidelity="low", faults=[fault], seed=3
    )
    assert [item.resumed for item in again.logs] == [True]
