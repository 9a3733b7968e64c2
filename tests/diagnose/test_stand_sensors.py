"""Sensors of the stand: told from faults of the actuator, and which of two where that is all."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from elevon.actuator import Actuator
from elevon.bench.loaded import loaded_setups, run_loaded
from elevon.bench.procedure import Procedure
from elevon.bench.stand import stand_of
from elevon.diagnose.signs import EVERYTHING
from elevon.diagnose.stand_sensors import stand_signs
from elevon.documents import Document, validated
from elevon.errors import InputError
from elevon.logs.log import Log

SINE = {"kind": "sine", "amplitude": "50 mm", "frequency": "0.25 Hz"}


def procedure(sensor):
    steps = [{"kind": "sensor", **sensor}] if sensor else []
    steps += [
        {"kind": "force", "opposing": "3000 N", "terms": [{"kind": "constant", "value": 1500.0}]},
        {"kind": "trace", "name": "run", "duration": "8 s", "command": {"terms": [SINE]}},
    ]
    return validated(Procedure, {"name": "run", "step": steps}, Document("test", "", {}))


def log_of(seed, sensor=None, faults=(), fidelity="low"):
    screw, sensor = Actuator.load("nasa-ballscrew"), sensor or {}
    planted = {} if sensor.get("channel") == "load_cell" and fidelity == "low" else sensor
    (setup,) = loaded_setups(
        procedure(planted), screw, stand_of(screw.wiring), faults=list(faults), seed=seed
    )
    log = Log.of(run_loaded(setup, fidelity)[0], f"run-{seed}")
    return log if fidelity == "high" else with_cell(log, seed, sensor)


def with_cell(log, seed, sensor):
    """Add the load cell, which the reduced-order model has not: force, inertia, friction, noise."""
    rng, speed = np.random.default_rng(seed), log["motor_speed"]
    cell = log["load"] + 0.5 * np.gradient(speed, log.time) + 40.0 * np.tanh(speed)
    cell += 10.0 * rng.standard_normal(len(cell))
    if sensor.get("channel") == "load":
        cell /= sensor["gain"]  # the cell is right
    if sensor.get("channel") == "load_cell":
        cell = sensor.get("gain", 1.0) * cell + float(sensor.get("offset", "0 N").split()[0])
        cell = np.where(log.time > 1.0, cell[0], cell) if sensor.get("fault") else cell
    return log.with_channels(load_cell=cell)


@cache
def healthy():
    return tuple(log_of(seed) for seed in (1, 2))


@pytest.mark.parametrize(
    ("sensor", "key", "size"),
    [
        ({"channel": "load_cell", "gain": 0.95}, "gain@stand.load_cell", -0.05),
        ({"channel": "load", "gain": 1.06}, "gain@stand.load", 0.06),
        ({"channel": "load_cell", "offset": "80 N"}, "offset@stand.load_cell", 80.0),
        ({"channel": "surface_temperature", "offset": "8 K"},
         "offset@stand.surface_temperature", 8.0),
        ({"channel": "nut_temperature", "fault": "dead"}, "dead@stand.nut_temperature", 1.0),
        ({"channel": "load_cell", "fault": "stuck", "at": "1 s"}, "stuck@stand.load_cell", 1.0),
    ],
)  # fmt: skip
def test_a_sensor_of_the_stand_is_named_with_its_size(sensor, key, size):
    (sign,) = stand_signs(log_of(5, sensor), healthy())
    assert sign.key == key
    assert sign.present > 0.9
    assert sign.cause.severity == pytest.approx(size, rel=0.1, abs=0.005)
    if sign.cause.kind == "gain":
        assert sign.cause.ambiguous_with == ()  # the motor's current says which of the two it is


@pytest.mark.parametrize(
    "fault",
    [None, "friction@transmission=0.5", "return_jam@screw.return_channel=1",
     "demagnetisation@motor=0.1", "short@motor.phase_a=0.2", "backlash@transmission=0.3 mm"],
)  # fmt: skip
def test_no_fault_of_the_actuator_is_a_sensor_of_the_stand(fault):
    assert stand_signs(log_of(6, None, [fault] if fault else []), healthy()) == []


def test_without_a_witness_the_answer_says_which_of_two():
    log = log_of(5, {"channel": "load_cell", "gain": 0.95})
    blind = [item.without("torque_current") for item in healthy()]
    (sign,) = stand_signs(log.without("torque_current"), blind)
    assert [place.key for place in sign.cause.ambiguous_with] == ["gain@stand.load"]
    assert sign.key == "gain@stand.load_cell"
    assert sign.moves == EVERYTHING  # a force that may be wrong leaves nothing to judge


def test_without_baselines_nothing_is_said():
    assert stand_signs(log_of(5, {"channel": "load_cell", "gain": 0.5}), ()) == []


def test_a_cell_that_measures_something_else_is_no_witness():
    """The landing gear's cell is its friction rig's: nothing is said of it."""
    rng = np.random.default_rng(3)

    def other(log):
        return log.with_channels(load_cell=5.0 * rng.standard_normal(len(log.time)))

    base = [other(log) for log in healthy()]
    assert stand_signs(other(log_of(5)), base) == []


def test_a_channel_that_the_stand_has_not_is_refused():
    with pytest.raises(InputError, match="load_cell"):
        log_of(1, {"channel": "loadcell"})


@pytest.mark.long
@pytest.mark.parametrize(
    ("sensor", "faults", "keys"),
    [
        (None, [], []),
        (None, ["friction@transmission=0.5"], []),
        ({"channel": "load_cell", "gain": 0.95}, [], ["gain@stand.load_cell"]),
        ({"channel": "load_cell", "gain": 0.95}, ["friction@transmission=0.5"],
         ["gain@stand.load_cell"]),
        ({"channel": "load_cell", "fault": "stuck", "at": "1 s"}, [], ["stuck@stand.load_cell"]),
    ],
)  # fmt: skip
def test_the_stands_own_load_cell(sensor, faults, keys):
    """The switching model has the cell behind the elastic joint."""
    base = [log_of(seed, fidelity="high") for seed in (21, 22)]
    signs = stand_signs(log_of(23, sensor, faults, "high"), base)
    assert [item.key for item in signs] == keys
