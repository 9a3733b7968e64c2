"""The core's records of a wiring's parameters, and reading one value against one record."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from elevon.errors import InputError, RangeError, UnknownNameError, did_you_mean, unknown
from elevon.seam import WiringRecord
from elevon.units import format_quantity, parse_quantity


@dataclass(frozen=True, slots=True)
class Record:
    """What the core says about one parameter; numbers are SI.

    `fidelities` are those that carry it, `not_modelled` says of the others why not, and `when` what
    must hold (all of it) for it to act.
    """

    path: str
    symbol: str
    unit: str
    minimum: float
    maximum: float
    minimum_open: bool
    maximum_open: bool
    text: str
    register: str
    default: float | None
    choices: tuple[str, ...] | None
    whole: bool = False
    fidelities: tuple[str, ...] = ()
    not_modelled: Mapping[str, str] = field(default_factory=dict)
    when: tuple[str, ...] = ()

    @property
    def acts_text(self) -> str:
        """Where it acts, such as ``high; drive.kind = hysteresis``; empty: everywhere, always."""
        where = [" ".join(self.fidelities) or "nowhere"] if self.not_modelled else []
        reasons = [f"not {name}: {why}" for name, why in self.not_modelled.items()]
        return "; ".join([*where, *self.when, *reasons])

    @property
    def range_text(self) -> str:
        """The range as an interval, such as ``(0, 1]``."""
        if self.choices:
            return "|".join(self.choices)
        low = "(" if self.minimum_open or math.isinf(self.minimum) else "["
        high = ")" if self.maximum_open or math.isinf(self.maximum) else "]"
        whole = " whole" if self.whole else ""
        return f"{low}{self.minimum:g}, {self.maximum:g}{high}{whole}"

    def read(
        self, given: str | float, place: str | None = None, display_unit: str | None = None
    ) -> float | str:
        """Read a value; a number is in SI, a text has a unit.

        A text may do without where `display_unit` is that of the SI.

        Returns
        -------
        float or str
            SI value, or the name of a choice.

        Raises
        ------
        InputError, UnitError, RangeError
            The message names the place, the value, the limit or the choices.
        """
        place = place or self.path
        if self.choices is not None:
            return self._choice(given, place)
        value = parse_quantity(given, self.unit or "1", place, display_unit)
        self.check(value, place)
        return value

    def check(self, value: float, place: str | None = None) -> None:
        """Raise `RangeError` unless the SI value is finite and in the record's range."""
        above = value > self.minimum or (value == self.minimum and not self.minimum_open)
        below = value < self.maximum or (value == self.maximum and not self.maximum_open)
        if math.isfinite(value) and above and below:
            if self.whole and not float(value).is_integer():
                raise RangeError(
                    f"{place or self.path} = {value:.9g} is not a whole number; "
                    f"{math.floor(value)} or {math.ceil(value)} ({self.text})"
                )
            return
        text = format_quantity(value, self.unit, 9) if math.isfinite(value) else str(value)
        raise RangeError(
            f"{place or self.path} = {text} is outside {self.range_text}"
            f"{' ' + self.unit if self.unit not in ('', '1') else ''} ({self.text})"
        )

    def number(self, value: float | str) -> float:
        """Return the value as it crosses the seam: a choice becomes its index."""
        if self.choices is None:
            return float(value)
        return float(self.choices.index(str(value)))

    def default_value(self) -> float | str | None:
        """Return the core's default as a value or the name of a choice."""
        if self.default is None or self.choices is None:
            return self.default
        return self.choices[int(self.default)]

    def _choice(self, given: str | float, place: str) -> str:
        assert self.choices is not None
        if isinstance(given, str) and given.strip() in self.choices:
            return given.strip()
        known = ", ".join(repr(choice) for choice in self.choices)
        raise InputError(
            f"{place}: {given!r} is none of {known}{did_you_mean(str(given), self.choices)}"
        )


@lru_cache(maxsize=1)
def wirings() -> Mapping[str, WiringRecord]:
    """Return the core's wirings, by name."""
    from elevon import _core

    return MappingProxyType({item["name"]: item for item in _core.wirings()})


def wiring_names() -> list[str]:
    """Return the names of the wirings the core knows."""
    return list(wirings())


@lru_cache(maxsize=32)
def records(wiring: str) -> Mapping[str, Record]:
    """Return the core's records of a wiring, by path, in the core's order.

    Raises
    ------
    UnknownNameError
        The core has no such wiring.
    """
    from elevon import _core

    names = wiring_names()
    if wiring not in names:
        raise unknown("wiring", wiring, names)
    return MappingProxyType({item["path"]: _record(item) for item in _core.parameters(wiring)})


@lru_cache(maxsize=32)
def positions(wiring: str) -> Mapping[str, int]:
    """Return where each parameter stands in the core's vector."""
    return {path: index for index, path in enumerate(records(wiring))}


def record_of(wiring: str, path: str, place: str | None = None) -> Record:
    """Return one record, or raise with the nearest paths."""
    known = records(wiring)
    if path not in known:
        raise _unknown_path(path, known, place)
    return known[path]


def _unknown_path(path: str, known: Mapping[str, Record], place: str | None) -> UnknownNameError:
    return unknown("parameter", path, known, place)


def _record(item: Mapping[str, Any]) -> Record:
    lists = {name: tuple(item[name]) for name in ("fidelities", "when")}
    choices = tuple(item["choices"]) if item["choices"] else None
    return Record(**{**item, **lists, "choices": choices})
