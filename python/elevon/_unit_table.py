"""The units themselves: one record a symbol, products of symbols, pint for the rest."""

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, lru_cache
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from elevon.errors import UnitError, did_you_mean, nearest

__all__ = ["KINDS", "Unit", "parse_unit", "unit_names"]

Value = TypeVar("Value", float, npt.NDArray[np.float64])
Dimension = tuple[int, int, int, int, int, int]
"""Exponents of length, mass, time, current, temperature, angle."""


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


_NONE: Dimension = (0, 0, 0, 0, 0, 0)
_LENGTH: Dimension = (1, 0, 0, 0, 0, 0)
_MASS: Dimension = (0, 1, 0, 0, 0, 0)
_TIME: Dimension = (0, 0, 1, 0, 0, 0)
_CURRENT: Dimension = (0, 0, 0, 1, 0, 0)
_TEMPERATURE: Dimension = (0, 0, 0, 0, 1, 0)
_ANGLE: Dimension = (0, 0, 0, 0, 0, 1)
_FREQUENCY: Dimension = (0, 0, -1, 0, 0, 0)
_SPEED: Dimension = (0, 0, -1, 0, 0, 1)
_FORCE: Dimension = (1, 1, -2, 0, 0, 0)
_PRESSURE: Dimension = (-1, 1, -2, 0, 0, 0)
_ENERGY: Dimension = (2, 1, -2, 0, 0, 0)
_POWER: Dimension = (2, 1, -3, 0, 0, 0)
_VOLTAGE: Dimension = (2, 1, -3, -1, 0, 0)
_RESISTANCE: Dimension = (2, 1, -3, -2, 0, 0)
_INDUCTANCE: Dimension = (2, 1, -2, -2, 0, 0)
_CAPACITANCE: Dimension = (-2, -1, 4, 2, 0, 0)
_FLUX: Dimension = (2, 1, -2, -1, 0, 0)

_POUND = "4.4482216152605"  # lbf in N, exact by definition
_SYMBOLS: dict[str, tuple[Dimension, str, int]] = {
    "1": (_NONE, "1", 0),
    "%": (_NONE, "1/100", 0),
    "ppm": (_NONE, "1/1000000", 0),
    "m": (_LENGTH, "1", 0),
    "cm": (_LENGTH, "1/100", 0),
    "mm": (_LENGTH, "1/1000", 0),
    "um": (_LENGTH, "1/1000000", 0),
    "in": (_LENGTH, "0.0254", 0),
    "kg": (_MASS, "1", 0),
    "g": (_MASS, "1/1000", 0),
    "s": (_TIME, "1", 0),
    "ms": (_TIME, "1/1000", 0),
    "us": (_TIME, "1/1000000", 0),
    "ns": (_TIME, "1/1000000000", 0),
    "min": (_TIME, "60", 0),
    "h": (_TIME, "3600", 0),
    "Hz": (_FREQUENCY, "1", 0),
    "kHz": (_FREQUENCY, "1000", 0),
    "MHz": (_FREQUENCY, "1000000", 0),
    "rad": (_ANGLE, "1", 0),
    "mrad": (_ANGLE, "1/1000", 0),
    "deg": (_ANGLE, "1/180", 1),
    "arcmin": (_ANGLE, "1/10800", 1),
    "rev": (_ANGLE, "2", 1),
    "turn": (_ANGLE, "2", 1),
    "rpm": (_SPEED, "1/30", 1),
    "krpm": (_SPEED, "1000/30", 1),
    "N": (_FORCE, "1", 0),
    "mN": (_FORCE, "1/1000", 0),
    "kN": (_FORCE, "1000", 0),
    "lbf": (_FORCE, _POUND, 0),
    "kgf": (_FORCE, "9.80665", 0),
    "Nm": (_ENERGY, "1", 0),
    "Pa": (_PRESSURE, "1", 0),
    "MPa": (_PRESSURE, "1000000", 0),
    "GPa": (_PRESSURE, "1000000000", 0),
    "bar": (_PRESSURE, "100000", 0),
    "J": (_ENERGY, "1", 0),
    "kJ": (_ENERGY, "1000", 0),
    "W": (_POWER, "1", 0),
    "mW": (_POWER, "1/1000", 0),
    "kW": (_POWER, "1000", 0),
    "A": (_CURRENT, "1", 0),
    "mA": (_CURRENT, "1/1000", 0),
    "V": (_VOLTAGE, "1", 0),
    "mV": (_VOLTAGE, "1/1000", 0),
    "kV": (_VOLTAGE, "1000", 0),
    "ohm": (_RESISTANCE, "1", 0),
    "mohm": (_RESISTANCE, "1/1000", 0),
    "kohm": (_RESISTANCE, "1000", 0),
    "H": (_INDUCTANCE, "1", 0),
    "mH": (_INDUCTANCE, "1/1000", 0),
    "uH": (_INDUCTANCE, "1/1000000", 0),
    "F": (_CAPACITANCE, "1", 0),
    "uF": (_CAPACITANCE, "1/1000000", 0),
    "Wb": (_FLUX, "1", 0),
    "K": (_TEMPERATURE, "1", 0),
    "degC": (_TEMPERATURE, "1", 0),
    "degF": (_TEMPERATURE, "5/9", 0),
}
_OFFSETS = {"degC": Fraction("273.15"), "degF": Fraction("459.67") * Fraction(5, 9)}

