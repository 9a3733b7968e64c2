"""How the severity of a fault goes over time."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from elevon.errors import InputError, unknown
from elevon.seam import CoreProfile, Points, ProfileParameter, ProfileRecord
from elevon.series import check_series, read_series
from elevon.units import parse_quantity


def pairs(text: str, place: str) -> dict[str, str]:
    """Read ``name=value,name=value``; raise `InputError` naming the part that is not so."""
    values: dict[str, str] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, equals, value = part.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise InputError(f"{place}: {part!r} is not of the form name=value")
        if name.strip() in values:
            raise InputError(f"{place}: {name.strip()!r} is given twice")
        values[name.strip()] = value.strip()
    return values


def numbers(given: object, place: str) -> tuple[float, ...]:
    """Read a sequence of numbers, or a text of numbers separated by semicolons."""
    items = [part.strip() for part in given.split(";")] if isinstance(given, str) else given
    if not isinstance(items, Iterable):
        raise InputError(f"{place}: {given!r} is not a list of numbers")
    try:
        return tuple(float(item) for item in items)
    except (TypeError, ValueError) as error:
        raise InputError(f"{place}: {given!r} is not a list of numbers") from error


_FORM = re.compile(r"([A-Za-z_]+)\s*(?:\((.*)\))?", re.S)


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
    arguments: Mapping[str, float | str] = field(default_factory=dict)
    times: tuple[float, ...] = ()
    values: tuple[float, ...] = ()

    @classmethod
    def parse(cls, text: str) -> Profile:
        """Read ``step(time=5 s)``; a table is ``table(times=0;5;10,values=0;0.5;1)``."""
        match = _FORM.fullmatch(text.strip())
        if match is None:
            raise InputError(f"fault profile {text!r} is not of the form name(argument=value,...)")
        return cls.from_dict({"kind": match[1], **pairs(match[2] or "", f"profile {text!r}")})

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], place: str = "profile") -> Profile:
        """Read a mapping with ``kind`` and the arguments as keys."""
        keys = dict(data)
        kind = keys.pop("kind", None)
        if not isinstance(kind, str):
            raise InputError(f"{place}: 'kind' is missing")
        if (file := keys.pop("file", None)) is not None:
            if "times" in keys or "values" in keys:
                raise InputError(f"{place}: give either a file or times and values, not both")
            keys["times"], keys["values"] = read_series(file, place)
        times = numbers(keys.pop("times", ()), f"{place}: times")
        values = numbers(keys.pop("values", ()), f"{place}: values")
        return cls(kind, keys, times, values)

    def to_dict(self) -> dict[str, object]:
        """Return the mapping `from_dict` reads."""
        points = {"times": list(self.times), "values": list(self.values)} if self.times else {}
        return {"kind": self.kind, **self.arguments, **points}

    def __str__(self) -> str:
        """The profile in the fault grammar."""
        given_points = {
            name: ";".join(f"{number!r}" for number in points)
            for name, points in (("times", self.times), ("values", self.values))
            if points
        }
        given = ",".join(
            f"{name}={value}" for name, value in {**self.arguments, **given_points}.items()
        )
        return f"{self.kind}({given})" if given else self.kind

    def resolved(self, place: str) -> CoreProfile:
        """Check the profile against the core's records; return what crosses the seam, in SI.

        Raises
        ------
        UnknownNameError
            A profile or an argument that does not exist.
        InputError
            A missing argument, one out of its range, an end before the start, a malformed table.
        """
        known = profile_records()
        if self.kind not in known:
            raise unknown("profile", self.kind, known, place)
        at = f"{place}: profile {self.kind}"
        values = _values(self.arguments, known[self.kind]["parameters"], at)
        _check(values, at)
        times, points = _points(self, at)
        return {
            "kind": self.kind,
            "parameters": list(values.values()),
            "times": times,
            "values": points,
        }


@lru_cache(maxsize=1)
def profile_records() -> Mapping[str, ProfileRecord]:
    """Return the core's records of fault profiles, by kind."""
    from elevon import _core

    return {item["kind"]: item for item in _core.profiles()}


def _values(
    arguments: Mapping[str, float | str], parameters: list[ProfileParameter], at: str
) -> dict[str, float]:
    for name in arguments:
        if name not in {item["name"] for item in parameters}:
            raise unknown("argument", name, [item["name"] for item in parameters], at)
    values = {}
    for item in parameters:
        name = item["name"]
        if name in arguments:
            values[name] = parse_quantity(arguments[name], item["unit"] or "1", f"{at}: {name}")
        elif item["default"] is None:
            raise InputError(f"{at}: {name!r} is missing ({item['text']})")
        else:
            values[name] = float(item["default"])
    return values


def _check(values: Mapping[str, float], at: str) -> None:
    if "end" in values and values["end"] <= values["start"]:
        raise InputError(
            f"{at} ends before it starts: end = {values['end']:g} s, start = {values['start']:g} s"
        )
    for name in ("period", "time_constant"):
        if values.get(name, 1.0) <= 0.0:
            raise InputError(f"{at}: {name} = {values[name]:g} s must be positive")
    if not 0.0 <= values.get("duty", 0.0) <= 1.0:
        raise InputError(f"{at}: duty = {values['duty']:g} must be from 0 to 1")


def _points(profile: Profile, at: str) -> tuple[Points, Points]:
    if profile.kind != "table":
        if profile.times or profile.values:
            raise InputError(f"{at}: only a table takes times and values")
        return (), ()
    times, values = check_series(profile.times, profile.values, at)
    if values.min() < 0.0 or values.max() > 1.0:
        raise InputError(f"{at}: the values are fractions of the severity, from 0 to 1")
    return times, values
