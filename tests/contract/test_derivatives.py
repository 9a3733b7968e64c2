"""Exact derivatives by every parameter and fault agree with differences of runs, or are refused."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

import elevon
from elevon import _core
from elevon.errors import InputError
from elevon.parameters import records
from elevon.simulate.sensitivity import sensitivities
from tests.contract.derivatives import (
    RECORD,
    Motion,
    Place,
    excess,
    fault_places,
    parameter_places,
)

#: What has no effect in these runs must have a derivative of zero, too.
pytestmark = [
    pytest.mark.filterwarnings("ignore::elevon.errors.NotActingWarning"),
    pytest.mark.filterwarnings("ignore::elevon.errors.FindingWarning"),
]

SERVOS = [
    (name, drive)
    for name in ("torino-rotary", "nasa-ballscrew", "nasa-dema")
    for drive in ("hysteresis", "pwm", "off")
]
#: The only reasons to refuse.
REASONS = (
    "it is a switch",
    "it is the duty of a switch",
    "it counts whole things",
    "it is counted in whole solver steps",
    "no derivative at 0",
)


def disagreements(places: Iterable[Place]) -> tuple[list[str], int]:
    """Return the places whose derivative is wrong, and how many have one."""
    wrong, compared = [], 0
    for place in places:
        try:
            missed = excess(place)
        except InputError as error:
            if not any(reason in str(error) for reason in REASONS):
                wrong.append(f"{place.label}: {error}")
            continue
        compared += 1
        if not missed <= 1.0:
            wrong.append(f"{place.label}: {missed:.3g}")
    return wrong, compared


def test_parameters_at_neutral_values() -> None:
    """Every fourth one; the long form takes each."""
    motion = Motion("torino-rotary", "pwm")
    wrong, compared = disagreements(list(parameter_places(motion, neutral=True))[::4])
    assert not wrong
    assert compared > 32


def test_faults_of_severity_zero() -> None:
    """Every third one; the long form takes each."""
    motion = Motion("nasa-ballscrew", "hysteresis")
    wrong, compared = disagreements(list(fault_places(motion, neutral=True))[::3])
    assert not wrong
    assert compared > 10


@pytest.mark.long
@pytest.mark.parametrize("neutral", [True, False], ids=["neutral", "other"])
@pytest.mark.parametrize(("name", "drive"), SERVOS)
def test_every_parameter_and_fault(name: str, drive: str, neutral: bool) -> None:
    motion = Motion(name, drive)
    wrong, compared = disagreements(parameter_places(motion, neutral=neutral))
    faulty, severities = disagreements(fault_places(motion, neutral=neutral))
    assert not wrong + faulty
    assert compared + severities > 150


def test_forces_on_the_output() -> None:
    """Exact where the output bears a force; the first one chooses a flank, and is refused."""
    loaded = Motion("torino-rotary", "pwm", output=5.0)
    places = [p for p in parameter_places(loaded, neutral=True) if p.label.startswith("load.")]
    wrong, compared = disagreements(places)
    assert not wrong
    assert compared >= 6
    free = Motion("torino-rotary", "pwm")
    with pytest.raises(InputError, match=r"load.constant = 0: .* flank of the backlash"):
        sensitivities(free.actuator, free.scenario(), ["load.constant"], record=RECORD)


@pytest.mark.parametrize("drive", ["hysteresis", "pwm"])
def test_supply_voltage_at_its_limit(drive: str) -> None:
    """The speed that the voltage allows: dw/dV = w/V where only the EMF takes it up."""
    limit = (("control.speed_limit", 5000.0),)
    motion = Motion("torino-rotary", drive, limit, speed=260.0, load=0.0)
    supply = [p for p in parameter_places(motion, neutral=True) if "supply_voltage" in p.label]
    (place,) = supply
    assert excess(place) <= 1.0
    speed = place.run(place.value)[1, -1]
    assert place.exact()[1, -1] == pytest.approx(speed / place.value, rel=0.02)


def test_what_neutral_values_hide_is_not_zero() -> None:
    """A run without the part gives zero: turns, eccentricity, sensors, teeth."""
    actuator = Motion("torino-rotary", "hysteresis").actuator
    scenario = Motion("torino-rotary", "hysteresis").scenario()
    paths = [
        "motor.turns_a", "motor.eccentricity_static", "sensor.current.gain_a",
        "sensor.resolver.mismatch", "motor.cogging_torque", "gear.tooth_wear",
        "motor.unbalance_inertia",
    ]  # fmt: skip
    found = sensitivities(actuator, scenario, paths, record=RECORD).derivatives
    for path in paths:
        assert max(np.max(np.abs(rows)) for rows in found[path].values()) > 1e-6, path


@pytest.mark.parametrize("name", ["torino-rotary", "nasa-ballscrew"])
def test_refusals_say_why(name: str) -> None:
    """Choices, whole numbers, switches and counted times: each by its record."""
    motion = Motion(name, "hysteresis")
    for path, record in records(motion.actuator.wiring).items():
        if "low" not in record.fidelities or not (record.choices or record.whole):
            continue
        with pytest.raises(InputError, match=rf"{path}.*(is a choice|it is a whole number)"):
            sensitivities(motion.actuator, motion.scenario(), [path], record=RECORD)


def test_a_state_machine_has_no_derivatives() -> None:
    actuator = elevon.Actuator.load("pisa-landing-gear")
    with pytest.raises(InputError, match="without a state machine"):
        sensitivities(actuator, {"duration": 0.1}, ["motor.inertia"], fidelity="low")


def test_whole_numbers_are_whole() -> None:
    """Refused at the door with the two nearest; the core refuses them as well."""
    actuator = elevon.Actuator.load("torino-rotary")
    with pytest.raises(elevon.errors.RangeError, match=r"pole_pairs = 4.5 is not .*; 4 or 5"):
        actuator.with_values({"motor.pole_pairs": 4.5})
    whole = [path for path, record in records("ballscrew").items() if record.whole]
    assert {"motor.pole_pairs", "bearing.balls", "gear.teeth", "screw.circuits"} <= set(whole)
    ballscrew = elevon.Actuator.load("nasa-ballscrew")
    for path in whole:
        vector = ballscrew.parameters.vector().copy()
        vector[list(records("ballscrew")).index(path)] += 0.5
        with pytest.raises(InputError, match=rf"{path}: .* is not a whole number; "):
            _core.check("ballscrew", "low", vector)
