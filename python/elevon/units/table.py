"""The symbols of units: what actuator people write, and the prefixes that go with them."""

from __future__ import annotations

import csv
from fractions import Fraction
from pathlib import Path

Dimension = tuple[int, int, int, int, int, int]
"""Exponents of length, mass, time, current, temperature, angle."""

Record = tuple[Dimension, str, int]
"""Dimension, rational part of the size in SI units, power of pi in it."""


def _read(name: str) -> list[dict[str, str]]:
    lines = Path(__file__).with_name(f"{name}.csv").read_text("utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def _record(row: dict[str, str]) -> Record:
    length, mass, time, current, temperature, angle = (int(row[name]) for name in _BASES)
    return (length, mass, time, current, temperature, angle), row["size"], int(row["pi"])


_BASES = ("length", "mass", "time", "current", "temperature", "angle")
_ROWS = _read("symbols")

SYMBOLS: dict[str, Record] = {row["symbol"]: _record(row) for row in _ROWS}
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
