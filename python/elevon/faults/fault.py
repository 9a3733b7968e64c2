"""One fault as data, and the text it is written as."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from elevon.errors import InputError
from elevon.faults.catalogue import catalogue, find_record
from elevon.faults.profile import Profile, pairs
from elevon.seam import CoreFault

Value = float | str

_FORM = "KIND@PLACE=VALUE[unit][,attribute=value...][:profile(argument=value,...)]"
_SPEC = re.compile(r"\s*([^@=:,\s]+)\s*@\s*([^@=:,\s]+)\s*=\s*([^:]*?)\s*(?::\s*(.*?)\s*)?", re.S)

#: Kinds that cannot both act on one place: what one opens or jams the other needs whole.
_EXCLUSIVE = (
    frozenset({"open_phase", "short"}),
    frozenset({"open_switch", "shorted_switch"}),
)


def _placed(text: str) -> str:
    """Return how a fault without a place is written with one; empty where that is not the slip."""
    from elevon.parameters.records import wiring_names

    kind, equals, severity = text.partition("=")
    if not equals or "@" in kind:
        return ""
    known = [record for wiring in wiring_names() for record in catalogue(wiring)]
    places = [name for record in known if record.kind == kind.strip() for name in record.places]
    written = [f"{kind.strip()}@{place}={severity}" for place in dict.fromkeys(places)]
    return f"; it needs a place: {' or '.join(map(repr, written))}" if written else ""


@dataclass(frozen=True)
class Fault:
    """One fault.

    Attributes
    ----------
    kind, place : str
        From the catalogue, such as ``short`` at ``motor.phase_a``.
    severity : float or str
        SI number, or text with a unit (``"0.1 deg"``, ``"25 %"``).
    attributes : mapping
        Further values some kinds take, such as the position of a jam.
    profile : Profile
        How the severity goes over time; constant when not given.
    """

    kind: str
    place: str
    severity: Value
    attributes: Mapping[str, Value] = field(default_factory=dict)
    profile: Profile = field(default_factory=Profile)

    @classmethod
    def parse(cls, text: str) -> Fault:
        """Read the grammar of the command line.

        Parameters
        ----------
        text : str
            Such as ``short@motor.phase_a=0.2:ramp(start=1 s,end=5 s)``.

        Raises
        ------
        InputError
            The text does not follow the grammar.
        """
        match = _SPEC.fullmatch(text)
        if match is None or not match[3]:
            raise InputError(f"fault {text!r} is not of the form {_FORM}{_placed(text)}")
        severity, _, attributes = match[3].partition(",")
        return cls(
            kind=match[1],
            place=match[2],
            severity=severity.strip(),
            attributes=pairs(attributes, f"fault {text!r}"),
            profile=Profile() if match[4] is None else Profile.parse(match[4]),
        )

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], place: str = "fault") -> Fault:
        """Read a ``[[fault]]`` table: kind, place, severity, profile; other keys are attributes."""
        keys = dict(data)
        needed: dict[str, Any] = {}
        for key in ("kind", "place", "severity"):
            if key not in keys:
                raise InputError(f"{place}: {key!r} is missing")
            needed[key] = keys.pop(key)
        for key in ("kind", "place"):
            if not isinstance(needed[key], str):
                raise InputError(f"{place}: {key} = {needed[key]!r} is not a text")
        profile = keys.pop("profile", "constant")
        if not isinstance(profile, (str, Mapping)):
            raise InputError(f"{place}: profile = {profile!r} is neither a table nor a text")
        read = (
            Profile.parse(profile)
            if isinstance(profile, str)
            else Profile.from_dict(profile, f"{place}.profile")
        )
        return cls(attributes=keys, profile=read, **needed)

    def to_dict(self) -> dict[str, object]:
        """Return the mapping `from_dict` reads."""
        data = {"kind": self.kind, "place": self.place, "severity": self.severity}
        profile = {} if self.profile == Profile() else {"profile": self.profile.to_dict()}
        return {**data, **self.attributes, **profile}

    def __str__(self) -> str:
        """The fault in the grammar of the command line."""
        attributes = "".join(f",{name}={value}" for name, value in self.attributes.items())
        profile = "" if self.profile == Profile() else f":{self.profile}"
        return f"{self.kind}@{self.place}={self.severity}{attributes}{profile}"

    def resolved(self, wiring: str, fidelity: str, place: str = "") -> CoreFault:
        """Check the fault against the catalogue and return what crosses the seam, in SI.

        Raises
        ------
        UnknownNameError
            Kind, place, attribute or profile the actuator does not have; the message lists them.
        RangeError
            Severity outside the catalogue's range.
        InputError
            The fidelity cannot show this kind, or the profile ends before it starts.
        """
        start = f"{place}: " if place else ""
        record = find_record(self.kind, self.place, wiring, place)
        if fidelity not in record.fidelities:
            fidelities = ", ".join(record.fidelities)
            reason = record.not_modelled.get(fidelity, "")
            why = f": {reason}" if reason else ""
            raise InputError(
                f"{start}{self.kind} exists at fidelity {fidelities}, not {fidelity}{why}"
            )
        return {
            "kind": self.kind,
            "place": self.place,
            "severity": record.read_severity(self.severity, f"{start}{self.kind}@{self.place}"),
            "attributes": record.read_attributes(self.attributes, f"{start}{self.kind}"),
            "profile": self.profile.resolved(f"{start}{self.kind}"),
        }


def check_together(faults: Sequence[Fault], place: str = "") -> None:
    """Raise `InputError` when two faults contradict each other."""
    start = f"{place}: " if place else ""
    for index, fault in enumerate(faults):
        for other in faults[:index]:
            if fault.place != other.place:
                continue
            if fault.kind == other.kind:
                raise InputError(
                    f"{start}{fault.kind}@{fault.place} is given twice; say one severity"
                )
            if frozenset({fault.kind, other.kind}) in _EXCLUSIVE:
                raise InputError(
                    f"{start}{other.kind} and {fault.kind} of {fault.place} contradict each other"
                )
