"""Every wiring says which of its signals has which role: whoever reads logs requests roles."""

import pytest

from elevon import _core
from elevon.features.records import ROLES as FEATURE_ROLES
from elevon.features.records import players
from elevon.units import parse_unit

WIRINGS = [(w["name"], fidelity) for w in _core.wirings() for fidelity in w["fidelities"]]
ROLES = {role["name"]: role for role in _core.roles()}
#: What any servo drive logs.
LOGGED = {"command", "output_position", "motor_position", "motor_speed", "speed_ref"}
LOGGED |= {"torque_current", "torque_voltage", "supply_voltage", "temperature"}


def test_roles_are_named_once_in_units_of_the_si():
    assert len(ROLES) == len(_core.roles())
    for role in ROLES.values():
        assert role["text"]
        assert all(parse_unit(unit).factor == 1.0 for unit in role["units"])


@pytest.mark.parametrize(("wiring", "fidelity"), WIRINGS)
def test_every_wiring_has_the_roles_of_a_drives_log(wiring, fidelity):
    signals = _core.signals(wiring, fidelity)
    played = {signal["role"] for signal in signals if signal["role"]}
    assert played <= ROLES.keys()
    assert played >= LOGGED
    for signal in signals:
        if signal["role"]:
            assert signal["unit"] in ROLES[signal["role"]]["units"], signal["name"]


def test_features_are_made_of_the_same_roles():
    assert set(FEATURE_ROLES) <= ROLES.keys()
    for role in FEATURE_ROLES:
        assert players(role), role
    assert players("output_position") == ("encoder_position", "output_position")
