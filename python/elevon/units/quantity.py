"""Reading, converting and showing quantities."""

import math
import re
from fractions import Fraction
from typing import overload

import numpy as np
import numpy.typing as npt

from elevon.errors import InputError, RangeError, UnitError
from elevon.units.unit import DISPLAY, KINDS, Unit, parse_unit, unit_names

_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\d.,])\s*(.*?)\s*", re.S)
_LONGEST = 100


def split_quantity(text: str) -> tuple[str, str] | None:
    """Return the number and the unit of a text such as ``"45 deg"``; None where it is none."""
    match = _NUMBER.fullmatch(text) if len(text) <= _LONGEST else None
    return None if match is None else (match[1], match[2])


def parse_quantity(
    text: str | float, kind: str, place: str | None = None, display_unit: str | None = None
) -> float:
    """Read a quantity such as ``"45 deg"`` as an SI float.

    Parameters
    ----------
    text : str, int or float
        A number, or a number and a unit. A number alone is in the unit `kind`.
    kind : str
        The unit the place expects, such as ``"rad"``, ``"kg m2"``, ``"1"``; any unit of the same
        kind is accepted.
    place : str, optional
        Where the quantity stands (``motor.inertia``); named in the errors.
    display_unit : str, optional
        The unit in which a person reads the place. Where it is not `kind` itself, a text without
        a unit could mean either and is refused; a number is never.

    Returns
    -------
    float
        The value in SI units (angles in rad, temperatures in K).

    Raises
    ------
    UnitError
        Unknown unit (with the nearest names), a unit of another kind, or none where it needs one.
    RangeError
        NaN, infinite, or too large for a float.
    InputError
        Not a number.

    Examples
    --------
    >>> parse_quantity("7.7 kg cm2", "kg m2")
    0.00077
    >>> parse_quantity("20 degC", "K")
    293.15
    """
    expected = parse_unit(kind)
    if not isinstance(text, str):
        return expected.to_si(_finite(_real(text, place), place))
    parts = split_quantity(text)
    if parts is None:
        raise _not_a_quantity(text, kind, place)
    number, unit_text = parts
    unit = check_kind(unit_text, kind, place) if unit_text else expected
    if not unit_text and display_unit and is_ambiguous(float(number), kind, display_unit):
        raise ambiguous(number, kind, display_unit, place)
    _finite(float(number), place, written=number)
    return _finite(_exact_si(number, unit), place, written=text)


def is_ambiguous(number: float, kind: str, display_unit: str) -> bool:
    """Tell whether a number without a unit means different things in two units.

    Zero means the same in every unit but those of temperature.
    """
    own_unit, other = parse_unit(kind), parse_unit(display_unit)
    same = (own_unit.scale, own_unit.pi, own_unit.offset) == (other.scale, other.pi, other.offset)
    if same or not math.isfinite(number):
        return False
    return number != 0.0 or own_unit.offset != other.offset


def ambiguous(number: str, kind: str, display_unit: str, place: str | None = None) -> UnitError:
    """Return the error of a number without a unit, with both of its readings."""
    readings = [
        f"'{number} {unit}' ({format_quantity(parse_unit(unit).to_si(float(number)), other)})"
        for unit, other in ((display_unit, kind), (kind, display_unit))
    ]
    return UnitError(f"{_at(place)}{number} has no unit; write {' or '.join(readings)}")


def check_kind(unit_text: str, kind: str, place: str | None = None) -> Unit:
    """Read a unit and check that it is of the same kind as another.

    Parameters
    ----------
    unit_text : str
        The unit as given.
    kind : str
        The expected unit.
    place : str, optional
        Named in the error.

    Returns
    -------
    Unit
        The unit read.

    Raises
    ------
    UnitError
        Unknown unit, or one of another kind.
    """
    expected = parse_unit(kind)
    try:
        unit = parse_unit(unit_text, place)
    except UnitError as error:
        raise UnitError(f"{error} (expected {kind_name(kind)}, in {kind} or the like)") from error
    if unit.dimension != expected.dimension:
        hint = " (a temperature is written 'degC')" if unit_text == "C" else ""
        raise UnitError(
            f"{_at(place)}unit {unit_text!r} is {kind_name(unit_text)}, "
            f"expected {kind_name(kind)} ({kind}){hint}"
        )
    return unit


def kind_name(unit_text: str) -> str:
    """Return what a unit measures, in words: ``"an inertia"`` for ``"kg cm2"``."""
    dimension = parse_unit(unit_text).dimension
    for name, example in KINDS:
        if parse_unit(example).dimension == dimension:
            return name
    return "another quantity"


