"""Records as the types of JSON: written from their annotated fields, and read back."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import reduce
from typing import Any, ClassVar, Self, cast, get_args

import numpy as np

from elevon.plain.fields import slots_of
from elevon.plain.read import arguments


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
        return cls(**arguments(cls, data, place or cls.__name__))


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


def fields_of(record: object, *names: str, **renamed: str) -> dict[str, Any]:
    """Return fields of a record as JSON's types, some under another key: ``key=field``.

    A field of a field is named by dots; it is None where there is nothing that could have it.
    """
    split = (name.partition("=") for name in names)
    keys = {key: path or key for key, _, path in split} | renamed
    return {key: plain(reduce(_field, path.split("."), record)) for key, path in keys.items()}


def _field(record: Any, name: str) -> Any:
    if record is None:
        return None
    return record[name] if isinstance(record, Mapping) else getattr(record, name)


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
    for slot in slots_of(cast(Any, type(record))):
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
    for slot in slots_of(cls):
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
        for slot in slots_of(cls)
        for name in slot.keys
        if slot.kind != "working" and not slot.remainder
    }
    return frozenset(names | {item.partition("=")[0] for item in getattr(cls, "COMPUTED", ())})


def _records(kind: object) -> Iterator[type]:
    if isinstance(kind, type) and issubclass(kind, Plain) and not hasattr(kind, "KIND"):
        yield kind  # a result within a result states its own units
    for part in get_args(kind):
        yield from _records(part)


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
