"""Numbers as a person reads them: in a unit of the shop floor, with as many digits as they bear."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from elevon.units import check_kind, display_unit, to_display

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.estimate import Estimate

_DIGITS = 5
"""Significant digits of a number whose interval is not known."""
_SMALL, _LARGE = 1e-3, 1e7
"""Beyond these decimals would be mostly zeros: powers of ten."""
_OF_INTERVAL = 2
"""Significant digits of an interval's width: more would only show chance."""


def interval_texts(value: float, low: float, high: float) -> tuple[str, str, str]:
    """Return a value and its interval with the digits that the interval supports.

    Returns
    -------
    tuple of str
        Value, low and high, all to the same decimal place.
    """
    numbers = (value, low, high)
    width = high - low
    if not all(math.isfinite(x) for x in numbers) or width <= 0.0:
        return _plain(value), _plain(low), _plain(high)
    place = _OF_INTERVAL - 1 - math.floor(math.log10(width))
    largest = max(abs(x) for x in numbers)
    if largest < _SMALL or largest >= _LARGE:
        digits = max(place + math.floor(math.log10(largest)), 0)
        value_, low_, high_ = (f"{x:.{digits}e}" for x in numbers)
        return value_, low_, high_
    # Plus zero: what rounds to nothing has no sign.
    value_, low_, high_ = (f"{round(x, place) + 0.0:.{max(place, 0)}f}" for x in numbers)
    return value_, low_, high_


def estimate_texts(
    value: float, interval: tuple[float, float], unit: str, written: str = ""
) -> tuple[str, str, str, str]:
    """Return value, low, high and unit of an estimate in the unit a person reads.

    Parameters
    ----------
    value : float
        In `unit`.
    interval : tuple of float
        Low and high, in `unit`.
    unit : str
        Of the SI.
    written : str, optional
        The unit in which the actuator file gives the parameter, which is preferred.
    """
    display = written or display_unit(unit)
    check_kind(display, unit)
    value_, low, high = (float(to_display(x, display)) for x in (value, *interval))
    return (*interval_texts(value_, low, high), "" if display == "1" else display)


def estimate_row(item: Estimate, actuator: Actuator, *more: str) -> tuple[str, ...]:
    """Return a calibration's row: parameter, before, after, low, high, unit, more, holds for."""
    unit = written_unit(actuator, item.path)
    value, low, high, display = estimate_texts(item.value, item.interval, item.unit, unit)
    old = "" if item.old is None else _plain(float(to_display(item.old, display or "1")))
    return (item.path, old, value, low, high, display, *more, ", ".join(item.given))


def count_text(value: float, digits: int = 4) -> str:
    """Return hours, flights or cycles as text: no power of ten below a million millions."""
    if not 1e4 <= abs(value) < 1e12:
        return f"{value:.{digits}g}"
    return f"{float(f'{value:.{digits}g}'):,.0f}"


def severity_texts(value: float, interval: tuple[float, float], unit: str) -> tuple[str, str, str]:
    """Return a severity and its interval as a person writes it: angles in deg, shares in %."""
    display = "%" if unit == "1" else display_unit(unit)
    texts = interval_texts(*(float(to_display(x, display)) for x in (value, *interval)))
    first, low, high = (f"{text} {display}" for text in texts)
    return first, low, high


def written_unit(actuator: Actuator, path: str) -> str:
    """Return the unit in which an actuator file gives a parameter; empty where it has none."""
    item = actuator.parameters.get(path)
    return "" if item is None else item.unit


def quantity_text(value: float, unit: str, digits: int = _DIGITS) -> tuple[str, str]:
    """Return an SI difference or size as text, and the unit in which a person reads it.

    A temperature stays in K: a difference has no zero to be counted from.
    """
    display = unit if unit in {"", "1", "K"} else display_unit(unit)
    return (
        f"{float(to_display(value, display or '1')):.{digits}g}",
        "" if display == "1" else display,
    )


def _plain(value: float) -> str:
    return f"{value:.{_DIGITS}g}"