def si_unit(unit_text: str) -> str:
    """Return the SI unit of the same kind: ``"rad/s"`` for ``"rpm"``."""
    dimension = parse_unit(unit_text).dimension
    for _, example in KINDS:
        if parse_unit(example).dimension == dimension:
            return example
    symbols = zip(("m", "kg", "s", "A", "K", "rad"), dimension, strict=True)
    return " ".join(f"{name}{power if power != 1 else ''}" for name, power in symbols if power)


def display_unit(unit: str) -> str:
    """Return the unit in which a person reads an SI quantity: ``"deg"`` for ``"rad"``."""
    return DISPLAY.get(unit, unit)


@overload
def convert(values: float, source: str, target: str) -> float: ...
@overload
def convert(values: npt.ArrayLike, source: str, target: str) -> npt.NDArray[np.float64]: ...
def convert(
    values: float | npt.ArrayLike, source: str, target: str
) -> float | npt.NDArray[np.float64]:
    """Convert values from one unit to another of the same kind.

    Parameters
    ----------
    values : float or array_like, any shape
        Values in `source`. NaN passes through: it marks a missing sample.
    source, target : str
        Units.

    Returns
    -------
    float or ndarray of the same shape
        Values in `target`.

    Raises
    ------
    UnitError
        Unknown units, or units of different kinds.
    """
    unit = check_kind(source, target)
    if source == target:
        return values if isinstance(values, float) else np.array(values, dtype=np.float64)
    result = parse_unit(target).from_si(unit.to_si(np.asarray(values, dtype=np.float64)))
    return float(result) if np.ndim(values) == 0 else np.asarray(result, dtype=np.float64)


def to_si(values: npt.ArrayLike, unit: str) -> npt.NDArray[np.float64]:
    """Return values given in `unit` as SI values; shape kept, NaN passes through."""
    result = parse_unit(unit).to_si(np.asarray(values, dtype=np.float64))
    return np.asarray(result, dtype=np.float64)


@overload
def to_display(values: float, unit: str) -> float: ...
@overload
def to_display(values: npt.ArrayLike, unit: str) -> npt.NDArray[np.float64]: ...
def to_display(values: float | npt.ArrayLike, unit: str) -> float | npt.NDArray[np.float64]:
    """Return SI values in the unit they are shown in; shape kept, NaN passes through."""
    result = parse_unit(unit).from_si(np.asarray(values, dtype=np.float64))
    return float(result) if np.ndim(values) == 0 else np.asarray(result, dtype=np.float64)


def format_quantity(value: float, unit: str, digits: int = 6) -> str:
    """Return an SI value as text in `unit`: ``format_quantity(0.00077, "kg cm2")``.

    Returns
    -------
    str
        Such as ``"7.7 kg cm2"``; the unit ``"1"`` is not written. A value too large for a float
        in that unit is given in SI.
    """
    with np.errstate(over="ignore"):
        displayed = to_display(float(value), unit)
    if math.isinf(displayed) and math.isfinite(value):
        return f"{value:.{digits}g} (SI)"
    number = f"{displayed:.{digits}g}"
    return number if unit in {"", "1"} else f"{number} {unit}"


def _exact_si(number: str, unit: Unit) -> float:
    """Combine decimal text with a decimal unit without rounding twice."""
    value = float(number)
    if not 1e-200 < abs(value) < 1e200:
        return unit.to_si(value)
    exact = float(Fraction(number) * unit.scale + unit.offset)
    return exact * math.pi**unit.pi if unit.pi else exact


def _real(value: float, place: str | None) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InputError(f"{_at(place)}{value!r} is not a number or a text with a number and unit")
    try:
        return float(value)
    except OverflowError as error:
        raise RangeError(f"{_at(place)}the value is too large for a float") from error


def _finite(value: float, place: str | None, written: str | None = None) -> float:
    if not math.isfinite(value):
        raise RangeError(f"{_at(place)}{written or value} is not a finite number")
    return value


def _not_a_quantity(text: str, kind: str, place: str | None) -> InputError:
    word = text.strip().split(" ")[0].lower().lstrip("+-")
    if word in {"nan", "inf", "infinity"}:
        return RangeError(f"{_at(place)}{text.strip()} is not a finite number")
    example = f"45 {kind}" if kind not in {"", "1"} else "0.5"
    cut = text if len(text) <= _LONGEST else text[:40] + "..."
    return InputError(f"{_at(place)}{cut!r} is not a number with a unit; write it like {example!r}")


def _at(place: str | None) -> str:
    return f"{place}: " if place else ""


def known_units(kind: str | None = None) -> list[str]:
    """Return the units of the table, all or those of one kind.

    Parameters
    ----------
    kind : str, optional
        A unit; only units that can stand in its place are returned.

    Returns
    -------
    list of str
        Symbols and common products.
    """
    if kind is None:
        return unit_names()
    dimension = parse_unit(kind).dimension
    return [name for name in unit_names() if parse_unit(name).dimension == dimension]
