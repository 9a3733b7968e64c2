"""Records as JSON's own types and back: one mechanism, driven by the annotated fields."""

from __future__ import annotations

import builtins
import math
import sys
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache, reduce
from inspect import get_annotations
from pathlib import Path
from typing import (
    Annotated,
    Any,
    ClassVar,
    Literal,
    Self,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np

from elevon.errors import FormatError, did_you_mean


@dataclass(frozen=True, slots=True)
class As:
    """How a field stands in JSON: ``value: Annotated[float, key("max"), in_unit("rad")]``.

    Attributes
    ----------
    keys : tuple of str
        Its key, if it is not the field's name; several share out the entries of a tuple, and one
        with dots stands in tables.
    unit : str
        SI unit, where the record has no field that states it.
    remainder : bool
        Whether it is a mapping whose own keys stand in its place.
    kind : str
        ``printed``; ``stored``: in files, not in what commands print; ``working``: nowhere, the
        field is known to the process that computed it only; read back, it has its default.
    """

    keys: tuple[str, ...] = ()
    unit: str = ""
    remainder: bool = False
    kind: Literal["printed", "stored", "working"] = "printed"


def key(*names: str) -> As:
    """Return the mark of a field whose key is not its name."""
    return As(keys=names)


def in_unit(text: str) -> As:
    """Return the mark of a number's unit."""
    return As(unit=text)


REMAINDER = As(remainder=True)
STORED = As(kind="stored")
WORKING = As(kind="working")


@dataclass(frozen=True, slots=True)
class _Slot:
    """One field of a record."""

    name: str
    type: object
    keys: tuple[str, ...]
    unit: str
    remainder: bool
    kind: str
    optional: bool


class Plain:
    """Base of a frozen dataclass that is written as JSON and read back.

    Fields are what is written. Properties named in ``COMPUTED`` (``key`` or ``key=property``) are
    written too, and computed anew.
    Two records are equal where their written fields are, NaN included.
    """

    COMPUTED: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **options: object) -> None:
        super().__init_subclass__(**options)
        cls.__eq__ = Plain.__eq__  # type: ignore[method-assign] # before a dataclass makes its own

    def __eq__(self, other: object) -> bool:
        if other.__class__ is not self.__class__:
            return NotImplemented
        return all(
            _same(getattr(self, item.name), getattr(other, item.name))
            for item in fields(self)  # type: ignore[arg-type] # every subclass is a dataclass
            if item.compare
        )

    __hash__ = None  # type: ignore[assignment] # a frozen dataclass makes its own

    def to_dict(self, *, stored: bool = True) -> dict[str, Any]:
        """Return the JSON form.

        Parameters
        ----------
        stored : bool
            Whether with all that `from_dict` needs, or with what commands print only.
        """
        data = _written(self, stored)
        for item in self.COMPUTED:
            name, _, source = item.partition("=")
            data[name] = plain(getattr(self, source or name), stored=stored)
        return data

    @classmethod
    def from_dict(cls, data: Mapping[str, object], place: str = "") -> Self:
        """Read the JSON form back.

        Raises
        ------
        FormatError
            A key that is missing or unknown, or a value of another type; place and key are named.
        """
        return cls(**_arguments(cls, data, place or cls.__name__))


def plain(value: object, *, stored: bool = True) -> Any:
    """Return a value as JSON's own types; numbers stay as they are, also where not finite."""
    if isinstance(value, (np.ndarray, np.generic)):
        if np.iscomplexobj(value):
            return {"real": value.real.tolist(), "imag": value.imag.tolist()}
        return value.tolist()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, (list, tuple, set, frozenset)) and not hasattr(value, "_asdict"):
        return [plain(item, stored=stored) for item in value]
    table = _as_table(value, stored)
    if table is None:
        return str(value)
    return {str(name): plain(item, stored=stored) for name, item in table.items()}


def _as_table(value: Any, stored: bool) -> Mapping[Any, Any] | None:
    if isinstance(value, Plain):
        return value.to_dict(stored=stored)
    if isinstance(value, Mapping) and not hasattr(value, "to_dict"):
        return value
    for method in ("to_dict", "_asdict"):
        if hasattr(value, method):
            return cast(Mapping[Any, Any], getattr(value, method)())
    return _written(value, stored) if is_dataclass(value) else None


