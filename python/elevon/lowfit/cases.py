"""The scenarios and faults over which the reduced-order model is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from elevon.actuator import Actuator
from elevon.errors import InputError
from elevon.faults import Fault
from elevon.scenario import Scenario

ROTARY_FAULTS = (
    "short@motor.phase_a=0.1",
    "eccentricity_static@motor=0.2",
    "demagnetisation@motor=0.1",
    "friction@transmission=0.25",
)
"""Faults that change the current the load takes, each at the size a diagnosis has to see."""


@dataclass(frozen=True, slots=True)
class FitCase:
    """One comparison: a name for people and what both models run.

    Attributes
    ----------
    name : str
        Scenario and fault in words.
    scenario : Scenario
        Its faults included.
    """

    name: str
    scenario: Scenario


def default_cases(actuator: Actuator) -> list[FitCase]:
    """Return the cases of an actuator when none are given.

    A rotary actuator: one cycle of the loaded campaign's motion (faster, under 0.5 and 1.5 N m of
    brake), healthy under both loads and with each of four faults under the larger one, and a
    steady speed that two low supplies cannot give, under both loads. Any other: its own scenario.

    Raises
    ------
    InputError
        The actuator has no scenario of its own.
    """
    if actuator.wiring == "rotary":
        return _rotary()
    if actuator.default_scenario is None:
        raise InputError(
            f"fit-low: {actuator.name} has no scenario of its own; give some with --scenario"
        )
    default = Scenario.from_dict(actuator.default_scenario, f"{actuator.name}: scenario")
    return [FitCase("its own scenario", default)]


def named_cases(scenarios: Sequence[tuple[str, Scenario]], faults: Sequence[str]) -> list[FitCase]:
    """Return every scenario healthy and with each of the faults alone.

    Parameters
    ----------
    scenarios : sequence of (str, Scenario)
        Name and scenario.
    faults : sequence of str
        In the grammar of the command line.

    Raises
    ------
    InputError
        A fault that cannot be read.
    """
    parsed = [Fault.parse(text) for text in faults]
    cases = []
    for name, scenario in scenarios:
        cases.append(FitCase(f"{name}, as given", scenario))
        cases += [FitCase(f"{name}, {fault}", scenario.with_faults([fault])) for fault in parsed]
    return cases


def _rotary() -> list[FitCase]:
    light, heavy = (_motion(brake) for brake in ("0.5 N m", "1.5 N m"))
    loaded = named_cases([("1.5 N m of brake", heavy)], ROTARY_FAULTS)
    starved = [
        FitCase(f"{volts:g} V, {brake:g} N m of brake", _starved(volts, brake))
        for volts in (45.0, 55.0)
        for brake in (0.5, 1.5)
    ]
    return [FitCase("0.5 N m of brake, as given", light), *loaded, *starved]


def _motion(brake: str) -> Scenario:
    sine = {"kind": "sine", "amplitude": "30 deg", "bias": "30 deg", "frequency": "0.1 Hz"}
    return Scenario.from_dict(
        {
            "duration": "15 s",
            "command": {"mode": "position", "terms": [sine]},
            "load": {"brake": {"terms": [{"kind": "constant", "value": brake}]}},
        }
    )


def _starved(volts: float, brake: float) -> Scenario:
    """A steady speed that the supply cannot give: what is reached tells the voltage ratio."""
    return Scenario.from_dict(
        {
            "duration": "10 s",
            "command": {"mode": "speed", "terms": [{"kind": "constant", "value": "500 rpm"}]},
            "load": {"brake": {"terms": [{"kind": "constant", "value": f"{brake} N m"}]}},
            "supply": {"terms": [{"kind": "constant", "value": f"{volts} V"}]},
        }
    )
