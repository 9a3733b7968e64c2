"""What a session starts from, in every form a caller has it, and the state it may go back to."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from elevon.actuator import Actuator
from elevon.errors import ArgumentTypeError, InputError
from elevon.faults import find_record
from elevon.parameters.records import record_of
from elevon.scenario import Scenario
from elevon.session.values import texts
from elevon.simulate.arguments import ActuatorLike, ScenarioLike, as_actuator
from elevon.simulate.prepare import Run


@dataclass(frozen=True)
class SessionState:
    """All that a session holds, as `Session.save` left it; `Session.restore` goes back to it.

    It lives in this process only: the core's state has no form on a disk.
    """

    core: Any
    actuators: tuple[Actuator, ...]
    faults: tuple[Mapping[str, int], ...]
    kind: tuple[Any, ...]
    """What two sessions have alike that may exchange states: wiring, fidelity, step, modes."""


def runs_of(
    given: ActuatorLike | Sequence[Run], scenario: ScenarioLike, mode: str | None, seed: int
) -> list[Run]:
    """Return the runs of a session: those given, or the one of an actuator."""
    if isinstance(given, (Actuator, str, os.PathLike)):
        actuator = as_actuator(given)
        if scenario is None:
            command = {} if mode is None else {"mode": mode}
            scenario = {"duration": 1, "command": command}
        elif mode is not None:
            raise InputError(f"mode = {mode!r}: a scenario has its own (command.mode)")
        return [Run(actuator, scenario, seed)]
    if scenario is not None or mode is not None:
        raise InputError("runs have scenarios and modes of their own")
    each: Any = given
    runs: list[Any] = list(each) if isinstance(each, Iterable) else [each]
    kinds = [type(run).__name__ for run in runs if not isinstance(run, Run)]
    if kinds or not runs:
        raise ArgumentTypeError(
            f"{f'a {kinds[0]}' if kinds else 'an empty list'} is no run; expected an actuator, or "
            "a sequence of elevon.Run"
        )
    return runs


def fault_places(scenario: Scenario) -> dict[str, int]:
    """Return ``KIND@PLACE`` of a scenario's faults to their places in its list."""
    return {f"{fault.kind}@{fault.place}": i for i, fault in enumerate(scenario.fault)}


def announced(wiring: str, tunable: Iterable[str], faults: Iterable[str]) -> list[str]:
    """Return the parameters that a session will change: those named, and those that faults move."""
    paths = [record_of(wiring, path).path for path in texts(tunable, "tunable")]
    for name in texts(faults, "faults"):
        kind, _, place = name.partition("@")
        paths += find_record(kind, place, wiring).targets[place]
    return paths
