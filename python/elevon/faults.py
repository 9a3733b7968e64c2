"""Faults as data: kind, place, severity in a physical unit, and a profile over time.

The catalogue itself comes from the core; the grammar is in ``docs/faults.md``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from elevon.errors import InputError, RangeError, unknown
from elevon.series import check_series, read_series
from elevon.units import format_quantity, parse_quantity

__all__ = ["Fault", "FaultRecord", "Profile", "catalogue", "check_together", "profile_records"]

Value = float | str

_FORM = "KIND@PLACE=VALUE[unit][,attribute=value...][:profile(argument=value,...)]"
_SPEC = re.compile(r"\s*([^@=:,\s]+)\s*@\s*([^@=:,\s]+)\s*=\s*([^:]*?)\s*(?::\s*(.*?)\s*)?", re.S)
_PROFILE = re.compile(r"([A-Za-z_]+)\s*(?:\((.*)\))?", re.S)

#: Kinds that cannot both act on one place: what one opens or jams the other needs whole.
_EXCLUSIVE = (
    frozenset({"open_phase", "short"}),
    frozenset({"open_switch", "shorted_switch"}),
)


@dataclass(frozen=True)
class Profile:
    """How the severity goes over time.

    Attributes
    ----------
    kind : str
        One of the core's profiles: constant, step, ramp, ...
    arguments : mapping
        Its arguments, SI numbers or text with units.
    times, values : tuple of float
        Points of a `table` profile, s and the profile's own values.
    """

    kind: str = "constant"
    arguments: Mapping[str, Value] = field(default_factory=dict)
    times: tuple[float, ...] = ()
    values: tuple[float, ...] = ()

    @classmethod
    def parse(cls, text: str) -> Profile:
        """Read ``step(time=5 s)``; a table is ``table(times=0;5;10,values=0;0.5;1)``."""
        match = _PROFILE.fullmatch(text.strip())
        if match is None:
            raise InputError(f"fault profile {text!r} is not of the form name(argument=value,...)")
        return cls.from_dict({"kind": match[1], **_pairs(match[2] or "", f"profile {text!r}")})

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], place: str = "profile") -> Profile:
        """Read a mapping with ``kind`` and the arguments as keys."""
        rest = dict(data)
        kind = rest.pop("kind", None)
        if not isinstance(kind, str):
            raise InputError(f"{place}: 'kind' is missing")
        if (file := rest.pop("file", None)) is not None:
            if "times" in rest or "values" in rest:
                raise InputError(f"{place}: give either a file or times and values, not both")
            rest["times"], rest["values"] = read_series(file, place)
        times = _numbers(rest.pop("times", ()), f"{place}: times")
        values = _numbers(rest.pop("values", ()), f"{place}: values")
        return cls(kind, rest, times, values)

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping `from_dict` reads."""
        points = {"times": list(self.times), "values": list(self.values)} if self.times else {}
        return {"kind": self.kind, **self.arguments, **points}

    def __str__(self) -> str:
        """The profile in the fault grammar."""
        points = {
            name: ";".join(f"{number!r}" for number in numbers)
            for name, numbers in (("times", self.times), ("values", self.values))
            if numbers
        }
        given = ",".join(f"{name}={value}" for name, value in {**self.arguments, **points}.items())
        return f"{self.kind}({given})" if given else self.kind


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
            raise InputError(f"fault {text!r} is not of the form {_FORM}")
        severity, _, rest = match[3].partition(",")
        return cls(
            kind=match[1],
            place=match[2],
            severity=severity.strip(),
            attributes=_pairs(rest, f"fault {text!r}"),
            profile=Profile() if match[4] is None else Profile.parse(match[4]),
        )

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], place: str = "fault") -> Fault:
        """Read a ``[[fault]]`` table: kind, place, severity, profile; other keys are attributes."""
        rest = dict(data)
        needed = {}
        for key in ("kind", "place", "severity"):
            if key not in rest:
                raise InputError(f"{place}: {key!r} is missing")
            needed[key] = rest.pop(key)
        profile = rest.pop("profile", "constant")
        read = (
            Profile.parse(profile)
            if isinstance(profile, str)
            else Profile.from_dict(profile, f"{place}.profile")
        )
        return cls(attributes=rest, profile=read, **needed)

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping `from_dict` reads."""
        data = {"kind": self.kind, "place": self.place, "severity": self.severity}
        profile = {} if self.profile == Profile() else {"profile": self.profile.to_dict()}
        return {**data, **self.attributes, **profile}

    def __str__(self) -> str:
        """The fault in the grammar of the command line."""
        attributes = "".join(f",{name}={value}" for name, value in self.attributes.items())
        profile = "" if self.profile == Profile() else f":{self.profile}"
        return f"{self.kind}@{self.place}={self.severity}{attributes}{profile}"

    def resolved(self, wiring: str, fidelity: str, place: str = "") -> dict[str, Any]:
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
        record = _record(self.kind, wiring, place)
        if self.place not in record.places:
            raise InputError(
                f"{start}{self.kind}: no place {self.place!r}; places: {', '.join(record.places)}"
            )
        if fidelity not in record.fidelities:
            shown = ", ".join(record.fidelities)
            raise InputError(f"{start}{self.kind} exists at fidelity {shown}, not {fidelity}")
        return {
            "kind": self.kind,
            "place": self.place,
            "severity": record.read_severity(self.severity, f"{start}{self.kind}@{self.place}"),
            "attributes": record.read_attributes(self.attributes, f"{start}{self.kind}"),
            "profile": _resolved_profile(self.profile, f"{start}{self.kind}"),
        }


@dataclass(frozen=True)
class FaultRecord:
    """What the core's catalogue says about one kind of fault."""

    kind: str
    places: tuple[str, ...]
    unit: str
    minimum: float
    maximum: float
    effect: str
    source: str
    attributes: tuple[Mapping[str, Any], ...]
    fidelities: tuple[str, ...]

    @property
    def range_text(self) -> str:
        """The range of the severity, such as ``[0, 0.99]``."""
        return f"[{self.minimum:g}, {self.maximum:g}]"

    def read_severity(self, given: Value, place: str) -> float:
        """Return the severity in SI, or raise when it is outside the range."""
        value = parse_quantity(given, self.unit or "1", place)
        if not self.minimum <= value <= self.maximum:
            unit = self.unit or "1"
            raise RangeError(
                f"{place}: severity {format_quantity(value, unit)} is outside "
                f"{self.range_text}{'' if unit == '1' else ' ' + unit} ({self.effect})"
            )
        return value

    def read_attributes(self, given: Mapping[str, Value], place: str) -> dict[str, float]:
        """Return every attribute in SI, defaults filled in."""
        known = {item["name"]: item for item in self.attributes}
        for name in given:
            if name not in known:
                raise unknown("attribute", name, known, place)
        values = {}
        for name, item in known.items():
            if name not in given and item["default"] is None:
                raise InputError(f"{place}: attribute {name!r} is missing ({item['text']})")
            value = given.get(name, item["default"])
            values[name] = (
                parse_quantity(value, item["unit"] or "1", f"{place}: {name}")
                if name in given
                else float(value)
            )
        return values


