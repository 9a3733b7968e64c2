"""The gallery shows every fault that there is, and what it shows is a difference."""

import numpy as np
import pytest

from elevon.actuator import Actuator
from elevon.faults import catalogue
from elevon_cases.signatures import (
    ACTUATORS,
    SignaturesResult,
    _change,
    _severity,
    reproduce_signatures,
    signatures_page,
)


@pytest.mark.parametrize("name", ACTUATORS)
def test_every_kind_has_a_severity_within_its_range(name):
    for record in catalogue(Actuator.load(name).wiring):
        severity = _severity(record)
        assert record.minimum <= severity <= record.maximum, record.kind
        assert severity != 0.0


def test_a_change_is_relative_to_the_spread():
    time = np.linspace(0.0, 1.0, 1001)
    healthy = np.sin(2 * np.pi * time)
    assert _change(healthy, healthy) == 0.0
    assert _change(healthy, healthy + 0.5) == pytest.approx(0.5 / np.std(healthy))
    assert _change(healthy, healthy[:400]) == 0.0


@pytest.mark.long
def test_gallery():
    result = reproduce_signatures()
    assert result.to_dict()["status"] == "pass"
    for name in ACTUATORS:
        kinds = {item.kind for item in result.signatures if item.actuator == name}
        records = catalogue(Actuator.load(name).wiring)
        assert kinds == {record.kind for record in records if "high" in record.fidelities}
    again = reproduce_signatures(("torino-rotary",))
    first = {i.kind: i.changes for i in result.signatures if i.actuator == "torino-rotary"}
    assert {i.kind: i.changes for i in again.signatures} == first
    few = SignaturesResult(result.signatures[:3])
    assert signatures_page(few).html().count("<svg") == 4  # a map, and one picture a fault
