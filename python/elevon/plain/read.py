"""Records from the types of JSON: each value is what its field says, or is refused."""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from elevon.errors import FormatError, did_you_mean
from elevon.plain.fields import slots_of


def arguments(cls: type, data: object, place: str) -> dict[str, Any]:
    """Return the arguments of a record's class from its JSON form."""
    if not isinstance(data, Mapping):
        raise FormatError(f"{place} = {data!r} is not a table of keys")
    slots = [slot for slot in slots_of(cls) if slot.kind != "working"]
    for slot in slots_of(cls):
        if slot.kind == "working" and not slot.optional:
            raise TypeError(f"{slot.name}: a working field of what is read back needs a default")
    known = [item.partition("=")[0] for item in getattr(cls, "COMPUTED", ())]
    known += [name.partition(".")[0] for slot in slots if not slot.remainder for name in slot.keys]
    more = {name: value for name, value in data.items() if name not in known}
    out: dict[str, Any] = {slot.name: _anything(more) for slot in slots if slot.remainder}
    for name in () if out else more:
        hint = did_you_mean(name, sorted(known))
        raise FormatError(f"{place}: unknown key {name!r}{hint}")
    for slot in [slot for slot in slots if not slot.remainder]:
        given = [_under(data, name) for name in slot.keys]
        if MISSING not in given:
            value = given[0] if len(given) == 1 else None if None in given else given
            out[slot.name] = read_plain(slot.type, value, f"{place}: {slot.keys[0]}")
        elif not slot.optional:
            raise FormatError(f"{place}: {slot.keys[given.index(MISSING)]!r} is missing")
    return out


def _under(data: object, name: str) -> object:
    for word in name.split("."):
        if not isinstance(data, Mapping) or word not in data:
            return MISSING
        data = data[word]
    return data


def read_plain(kind: Any, value: Any, place: str) -> Any:
    """Return a value of JSON as what a type says.

    Raises
    ------
    FormatError
        A value of another type.
    """
    origin = get_origin(kind)
    if kind in (Any, object):
        return _anything(value)
    if kind in _SIMPLE:
        return _SIMPLE[kind](value, place)
    if origin is not None:
        return _generic(kind, origin, value, place)
    if hasattr(kind, "from_dict"):
        return kind.from_dict(_mapping(value, place), place)
    if hasattr(kind, "_fields"):
        return kind(**_members(kind, value, place))
    if not is_dataclass(kind):
        raise TypeError(f"{place}: {kind!r} has no form in JSON")
    made: Any = kind
    return made(**arguments(made, value, place))


def _generic(kind: Any, origin: Any, value: Any, place: str) -> Any:
    if origin is Annotated:
        return read_plain(get_args(kind)[0], value, place)
    if origin is Literal:
        return _checked(value, value in get_args(kind), place, f"one of {get_args(kind)}")
    if origin in (Union, types.UnionType):
        return _one_of(get_args(kind), value, place)
    return _collected(kind, origin, value, place)


def _one_of(kinds: Sequence[Any], value: Any, place: str) -> Any:
    if value is None and type(None) in kinds:
        return None
    kinds = [kind for kind in kinds if kind is not type(None)]
    for kind in kinds[:-1]:
        try:
            return read_plain(kind, value, place)
        except FormatError:
            continue
    return read_plain(kinds[-1], value, place)


def _collected(kind: Any, origin: Any, value: Any, place: str) -> Any:
    parts = get_args(kind)
    if origin is np.ndarray:
        return _array(get_args(parts[1])[0], value, place)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {
            name: read_plain(parts[1], item, f"{place}.{name}")
            for name, item in _mapping(value, place).items()
        }
    _checked(value, isinstance(value, (list, tuple)), place, "a list")
    if origin is tuple and parts[-1] is not ...:
        _checked(value, len(value) == len(parts), place, f"{len(parts)} entries")
        pairs = zip(parts, value, strict=True)
        return tuple(read_plain(part, item, place) for part, item in pairs)
    items = [read_plain(parts[0], item, f"{place}[{k}]") for k, item in enumerate(value)]
    return items if origin is list else frozenset(items) if origin is frozenset else tuple(items)


def _array(dtype: Any, value: Any, place: str) -> Any:
    try:
        if isinstance(value, Mapping):
            return np.asarray(value["real"], float) + 1j * np.asarray(value["imag"], float)
        return np.asarray(value, dtype=dtype)
    except (TypeError, ValueError, LookupError) as error:
        raise FormatError(f"{place}: {error}") from error


def _members(kind: Any, value: Any, place: str) -> dict[str, Any]:
    data = _mapping(value, place)
    hints = get_type_hints(kind)
    if data.keys() != hints.keys():
        raise FormatError(f"{place}: the keys must be {', '.join(hints)}")
    return {name: read_plain(hints[name], data[name], f"{place}.{name}") for name in hints}


def _mapping(value: Any, place: str) -> Mapping[str, Any]:
    return _checked(value, isinstance(value, Mapping), place, "a table of keys")  # type: ignore[no-any-return]


def _checked(value: Any, right: bool, place: str, what: str) -> Any:
    if not right:
        raise FormatError(f"{place} = {value!r} is not {what}")
    return value


def _anything(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _anything(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_anything(item) for item in value]
    return float(value) if isinstance(value, str) and value in _WORDS else value


_WORDS = ("NaN", "Infinity", "-Infinity")


def _number(value: Any, place: str) -> float:
    """A number; what JSON cannot write, a file has as a word, and a command prints as null."""
    if value is None:
        return math.nan
    if isinstance(value, str) and value in _WORDS:
        return float(value)
    right = isinstance(value, (int, float)) and not isinstance(value, bool)
    try:
        return float(_checked(value, right, place, "a number"))
    except OverflowError as error:
        raise FormatError(f"{place}: {error}") from error


def _whole(value: Any, place: str) -> Any:
    right = isinstance(value, int) and not isinstance(value, bool)
    return _checked(value, right, place, "a whole number")


_SIMPLE: dict[Any, Callable[[Any, str], Any]] = {
    float: _number,
    int: _whole,
    bool: lambda value, place: _checked(value, isinstance(value, bool), place, "true or false"),
    str: lambda value, place: _checked(value, isinstance(value, str), place, "a text"),
    Path: lambda value, place: Path(_checked(value, isinstance(value, str), place, "a path")),
}