@lru_cache(maxsize=32)
def catalogue(wiring: str) -> Mapping[str, FaultRecord]:
    """Return the core's fault catalogue of a wiring, by kind."""
    from elevon import _core

    return {
        item["kind"]: FaultRecord(
            kind=item["kind"],
            places=tuple(item["places"]),
            unit=item["unit"],
            minimum=float(item["minimum"]),
            maximum=float(item["maximum"]),
            effect=item["effect"],
            source=item["source"],
            attributes=tuple(item["attributes"]),
            fidelities=tuple(item["fidelities"]),
        )
        for item in _core.faults(wiring)
    }


@lru_cache(maxsize=1)
def profile_records() -> Mapping[str, Mapping[str, Any]]:
    """Return the core's records of fault profiles, by kind."""
    from elevon import _core

    return {item["kind"]: item for item in _core.profiles()}


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


def _record(kind: str, wiring: str, place: str) -> FaultRecord:
    known = catalogue(wiring)
    if kind not in known:
        raise unknown("fault", kind, known, place or None)
    return known[kind]


def _resolved_profile(profile: Profile, place: str) -> dict[str, Any]:
    known = profile_records()
    if profile.kind not in known:
        raise unknown("profile", profile.kind, known, place)
    record = known[profile.kind]
    at = f"{place}: profile {profile.kind}"
    parameters = {item["name"]: item for item in record["parameters"]}
    for name in profile.arguments:
        if name not in parameters:
            raise unknown("argument", name, parameters, at)
    values = {}
    for name, item in parameters.items():
        if name in profile.arguments:
            given = profile.arguments[name]
            values[name] = parse_quantity(given, item["unit"] or "1", f"{at}: {name}")
        elif item["default"] is None:
            raise InputError(f"{at}: {name!r} is missing ({item['text']})")
        else:
            values[name] = float(item["default"])
    _check_order(values, at)
    return {"kind": profile.kind, "parameters": list(values.values()), **_points(profile, at)}


def _check_order(values: Mapping[str, float], at: str) -> None:
    for first, last in (("start", "end"), ("start", "stop")):
        if first in values and last in values and values[last] <= values[first]:
            raise InputError(
                f"{at} ends before it starts: {last} = {values[last]:g} s, "
                f"{first} = {values[first]:g} s"
            )


def _points(profile: Profile, at: str) -> dict[str, Any]:
    if profile.kind != "table":
        if profile.times or profile.values:
            raise InputError(f"{at}: only a table takes times and values")
        return {"times": (), "values": ()}
    times, values = check_series(profile.times, profile.values, at)
    return {"times": times, "values": values}


def _pairs(text: str, place: str) -> dict[str, str]:
    pairs: dict[str, str] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, equals, value = part.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise InputError(f"{place}: {part!r} is not of the form name=value")
        if name.strip() in pairs:
            raise InputError(f"{place}: {name.strip()!r} is given twice")
        pairs[name.strip()] = value.strip()
    return pairs


def _numbers(given: Any, place: str) -> tuple[float, ...]:
    items = [part.strip() for part in given.split(";")] if isinstance(given, str) else list(given)
    try:
        return tuple(float(item) for item in items)
    except (TypeError, ValueError) as error:
        raise InputError(f"{place}: {given!r} is not a list of numbers") from error
