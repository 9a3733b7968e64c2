"""The flyable stand: one load, two rams, what the aircraft adds to both."""

from __future__ import annotations

import numpy as np
import pytest

from elevon.actuator import Actuator
from elevon.bench import flyable
from elevon.bench.flyable import FlightConditions, air_of, fly, shares
from elevon.errors import InputError
from elevon.scenario import Scenario


def flight(load=3000.0, seconds=4.0):
    sine = {"kind": "sine", "amplitude": 0.02, "frequency": 0.5}
    data = {"duration": seconds, "command": {"terms": [sine]}}
    if load:
        data["load"] = {"output": {"terms": [{"kind": "constant", "value": load}]}}
    return Scenario.from_dict(data)


def screw():
    return Actuator.load("nasa-ballscrew")


def test_one_of_both_bears_the_load_and_the_other_none():
    time = np.arange(0.0, 30.0, 1e-3)
    first, second = shares(time, 5.0)
    assert np.allclose(first + second, 1.0)
    assert np.mean((first > 0.99) | (second > 0.99)) > 0.95
    assert first[1000] == 1.0
    assert second[6000] == 1.0


def test_load_factor_vibration_and_air_reach_both():
    conditions = FlightConditions(2.0, 3.0, air_of(np.array([0.0, 4.0]), np.array([0.0, 3000.0])))
    ground = fly(screw(), flight(), [], switch=2.0, fidelity="low")
    flown = fly(screw(), flight(), [], conditions, switch=2.0, fidelity="low")
    mass = screw().parameters.value("load.mass")
    for quiet, item in zip(ground, flown, strict=True):
        more = item.log.role("load").values - quiet.log.role("load").values
        assert np.mean(more) == pytest.approx(2.0 * 9.80665 * mass, abs=2.0)
        assert np.std(more) > 2.0 * mass
    time = np.arange(0.0, 4.0, 1.0)
    (air,) = flyable._scenario(flight(), time, np.zeros(4), conditions).ambient.terms
    assert air.values == pytest.approx([288.15, 268.65])


def test_a_faulty_actuator_needs_more_current_under_the_same_load():
    nominal, faulty = fly(screw(), flight(), ["friction@transmission=3"], switch=1.0,
                          fidelity="low")  # fmt: skip
    currents = [np.sqrt(np.mean(item.log.role("torque_current").values ** 2))
                for item in (nominal, faulty)]  # fmt: skip
    assert currents[1] > currents[0]
    assert nominal.loaded == pytest.approx(0.6, abs=0.01)  # it takes over at once


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((screw(), flight(load=0.0), []), "no load on the output"),
        ((Actuator.load("torino-rotary"), flight(), []), "no load actuator"),
    ],
)
def test_what_cannot_fly_is_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        fly(*arguments)


def test_a_switching_time_that_is_none_is_refused():
    with pytest.raises(InputError, match="must be above"):
        fly(screw(), flight(), [], switch=0.1)