def _written(record: object, stored: bool) -> dict[str, Any]:
    data: dict[str, Any] = {}
    for slot in _slots(cast(Any, type(record))):
        if slot.kind == "working" or (slot.kind == "stored" and not stored):
            continue
        value = plain(getattr(record, slot.name), stored=stored)
        if slot.remainder:
            data |= value
            continue
        values = [value] if len(slot.keys) == 1 else value or [None] * len(slot.keys)
        for name, part in zip(slot.keys, values, strict=True):
            *tables, last = name.split(".")
            reduce(lambda table, word: table.setdefault(word, {}), tables, data)[last] = part
    return data


def units_of(cls: type) -> dict[str, str]:
    """Return the unit of each key of a record that states one, those of its parts by dots."""
    out: dict[str, str] = {}
    for slot in _slots(cls):
        if slot.kind == "working":
            continue
        if slot.unit:
            out |= dict.fromkeys(slot.keys, slot.unit)
        for part in _records(slot.type):
            out |= {f"{slot.keys[0]}.{name}": text for name, text in units_of(part).items()}
    return out


def keys_of(cls: type) -> frozenset[str]:
    """Return the keys of a record's JSON, those of its parts left aside."""
    names = {
        name.partition(".")[0]
        for slot in _slots(cls)
        for name in slot.keys
        if slot.kind != "working" and not slot.remainder
    }
    return frozenset(names | {item.partition("=")[0] for item in getattr(cls, "COMPUTED", ())})


def _records(kind: object) -> Iterator[type]:
    if isinstance(kind, type) and issubclass(kind, Plain) and not hasattr(kind, "KIND"):
        yield kind  # a result within a result states its own units
    for part in get_args(kind):
        yield from _records(part)


class _Names(dict[str, object]):
    """Names of a module; one that is imported for the type checker alone stands for itself."""

    def __missing__(self, name: str) -> object:
        return vars(builtins).get(name, Any)


@cache
def _slots(cls: type) -> tuple[_Slot, ...]:
    hints: dict[str, object] = {}
    names = [item.name for item in fields(cls)]
    for base in reversed(cls.__mro__):
        named = {name: hint for name, hint in get_annotations(base).items() if name in names}
        notes = types.SimpleNamespace(__annotations__=named)
        known = vars(sys.modules[base.__module__])
        hints |= get_type_hints(notes, known, _Names(known), include_extras=True)
    return tuple(_slot(item, hints[item.name]) for item in fields(cls) if item.init)


def _slot(item: Any, hint: object) -> _Slot:
    marks = [mark for mark in get_args(hint)[1:] if isinstance(mark, As)]
    kind = next((mark.kind for mark in marks if mark.kind != "printed"), "printed")
    optional = not (item.default is MISSING and item.default_factory is MISSING)
    return _Slot(
        name=item.name,
        type=get_args(hint)[0] if get_origin(hint) is Annotated else hint,
        keys=next((mark.keys for mark in marks if mark.keys), (item.name,)),
        unit=next((mark.unit for mark in marks if mark.unit), ""),
        remainder=any(mark.remainder for mark in marks),
        kind=kind,
        optional=optional,
    )


def _arguments(cls: type, data: object, place: str) -> dict[str, Any]:
    if not isinstance(data, Mapping):
        raise FormatError(f"{place} = {data!r} is not a table of keys")
    slots = [slot for slot in _slots(cls) if slot.kind != "working"]
    for slot in _slots(cls):
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
    return made(**_arguments(made, value, place))


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


def _same(a: Any, b: Any) -> bool:
    """Whether two values say the same: lists as tuples, NaN as NaN, arrays entry by entry."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return bool(np.array_equal(a, b, equal_nan=np.asarray(a).dtype.kind in "fc"))
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_same(a[name], b[name]) for name in a)
    if isinstance(a, (list, tuple)) and isinstance(b, (list, tuple)):
        return len(a) == len(b) and all(map(_same, a, b))
    nan = isinstance(a, float) and isinstance(b, float) and math.isnan(a) and math.isnan(b)
    return nan or bool(a == b)