KINDS: tuple[tuple[str, str], ...] = (
    ("dimensionless", "1"),
    ("an angle", "rad"),
    ("a length", "m"),
    ("an area", "m2"),
    ("a mass", "kg"),
    ("a time", "s"),
    ("a time squared", "s2"),
    ("a frequency or gain", "1/s"),
    ("an angular speed", "rad/s"),
    ("an angular acceleration", "rad/s2"),
    ("an angular jerk", "rad/s3"),
    ("a speed", "m/s"),
    ("an acceleration", "m/s2"),
    ("an inertia", "kg m2"),
    ("a force", "N"),
    ("a torque or energy", "N m"),
    ("a stiffness", "N/m"),
    ("a torsional stiffness", "N m/rad"),
    ("a viscous damping", "N s/m"),
    ("a torsional viscous damping", "N m s/rad"),
    ("a torque per angular speed squared", "N m s2/rad2"),
    ("a torque per angular speed cubed", "N m s3/rad3"),
    ("a pressure", "Pa"),
    ("a power or torque rate", "W"),
    ("a current", "A"),
    ("a current rate", "A/s"),
    ("a voltage", "V"),
    ("a resistance", "ohm"),
    ("an inductance", "H"),
    ("a capacitance", "F"),
    ("an electric charge", "A s"),
    ("a voltage constant", "V s/rad"),
    ("a magnetic flux or torque constant", "N m/A"),
    ("a transmission ratio", "rad/m"),
    ("a lead", "m/rad"),
    ("a temperature", "K"),
    ("a temperature coefficient", "1/K"),
    ("a thermal conductance", "W/K"),
    ("a thermal resistance", "K/W"),
    ("a heat capacity", "J/K"),
)

_PRODUCTS = ("kg cm2", "g cm2", "N/mm", "lbf in", "deg/s", "deg/s2", "mm/s", "mm/rev", "V/krpm")
_SAME = str.maketrans(
    {"°": "deg", "\u2126": "ohm", "\u03a9": "ohm", "\u00b5": "u", "\u03bc": "u"}
    | {"·": " ", "⋅": " ", "*": " ", "−": "-"}
    | dict(zip("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789", strict=True))
)
_FACTOR = re.compile(r"([A-Za-z_%]+|1)\^?(-?[1-9])?")
_LONGEST = 60
_NO_UNITS = frozenset({"pi", "c", "e", "k", "R", "G", "a", "b", "u", "D", "tansec", "ln10"})
"""Constants and rare units of one letter that pint would read into a slip of the pen."""


def unit_names() -> list[str]:
    """Return the symbols of the table and some products of them."""
    return [*_SYMBOLS, *(unit for _, unit in KINDS if unit not in _SYMBOLS), *_PRODUCTS]


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
    factors = [(plain, 1)] if plain in _SYMBOLS else _factors(plain, text, at)
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
    if name in _SYMBOLS:
        dimension, scale, pi = _SYMBOLS[name]
        return Unit(name, dimension, Fraction(scale), pi, _OFFSETS.get(name, Fraction(0)))
    unit = None if name in _NO_UNITS else _from_pint(name)
    if unit is None:
        near = did_you_mean(text, unit_names()) if nearest(text, unit_names()) else ""
        which = f" (symbol {name!r})" if name != text else ""
        raise UnitError(f"{at}unknown unit {text!r}{which}{near or did_you_mean(name, _SYMBOLS)}")
    return unit


@cache
def _registry() -> Any:
    import pint

    registry = pint.UnitRegistry(on_redefinition="ignore", cache_folder=None)
    registry.define("radian = [angle] = rad")
    registry._build_cache()  # degrees and turns follow the radian only once this is done again
    return registry


_PINT_DIMENSIONS = ("[length]", "[mass]", "[time]", "[current]", "[temperature]", "[angle]")


@lru_cache(maxsize=256)
def _from_pint(name: str) -> Unit | None:
    """Look one symbol up in pint; None when it is unknown or no plain unit (a decibel)."""
    import pint

    registry = _registry()
    try:
        unit = registry.Unit(name)
        powers = dict(unit.dimensionality)
        base = registry.Quantity(1, unit).to_base_units().units
        start, one, two = (registry.Quantity(x, unit).to(base).magnitude for x in (0.0, 1.0, 2.0))
    except (pint.errors.PintError, ValueError, AttributeError, TypeError, KeyError):
        return None
    length, mass, time, current, temperature, angle = (
        int(powers.pop(key, 0)) for key in _PINT_DIMENSIONS
    )
    if powers or not math.isclose(two - one, one - start, rel_tol=1e-12):
        return None
    dimension = (length, mass, time, current, temperature, angle)
    return Unit(name, dimension, Fraction(one - start), 0, Fraction(start))
