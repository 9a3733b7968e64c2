"""The symbols of units: what actuator people write, and the prefixes that go with them."""

from __future__ import annotations

from fractions import Fraction

Dimension = tuple[int, int, int, int, int, int]
"""Exponents of length, mass, time, current, temperature, angle."""

_NONE: Dimension = (0, 0, 0, 0, 0, 0)
_LENGTH: Dimension = (1, 0, 0, 0, 0, 0)
_MASS: Dimension = (0, 1, 0, 0, 0, 0)
_TIME: Dimension = (0, 0, 1, 0, 0, 0)
_CURRENT: Dimension = (0, 0, 0, 1, 0, 0)
_TEMPERATURE: Dimension = (0, 0, 0, 0, 1, 0)
_VOLUME: Dimension = (3, 0, 0, 0, 0, 0)
_VELOCITY: Dimension = (1, 0, -1, 0, 0, 0)
_ACCELERATION: Dimension = (1, 0, -2, 0, 0, 0)
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
_FLUX_DENSITY: Dimension = (0, 1, -2, -1, 0, 0)
_CHARGE: Dimension = (0, 0, 1, 1, 0, 0)
_CONDUCTANCE: Dimension = (-2, -1, 3, 2, 0, 0)


Record = tuple[Dimension, str, int]
"""Dimension, rational part of the size in SI units, power of pi in it."""

_POUND = Fraction("0.45359237")  # lb in kg, exact by definition
_GRAVITY = Fraction("9.80665")  # standard gravity in m/s2, exact by definition
_POUND_FORCE = _POUND * _GRAVITY
_INCH = Fraction("0.0254")
_FOOT = 12 * _INCH

PREFIXED: dict[str, Record] = {
    "m": (_LENGTH, "1", 0),
    "g": (_MASS, "1/1000", 0),
    "s": (_TIME, "1", 0),
    "Hz": (_FREQUENCY, "1", 0),
    "rad": (_ANGLE, "1", 0),
    "N": (_FORCE, "1", 0),
    "Nm": (_ENERGY, "1", 0),
    "Pa": (_PRESSURE, "1", 0),
    "bar": (_PRESSURE, "100000", 0),
    "J": (_ENERGY, "1", 0),
    "Wh": (_ENERGY, "3600", 0),
    "W": (_POWER, "1", 0),
    "VA": (_POWER, "1", 0),
    "A": (_CURRENT, "1", 0),
    "C": (_CHARGE, "1", 0),
    "Ah": (_CHARGE, "3600", 0),
    "V": (_VOLTAGE, "1", 0),
    "ohm": (_RESISTANCE, "1", 0),
    "S": (_CONDUCTANCE, "1", 0),
    "H": (_INDUCTANCE, "1", 0),
    "F": (_CAPACITANCE, "1", 0),
    "Wb": (_FLUX, "1", 0),
    "T": (_FLUX_DENSITY, "1", 0),
    "K": (_TEMPERATURE, "1", 0),
    "cal": (_ENERGY, "4.184", 0),
}
"""Symbols that stand with and without a prefix."""

PREFIXES = {"p": -12, "n": -9, "u": -6, "m": -3, "k": 3, "M": 6, "G": 9}
"""Powers of ten; centi, deci, hecto and deca only where people write them (`SYMBOLS`)."""

