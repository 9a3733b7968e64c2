"""The core's catalogue of faults, and reading one fault's numbers against it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from elevon.errors import RangeError, UnknownNameError, nearest, unknown
from elevon.units import format_quantity, parse_quantity

__all__ = ["FaultRecord", "catalogue", "find_record"]


@dataclass(frozen=True)
class FaultRecord:
    """What the core's catalogue says about one kind of fault.

    `declined` says for each fidelity without it why; `targets` which parameters it moves at each
    place.
    """

    kind: str
    places: tuple[str, ...]
    unit: str
    minimum: float
    maximum: float
    minimum_open: bool
    effect: str
    source: str
    attributes: tuple[Mapping[str, Any], ...]
    fidelities: tuple[str, ...]
    declined: Mapping[str, str] = field(default_factory=dict)
    targets: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def range_text(self) -> str:
        """The range of the severity, such as ``[0, 0.95]``."""
        low = "(" if self.minimum_open or math.isinf(self.minimum) else "["
        high = ")" if math.isinf(self.maximum) else "]"
        return f"{low}{self.minimum:g}, {self.maximum:g}{high}"

    def read_severity(self, given: float | str, place: str) -> float:
        """Return the severity in SI, or raise when it is outside the range."""
        value = parse_quantity(given, self.unit or "1", place)
        above = value > self.minimum or (value == self.minimum and not self.minimum_open)
        if not (above and value <= self.maximum):
            unit = self.unit or "1"
            raise RangeError(
                f"{place}: severity {format_quantity(value, unit)} is outside "
                f"{self.range_text}{'' if unit == '1' else ' ' + unit} ({self.effect})"
            )
        return value

    def read_attributes(self, given: Mapping[str, float | str], place: str) -> dict[str, float]:
        """Return the attributes given, in SI; the core fills in what is not."""
        known = {item["name"]: item for item in self.attributes}
        values = {}
        for name, value in given.items():
            if name not in known:
                raise unknown("attribute", name, known, place)
            values[name] = parse_quantity(value, known[name]["unit"] or "1", f"{place}: {name}")
        return values


@lru_cache(maxsize=32)
def catalogue(wiring: str) -> tuple[FaultRecord, ...]:
    """Return the core's catalogue; a kind that acts on places of two units has two records."""
    from elevon import _core

    return tuple(
        FaultRecord(
            kind=item["kind"],
            places=tuple(item["places"]),
            unit=item["unit"],
            minimum=float(item["minimum"]),
            maximum=float(item["maximum"]),
            minimum_open=bool(item["minimum_open"]),
            effect=item["effect"],
            source=item["source"],
            attributes=tuple(item["attributes"]),
            fidelities=tuple(item["fidelities"]),
            declined=item["declined"],
            targets={place: tuple(paths) for place, paths in item["targets"].items()},
        )
        for item in _core.faults(wiring)
    )


def find_record(kind: str, place: str, wiring: str, where: str = "") -> FaultRecord:
    """Return the record of a kind at a place.

    Raises
    ------
    UnknownNameError
        No such kind, with the nearest; or no such place, with all the places of the kind.
    """
    known = catalogue(wiring)
    found = [record for record in known if record.kind == kind]
    if not found:
        raise _unknown_kind(kind, known, where)
    for record in found:
        if place in record.places:
            return record
    places = [name for record in found for name in record.places]
    start = f"{where}: " if where else ""
    raise UnknownNameError(
        f"{start}{kind}: the actuator has no place {place!r}; places: {', '.join(places)}",
        place,
        nearest(place, places),
    )


_STUCK = ("not", "high", "low", "on", "off")
"""Words by which the catalogue says that something is stuck."""


def _unknown_kind(kind: str, known: tuple[FaultRecord, ...], where: str) -> UnknownNameError:
    """Build the error for a kind that does not exist.

    Like names first, then those that share a word with it: `brake_stuck` is near every fault of
    the brake, those that mean stuck first.
    """
    kinds = list(dict.fromkeys(record.kind for record in known))
    words = {word for word in kind.lower().replace("-", "_").split("_") if len(word) > 2}
    if "stuck" in words:
        words.update(_STUCK)

    def shared(name: str) -> int:
        return len(words & set(name.split("_")))

    things = words.difference(_STUCK)
    akin = [name for name in kinds if things & set(name.split("_"))]
    akin.sort(key=shared, reverse=True)
    near = list(dict.fromkeys([*nearest(kind, kinds), *akin]))[:4]
    if not near:
        return unknown("fault", kind, kinds, where or None)
    start = f"{where}: " if where else ""
    listed = " or ".join(repr(name) for name in near)
    return UnknownNameError(f"{start}unknown fault {kind!r}; did you mean {listed}?", kind, near)
