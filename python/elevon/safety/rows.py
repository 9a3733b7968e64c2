"""The rows of a campaign: failures, when they come, and the scenario that they come in."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

from elevon.actuator import Actuator
from elevon.scenario import Scenario

LARGEST = 1.0
"""Severity tried where the catalogue states no limit and no file of rates another one."""


@dataclass(frozen=True)
class Failure:
    """One failure: a fault of the catalogue at its place, and when it is there.

    Attributes
    ----------
    kind, place : str
        As in the catalogue.
    severity : float
        In the kind's unit.
    profile : tuple
        Kind of the profile and its parameters, as pairs.
    attributes : tuple
        Names of the kind's attributes without a default, and their values.
    several : bool
        Whether the campaign tries other severities of the kind at the place: each is a failure.
    """

    kind: str
    place: str
    severity: float
    profile: tuple[tuple[str, Any], ...] = (("kind", "constant"),)
    attributes: tuple[tuple[str, float], ...] = ()
    several: bool = False

    @property
    def name(self) -> str:
        """Kind and place, with the severity where several are tried."""
        return f"{self.kind}@{self.place}" + (f"={self.severity:g}" if self.several else "")

    @property
    def onset(self) -> float:
        """When it comes, in s."""
        course = dict(self.profile)
        return float(course.get("time", course.get("start", 0.0)))

    def when(self, kind: str, **parameters: float) -> Failure:
        """Return the failure with another course over time."""
        return replace(self, profile=(("kind", kind), *sorted(parameters.items())))

    def to_dict(self) -> dict[str, object]:
        """Return the fault as a scenario has it."""
        return {
            "kind": self.kind,
            "place": self.place,
            "severity": self.severity,
            "profile": dict(self.profile),
            **dict(self.attributes),
        }


@dataclass(frozen=True)
class Row:
    """One run of a campaign; what a wiring's rows have beside is stated in classes of their own.

    Attributes
    ----------
    group : str
        Which part of the campaign it belongs to.
    faults : tuple of Failure
        None: the surroundings alone.
    """

    group: str
    faults: tuple[Failure, ...]

    @property
    def combination(self) -> str:
        """The failures by name."""
        return " + ".join(self.names) or "none"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the failures, sorted."""
        return tuple(sorted(fault.name for fault in self.faults))

    @property
    def courses(self) -> str:
        """How the failures come, in words."""
        return "; ".join(
            " ".join(f"{key} {value:g}" if key != "kind" else str(value)
                     for key, value in fault.profile)
            for fault in self.faults
        )  # fmt: skip

    @property
    def late(self) -> bool:
        """Whether a failure comes while the phase lasts: only then is the flight's rest no risk."""
        return any(fault.onset > self.begin for fault in self.faults)

    @property
    def last(self) -> tuple[str, ...]:
        """Names of the failures that come last: several where they are there from the start."""
        onset = max((fault.onset for fault in self.faults), default=0.0)
        return tuple(sorted(fault.name for fault in self.faults if fault.onset == onset))

    @property
    def lasting(self) -> bool:
        """Whether all failures stay once they have come."""
        return all(dict(fault.profile)["kind"] != "intermittent" for fault in self.faults)

    @property
    def phase(self) -> str:
        """Phase of flight."""
        raise NotImplementedError

    @property
    def begin(self) -> float:
        """When the phase's command comes, in s."""
        raise NotImplementedError

    @property
    def situation(self) -> str:
        """What is commanded in which surroundings, in words."""
        raise NotImplementedError

    def data(self) -> dict[str, Any]:
        """Return the row in the form of a scenario file."""
        raise NotImplementedError

    def scenario(self) -> Scenario:
        """Return the row as a scenario."""
        return Scenario.from_dict(self.data())

    def healthy(self) -> Self:
        """Return the same situation without a failure."""
        return replace(self, group="no failure", faults=())

    def toml(self, *comments: str) -> str:
        """Return the scenario file that replays the row to the bit."""
        lines = [f"# {line}" for line in comments]
        return "\n".join([*lines, *(f"{k} = {_toml(v)}" for k, v in self.data().items())]) + "\n"


def _toml(value: Any) -> str:
    """Write a value as TOML; numbers with all of their digits."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return json.dumps(value) if isinstance(value, (bool, str)) else repr(value)


@dataclass(frozen=True)
class Tried:
    """What is tried of one failure in place of the catalogue's: severity and further numbers."""

    severity: float | None = None
    attributes: Mapping[str, float] = field(default_factory=dict)


def failures(actuator: Actuator, fidelity: str, stated: Mapping[str, Tried]) -> tuple[Failure, ...]:
    """Return every fault of the actuator's catalogue at every place, with both signs if it has two.

    Parameters
    ----------
    actuator : Actuator
        Whose catalogue: what changes nothing in it is left out.
    fidelity : str
        high or low: what it carries.
    stated : mapping
        Kind and place to what is tried.
    """
    from elevon.simulate.acting import own_faults

    every: list[Failure] = []
    for record in own_faults(actuator):
        if fidelity not in record.fidelities:
            continue
        for place in record.places:
            about = stated.get(f"{record.kind}@{place}", Tried())
            needed = {item["name"]: 0.0 for item in record.attributes if item["default"] is None}
            given = tuple({**needed, **about.attributes}.items())
            tried = _tried(record.tried, about.severity)
            every += [
                Failure(record.kind, place, severity, attributes=given, several=len(tried) > 1)
                for severity in tried
            ]
    return tuple(every)


def _tried(catalogued: Sequence[float], stated: float | None) -> tuple[float, ...]:
    """Severities to try: the stated one with the catalogue's signs, or the catalogue's."""
    if stated is None and all(math.isfinite(value) for value in catalogued):
        return tuple(catalogued)
    size = LARGEST if stated is None else abs(stated)
    return tuple(math.copysign(size, value) for value in catalogued)


def together(*chosen: Failure) -> bool:
    """Whether one unit can have all of them: a phase is open or shorted, a switch on or off."""
    from elevon.errors import InputError
    from elevon.faults import Fault, check_together

    if len({failure.place for failure in chosen}) == len(chosen):
        return True
    try:
        check_together([Fault(failure.kind, failure.place, failure.severity) for failure in chosen])
    except InputError:
        return False
    return True
