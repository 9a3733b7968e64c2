"""The core's catalogue of faults, and reading one fault's numbers against it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from elevon.errors import RangeError, UnknownNameError, nearest, unknown
from elevon.retired import remark, successors
from elevon.units import format_quantity, parse_quantity


@dataclass(frozen=True)
class FaultRecord:
    """What the core's catalogue says about one kind of fault.

    `not_modelled` says for each fidelity without it why; `targets` which parameters it moves at
    each place. `rate` is in failures an hour of the part in all of its modes.
    """

    kind: str
    places: tuple[str, ...]
    unit: str
    minimum: float
    maximum: float
    minimum_open: bool
    effect: str
    source: str
    rate: float
    rate_source: str
    attributes: tuple[Mapping[str, Any], ...]
    fidelities: tuple[str, ...]
    not_modelled: Mapping[str, str] = field(default_factory=dict)
    targets: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    whole: bool = False
    switched: bool = False

    @property
    def range_text(self) -> str:
        """The range of the severity, such as ``[0, 0.95]``."""
        return _interval(self.minimum, self.maximum, self.minimum_open)

    @property
    def tried(self) -> tuple[float, ...]:
        """Severities with which a campaign tries the fault: half the range, with both its signs.

        A share from 0 to 1 is tried whole.
        """
        top = self.maximum
        chosen = top if self.unit == "1" and top == 1.0 else 0.5 * top
        return (chosen, -chosen) if self.minimum < 0.0 else (chosen,)

    def read_severity(self, given: float | str, place: str) -> float:
        """Return the severity in SI, or raise when it is outside the range."""
        value = parse_quantity(given, self.unit or "1", place)
        bounds = (self.minimum, self.maximum, self.minimum_open)
        _check(value, bounds, self.unit or "1", f"{place}: severity", self.effect)
        return value

    def read_attributes(self, given: Mapping[str, float | str], place: str) -> dict[str, float]:
        """Return the attributes given, in SI; the core fills in what is not."""
        known = {item["name"]: item for item in self.attributes}
        values = {}
        for name, value in given.items():
            if name not in known:
                raise unknown("attribute", name, known, place)
            item = known[name]
            unit = item["unit"] or "1"
            values[name] = parse_quantity(value, unit, f"{place}: {name}")
            bounds = (item["minimum"], item["maximum"], item["minimum_open"])
            _check(values[name], bounds, unit, f"{place}: {name}", item["text"])
        return values


def _interval(low: float, high: float, low_open: bool) -> str:
    left = "(" if low_open or math.isinf(low) else "["
    right = ")" if math.isinf(high) else "]"
    return f"{left}{low:g}, {high:g}{right}"


def _check(
    value: float, bounds: tuple[float, float, bool], unit: str, subject: str, text: str
) -> None:
    """Raise `RangeError` unless the value lies within its bounds (low, high, low excluded)."""
    low, high, low_open = bounds
    above = value > low or (value == low and not low_open)
    if not (above and value <= high):
        display = unit if unit != "1" else ""
        raise RangeError(
            f"{subject} {format_quantity(value, unit)} is outside "
            f"{_interval(*bounds)}{' ' + display if display else ''} ({text})"
        )


@lru_cache(maxsize=32)
def catalogue(wiring: str) -> tuple[FaultRecord, ...]:
    """Return the core's catalogue; a kind that acts on places of two units has two records."""
    from elevon import _core

    return tuple(_record(item) for item in _core.faults(wiring))


def _record(item: Mapping[str, Any]) -> FaultRecord:
    lists = {name: tuple(item[name]) for name in ("places", "attributes", "fidelities")}
    targets = {place: tuple(paths) for place, paths in item["targets"].items()}
    return FaultRecord(**{**item, **lists, "targets": targets})


def find_record(kind: str, place: str, wiring: str, where: str = "") -> FaultRecord:
    """Return the record of a kind at a place.

    Raises
    ------
    UnknownNameError
        No such kind, with the nearest; or no such place, with all the places of the kind.
    """
    known = catalogue(wiring)
    matches = [record for record in known if record.kind == kind]
    if not matches:
        raise _unknown_kind(kind, place, known, where)
    for record in matches:
        if place in record.places:
            return record
    places = [name for record in matches for name in record.places]
    start = f"{where}: " if where else ""
    raise UnknownNameError(
        f"{start}{kind}: the actuator has no place {place!r}; places: {', '.join(places)}",
        place,
        nearest(place, places),
    )


_STUCK = ("not", "high", "low", "on", "off")
"""Words by which the catalogue says that something is stuck."""


def _unknown_kind(
    kind: str, place: str, known: tuple[FaultRecord, ...], where: str
) -> UnknownNameError:
    """Build the error for a kind that does not exist.

    What replaced a retired name comes first, kinds that act at the place before others. Then like
    names, then those that share a word with it: `brake_stuck` is near every fault of
    the brake, those that mean stuck first.
    """
    kinds = list(dict.fromkeys(record.kind for record in known))
    here = {record.kind for record in known if place in record.places}
    words = {word for word in kind.lower().replace("-", "_").split("_") if len(word) > 2}
    if "stuck" in words:
        words.update(_STUCK)

    def shared(name: str) -> int:
        return len(words & set(name.split("_")))

    things = words.difference(_STUCK)
    related = [name for name in kinds if things & set(name.split("_"))]
    related.sort(key=shared, reverse=True)
    old = sorted(successors(kind, kinds), key=lambda name: name not in here)
    near = list(dict.fromkeys([*old, *nearest(kind, kinds), *related]))[:4]
    if remark("fault", kind) or not near:
        return unknown("fault", kind, kinds, where or None)
    start = f"{where}: " if where else ""
    listed = " or ".join(repr(name) for name in near)
    return UnknownNameError(f"{start}unknown fault {kind!r}; did you mean {listed}?", kind, near)
