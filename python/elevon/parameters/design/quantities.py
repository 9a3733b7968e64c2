"""The numbers of a data sheet that ``[design]`` may hold, each with unit, range and text."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from elevon.data import packaged_toml
from elevon.documents import Document
from elevon.errors import InputError, unknown
from elevon.parameters.parameter import Confidence, Parameter
from elevon.parameters.records import Record
from elevon.units import parse_quantity

#: Wirings that the rules know; the value: whether the output moves along a line.
LINEAR: Mapping[str, bool] = MappingProxyType({"ballscrew": True, "rotary": False})

KINDS = ("brushless", "servo", "dc")


@lru_cache(maxsize=4)
def quantities(wiring: str) -> Mapping[str, Record]:
    """Return what ``[design]`` may hold for a wiring, by name; empty where no rules are."""
    if wiring not in LINEAR:
        return MappingProxyType({})
    table = packaged_toml("elevon.parameters.design", "quantities.toml")
    rows = table["both"] | table["linear" if LINEAR[wiring] else "rotary"]
    return MappingProxyType({name: _record(name, **row) for name, row in rows.items()})


def _record(name: str, unit: str, text: str, *, whole: bool = False, zero: bool = False) -> Record:
    return Record(
        path=f"design.{name}",
        symbol="",
        unit=unit,
        minimum=0.0,
        maximum=1.0 if name == "efficiency" else math.inf,
        minimum_open=not zero,
        maximum_open=False,
        text=text,
        register="plant",
        default=None,
        choices=KINDS if name == "motor.kind" else None,
        whole=whole,
    )


@dataclass(frozen=True)
class Given:
    """What the files of a chain state in ``[design]``: names to values, and the place of each."""

    values: Mapping[str, Parameter]
    places: Mapping[str, str]

    def over(self, below: Given) -> Given:
        """Return these over those of the base."""
        return Given({**below.values, **self.values}, {**below.places, **self.places})


def read_design(document: Document, wiring: str) -> Given:
    """Read a file's ``[design]``.

    Raises
    ------
    InputError
        Everything that is wrong with it: unknown names with the nearest, units, ranges.
    """
    table = document.data.get("design", {})
    known = quantities(wiring)
    if not known:
        raise InputError(f"{document.place(('design',))}: no rules for the wiring {wiring!r}")
    source = table.get("source")
    if source is not None and not (isinstance(source, str) and source.strip()):
        raise InputError(f"{document.place(('design', 'source'))}: is no text that names a source")
    values: dict[str, Parameter] = {}
    places: dict[str, str] = {}
    errors: list[InputError] = []
    for name, raw in _named(table):
        place = document.place(("design", *name.split(".")))
        try:
            if name not in known:
                raise unknown("number of a design", name, known, place)
            values[name] = read_number(known[name], raw, place, source)
            places[name] = place
        except InputError as error:
            errors.append(error)
    if len(errors) == 1:
        raise errors[0]
    if errors:
        raise InputError("\n".join(str(error) for error in errors))
    return Given(values, places)


def _named(table: Mapping[str, Any]) -> list[tuple[str, Any]]:
    motor = table.get("motor", {})
    inner = motor.items() if isinstance(motor, Mapping) else [("", motor)]
    plain = [(name, raw) for name, raw in table.items() if name not in ("source", "motor")]
    return [*plain, *((f"motor.{name}", raw) for name, raw in inner)]


def read_number(record: Record, raw: object, place: str, source: str | None) -> Parameter:
    """Read one number of a design; a text has a unit where the quantity has one."""
    if isinstance(raw, bool) or not isinstance(raw, (int, float, str)):
        raise InputError(f"{place}: write a number with its unit, such as '28 V'")
    text = raw if isinstance(raw, str) else repr(raw)
    if ":" in text:
        raise InputError(f"{place}: {text!r} is not a number; a ratio is written like 4")
    if record.choices is None and record.unit != "1" and _is_bare(text):
        raise InputError(
            f"{place}: {text} has no unit; write it like '{text} {record.unit}' ({record.text})"
        )
    turned = _lead(text, place) if record.path == "design.lead" else None
    value = record.read(text if turned is None else turned, place)
    unit = "" if record.choices else text.strip().lstrip("+-.0123456789eE").strip()
    confidence: Confidence = "unknown" if source is None else "published"
    return Parameter(record.path, value, unit, source or "given", record.text, confidence)


def _is_bare(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _lead(text: str, place: str) -> float | None:
    """Read a lead written per turn, ``2 mm/rev``; None where it is a length."""
    if "/" not in text:
        return None
    return 2.0 * math.pi * parse_quantity(text, "m/rad", place)
