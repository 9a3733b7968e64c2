"""A unit read from its text: a product of symbols, each from the table, perhaps with a prefix."""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from elevon.errors import UnitError, did_you_mean, nearest

Dimension = tuple[int, int, int, int, int, int]
"""Exponents of length, mass, time, current, temperature, angle."""

Record = tuple[Dimension, str, int]
"""Dimension, rational part of the size in SI units, power of pi in it."""


def _read(name: str) -> list[dict[str, str]]:
    lines = Path(__file__).with_name(f"{name}.csv").read_text("utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def _record_of_row(row: dict[str, str]) -> Record:
    length, mass, time, current, temperature, angle = (int(row[name]) for name in _BASES)
    return (length, mass, time, current, temperature, angle), row["size"], int(row["pi"])


_BASES = ("length", "mass", "time", "current", "temperature", "angle")
_ROWS = _read("symbols")

SYMBOLS: dict[str, Record] = {row["symbol"]: _record_of_row(row) for row in _ROWS}
"""Every symbol without a prefix: dimension, size, power of pi."""

PREFIXED = {row["symbol"]: SYMBOLS[row["symbol"]] for row in _ROWS if row["prefixed"] == "1"}
"""Symbols that stand with and without a prefix."""

PREFIXES = {"p": -12, "n": -9, "u": -6, "m": -3, "k": 3, "M": 6, "G": 9}
"""Powers of ten; centi, deci, hecto and deca only where people write them (`SYMBOLS`)."""

OFFSETS = {"degC": Fraction("273.15"), "degF": Fraction("459.67") * Fraction(5, 9)}

WORDS = {row["word"]: row["symbol"] for row in _read("words")}
"""Units written as words, also with an s behind."""

KINDS = tuple((row["kind"], row["unit"]) for row in _read("kinds"))
"""Kinds of quantity, each with a unit of it."""

PRODUCTS = ("kg cm2", "g cm2", "N/mm", "lbf in", "deg/s", "deg/s2", "mm/s", "mm/rev", "V/krpm")
DISPLAY = {
    "rad": "deg",
    "rad/s": "rpm",
    "rad/s2": "deg/s2",
    "m": "mm",
    "m/s": "mm/s",
    "kg m2": "kg cm2",
    "K": "degC",
}
"""The units in which a person reads SI quantities, where these are others."""


Value = TypeVar("Value", float, npt.NDArray[np.float64])


@dataclass(frozen=True)
class Unit:
    """A unit: ``SI value = (value * scale + offset) * pi ** pi``.

    Attributes
    ----------
    text : str
        The unit as written.
    dimension : tuple of int
        Exponents of length, mass, time, current, temperature, angle.
    scale : Fraction
        The rational part of its size in SI units.
    pi : int
        The power of pi in its size (degrees and turns have one).
    offset : Fraction
        Of temperature scales, in K.
    """

    text: str
    dimension: Dimension
    scale: Fraction
    pi: int = 0
    offset: Fraction = Fraction(0)

    @property
    def factor(self) -> float:
        """The unit's size in SI units."""
        return float(self.scale) * math.pi**self.pi

    def to_si(self, value: Value) -> Value:
        """Return a value in this unit as SI."""
        return value * self.factor + float(self.offset) if self.offset else value * self.factor

    def from_si(self, value: Value) -> Value:
        """Return an SI value in this unit."""
        if self.scale < 1 and not self.pi:  # dividing by 1e-3 rounds worse than times 1000
            return (value - float(self.offset)) * float(1 / self.scale)
        return (value - float(self.offset)) / self.factor


_SAME = str.maketrans(
    {"°": "deg", "\u2126": "ohm", "\u03a9": "ohm", "\u00b5": "u", "\u03bc": "u"}
    | {"·": " ", "⋅": " ", "*": " ", "−": "-"}
    | dict(zip("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789", strict=True))
)
_FACTOR = re.compile(r"([A-Za-z_%]+|1)\^?(-?[1-9])?")
_LONGEST = 60


def unit_names() -> list[str]:
    """Return the symbols of the table and some products of them."""
    return [*SYMBOLS, *(unit for _, unit in KINDS if unit not in SYMBOLS), *PRODUCTS]


@lru_cache(maxsize=1024)
def parse_unit(text: str, place: str | None = None) -> Unit:
    """Read a unit.

    Parameters
    ----------
    text : str
        Such as ``"kg cm2"``, ``"N m s/rad"``, ``"W/(m K)"``; ``""`` and ``"1"`` are dimensionless.
    place : str, optional
        Named in the error.

    Returns
    -------
    Unit
        Its size in SI units and its dimension.

    Raises
    ------
    UnitError
        Unknown symbol (with the nearest ones), or not the form of a unit.
    """
    at = f"{place}: " if place else ""
    if len(text) > _LONGEST:
        raise UnitError(f"{at}unit {text[:20]!r}... is longer than {_LONGEST} characters")
    plain = " ".join(text.replace("**", "^").translate(_SAME).split()) or "1"
    factors = [(plain, 1)] if plain in SYMBOLS else _factors(plain, text, at)
    symbols = [(_symbol(name, text, at), power) for name, power in factors]
    if len(symbols) == 1 and symbols[0][1] == 1:
        unit = symbols[0][0]
        return Unit(text, unit.dimension, unit.scale, unit.pi, unit.offset)
    return _product(text, symbols)


def _product(text: str, symbols: list[tuple[Unit, int]]) -> Unit:
    """Multiply symbols; a temperature scale is an interval here."""
    dimension = [0] * 6
    scale, pi = Fraction(1), 0
    for unit, power in symbols:
        dimension = [a + power * b for a, b in zip(dimension, unit.dimension, strict=True)]
        scale *= unit.scale**power
        pi += unit.pi * power
    length, mass, time, current, temperature, angle = dimension
    return Unit(text, (length, mass, time, current, temperature, angle), scale, pi)


def _factors(plain: str, text: str, at: str) -> list[tuple[str, int]]:
    """Split a product into symbols and powers; every part after a `/` divides."""
    above, *below = (piece.strip() for piece in plain.split("/"))
    factors = [_factor(word, text, at) for word in above.split()]
    for part in below:
        bracketed = part.startswith("(") and part.endswith(")")
        words = (part[1:-1] if bracketed else part).split()
        if not words or (len(words) > 1 and not bracketed):
            raise UnitError(f"{at}unit {text!r} is ambiguous; write it like 'W/(m K)'")
        factors += [(name, -power) for name, power in (_factor(word, text, at) for word in words)]
    if not factors:
        raise UnitError(f"{at}{text!r} is not a unit; write it like 'N m s/rad'")
    return factors


def _factor(word: str, text: str, at: str) -> tuple[str, int]:
    match = _FACTOR.fullmatch(word)
    if match is None:
        raise UnitError(f"{at}{text!r} is not a unit{did_you_mean(text, unit_names())}")
    return match[1], int(match[2] or 1)


def _symbol(name: str, text: str, at: str) -> Unit:
    """Look a symbol up: as it stands, as a word, with a prefix."""
    record = _record(name)
    if record is None:
        near = did_you_mean(text, unit_names()) if nearest(text, unit_names()) else ""
        which = f" (symbol {name!r})" if name != text else ""
        raise UnitError(f"{at}unknown unit {text!r}{which}{near or did_you_mean(name, SYMBOLS)}")
    symbol, (dimension, scale, pi), power = record
    size = Fraction(scale) * Fraction(10) ** power
    return Unit(name, dimension, size, pi, OFFSETS.get(symbol, Fraction(0)))


def _record(name: str) -> tuple[str, Record, int] | None:
    """Return the symbol behind a name, its record and the power of ten of its prefix."""
    symbol = WORDS.get(name) or WORDS.get(name.removesuffix("s"), name)
    if symbol in SYMBOLS:
        return symbol, SYMBOLS[symbol], 0
    base = symbol[1:]
    if symbol[:1] in PREFIXES and base in PREFIXED:
        return base, PREFIXED[base], PREFIXES[symbol[0]]
    return None
