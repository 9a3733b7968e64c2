"""What a caller may give as an actuator and as a scenario, brought into one form."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

from elevon.actuator import Actuator
from elevon.errors import ArgumentTypeError, InputError
from elevon.faults import Fault
from elevon.scenario import Scenario

ActuatorLike = Actuator | str | os.PathLike[str]
ScenarioLike = Scenario | Mapping[str, Any] | str | os.PathLike[str] | None


def as_actuator(given: ActuatorLike, place: str = "actuator") -> Actuator:
    """Return an actuator: as given, or loaded by its name or from its file.

    Raises
    ------
    ArgumentTypeError
        Something else was given; the message says what is expected.
    InputError
        No such actuator, or a wrong file.
    """
    if isinstance(given, Actuator):
        return given
    if isinstance(given, (str, os.PathLike)):
        return Actuator.load(given)
    raise ArgumentTypeError(
        f"{place}: {_kind(given)} is no actuator; expected an Actuator, a name "
        "('torino-rotary') or the path of a TOML file"
    )


def changed(
    scenario: Scenario, duration: str | float | None, faults: Sequence[Fault | str]
) -> Scenario:
    """Return a scenario of another duration, if any is given, and with further faults.

    Raises
    ------
    ArgumentTypeError
        The faults are one text, not a list of them.
    InputError
        A duration or a fault that cannot be.
    """
    if isinstance(faults, (str, Fault)):
        raise ArgumentTypeError(f"faults: {faults!r} is one fault; expected a list: [{faults!r}]")
    if duration is not None:
        scenario = scenario.replaced(duration=duration)
    return scenario.with_faults(faults) if faults else scenario


def as_scenario(given: ScenarioLike, actuator: Actuator, place: str = "scenario") -> Scenario:
    """Return a scenario: as given, of a mapping, from a file; None means the actuator's own.

    Raises
    ------
    ArgumentTypeError
        Something else was given; the message says what is expected.
    InputError
        The mapping or the file is wrong, or the actuator has no scenario of its own.
    """
    if isinstance(given, Scenario):
        return given
    if given is None:
        return _default(actuator)
    if isinstance(given, Mapping):
        return Scenario.from_dict(given, place)
    if isinstance(given, (str, os.PathLike)):
        return Scenario.load(given)
    raise ArgumentTypeError(
        f"{place}: {_kind(given)} is no scenario; expected a Scenario, a dict of a scenario file's "
        "form, the path of a TOML file, or None for the actuator's own"
    )


def _default(actuator: Actuator) -> Scenario:
    if actuator.default_scenario is None:
        raise InputError(
            f"{actuator.name} has no scenario of its own; give one (command line: --scenario FILE)"
        )
    return Scenario.from_dict(actuator.default_scenario, f"{actuator.name}: scenario")


def _kind(given: object) -> str:
    name = type(given).__name__
    return f"{'an' if name[0].lower() in 'aeiou' else 'a'} {name}"