SYMBOLS: dict[str, Record] = {
    **PREFIXED,
    "1": (_NONE, "1", 0),
    "%": (_NONE, "1/100", 0),
    "ppm": (_NONE, "1/1000000", 0),
    "cm": (_LENGTH, "1/100", 0),
    "dm": (_LENGTH, "1/10", 0),
    "in": (_LENGTH, str(_INCH), 0),
    "ft": (_LENGTH, str(_FOOT), 0),
    "yd": (_LENGTH, str(3 * _FOOT), 0),
    "mi": (_LENGTH, str(5280 * _FOOT), 0),
    "thou": (_LENGTH, str(_INCH / 1000), 0),
    "nmi": (_LENGTH, "1852", 0),
    "l": (_VOLUME, "1/1000", 0),
    "t": (_MASS, "1000", 0),
    "lb": (_MASS, str(_POUND), 0),
    "lbm": (_MASS, str(_POUND), 0),
    "oz": (_MASS, str(_POUND / 16), 0),
    "slug": (_MASS, str(_POUND_FORCE / _FOOT), 0),
    "min": (_TIME, "60", 0),
    "h": (_TIME, "3600", 0),
    "hr": (_TIME, "3600", 0),
    "day": (_TIME, "86400", 0),
    "deg": (_ANGLE, "1/180", 1),
    "grad": (_ANGLE, "1/200", 1),
    "arcmin": (_ANGLE, "1/10800", 1),
    "arcsec": (_ANGLE, "1/648000", 1),
    "rev": (_ANGLE, "2", 1),
    "turn": (_ANGLE, "2", 1),
    "cycle": (_ANGLE, "2", 1),
    "rpm": (_SPEED, "1/30", 1),
    "rps": (_SPEED, "2", 1),
    "krpm": (_SPEED, "1000/30", 1),
    "knot": (_VELOCITY, "1852/3600", 0),
    "kt": (_VELOCITY, "1852/3600", 0),
    "mph": (_VELOCITY, str(5280 * _FOOT / 3600), 0),
    "kph": (_VELOCITY, "1000/3600", 0),
    "gn": (_ACCELERATION, str(_GRAVITY), 0),
    "daN": (_FORCE, "10", 0),
    "dyn": (_FORCE, "1/100000", 0),
    "lbf": (_FORCE, str(_POUND_FORCE), 0),
    "klbf": (_FORCE, str(1000 * _POUND_FORCE), 0),
    "kip": (_FORCE, str(1000 * _POUND_FORCE), 0),
    "ozf": (_FORCE, str(_POUND_FORCE / 16), 0),
    "kgf": (_FORCE, str(_GRAVITY), 0),
    "gf": (_FORCE, str(_GRAVITY / 1000), 0),
    "kp": (_FORCE, str(_GRAVITY), 0),
    "Ncm": (_ENERGY, "1/100", 0),
    "erg": (_ENERGY, "1/10000000", 0),
    "BTU": (_ENERGY, "1055.056", 0),
    "hp": (_POWER, str(550 * _FOOT * _POUND_FORCE), 0),
    "PS": (_POWER, str(75 * _GRAVITY), 0),
    "hPa": (_PRESSURE, "100", 0),
    "psi": (_PRESSURE, str(_POUND_FORCE / _INCH**2), 0),
    "ksi": (_PRESSURE, str(1000 * _POUND_FORCE / _INCH**2), 0),
    "atm": (_PRESSURE, "101325", 0),
    "torr": (_PRESSURE, "101325/760", 0),
    "mmHg": (_PRESSURE, "133.322387415", 0),
    "inHg": (_PRESSURE, str(Fraction("133.322387415") * Fraction("25.4")), 0),
    "degC": (_TEMPERATURE, "1", 0),
    "degF": (_TEMPERATURE, "5/9", 0),
    "degR": (_TEMPERATURE, "5/9", 0),
}
"""Every symbol without a prefix: dimension, size, power of pi."""

OFFSETS = {"degC": Fraction("273.15"), "degF": Fraction("459.67") * Fraction(5, 9)}

WORDS = {
    "cycle": "cycle", "day": "day", "knot": "knot", "slug": "slug", "turn": "turn",
    "amp": "A", "ampere": "A", "celsius": "degC", "centimeter": "cm", "centimetre": "cm",
    "coulomb": "C", "degree": "deg", "fahrenheit": "degF", "farad": "F", "feet": "ft",
    "foot": "ft", "gram": "g", "gramme": "g", "henry": "H", "hertz": "Hz", "horsepower": "hp",
    "hour": "h", "inch": "in", "inches": "in", "joule": "J", "kelvin": "K", "kilogram": "kg",
    "kilometer": "km", "kilometre": "km", "kilonewton": "kN", "kilowatt": "kW", "liter": "l",
    "litre": "l", "meter": "m", "metre": "m", "micrometer": "um", "micrometre": "um",
    "microsecond": "us", "mile": "mi", "milliamp": "mA", "milliampere": "mA", "millimeter": "mm",
    "millimetre": "mm", "millisecond": "ms", "millivolt": "mV", "minute": "min", "msec": "ms",
    "newton": "N", "ounce": "oz", "pascal": "Pa", "percent": "%", "pound": "lb", "radian": "rad",
    "revolution": "rev", "sec": "s", "second": "s", "siemens": "S", "tesla": "T", "usec": "us",
    "volt": "V", "watt": "W", "weber": "Wb",
}  # fmt: skip
"""Units written as words, also with an s behind."""

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
