"""Parts of the fault grammar that faults and their profiles share."""

from __future__ import annotations

from collections.abc import Iterable

from elevon.errors import InputError


def pairs(text: str, place: str) -> dict[str, str]:
    """Read ``name=value,name=value``; raise `InputError` naming the part that is not so."""
    values: dict[str, str] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, equals, value = part.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise InputError(f"{place}: {part!r} is not of the form name=value")
        if name.strip() in values:
            raise InputError(f"{place}: {name.strip()!r} is given twice")
        values[name.strip()] = value.strip()
    return values


def numbers(given: object, place: str) -> tuple[float, ...]:
    """Read a sequence of numbers, or a text of numbers separated by semicolons."""
    items = [part.strip() for part in given.split(";")] if isinstance(given, str) else given
    if not isinstance(items, Iterable):
        raise InputError(f"{place}: {given!r} is not a list of numbers")
    try:
        return tuple(float(item) for item in items)
    except (TypeError, ValueError) as error:
        raise InputError(f"{place}: {given!r} is not a list of numbers") from error
