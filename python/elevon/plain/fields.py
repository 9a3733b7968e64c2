"""The fields of a record: how each stands in JSON."""

from __future__ import annotations

import builtins
import sys
import types
from dataclasses import MISSING, dataclass, fields
from functools import cache
from inspect import get_annotations
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints


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
class Slot:
    """One field of a record: key or keys, type, unit, kind, whether it has a default."""

    name: str
    type: object
    keys: tuple[str, ...]
    unit: str
    remainder: bool
    kind: str
    optional: bool


class _Names(dict[str, object]):
    """Names of a module; one that is imported for the type checker alone stands for itself."""

    def __missing__(self, name: str) -> object:
        return vars(builtins).get(name, Any)


@cache
def slots_of(cls: type) -> tuple[Slot, ...]:
    """Return the fields of a record that its class takes, with their marks."""
    hints: dict[str, object] = {}
    names = [item.name for item in fields(cls)]
    for base in reversed(cls.__mro__):
        named = {name: hint for name, hint in get_annotations(base).items() if name in names}
        notes = types.SimpleNamespace(__annotations__=named)
        known = vars(sys.modules[base.__module__])
        hints |= get_type_hints(notes, known, _Names(known), include_extras=True)
    return tuple(_slot(item, hints[item.name]) for item in fields(cls) if item.init)


def _slot(item: Any, hint: object) -> Slot:
    marks = [mark for mark in get_args(hint)[1:] if isinstance(mark, As)]
    kind = next((mark.kind for mark in marks if mark.kind != "printed"), "printed")
    optional = not (item.default is MISSING and item.default_factory is MISSING)
    return Slot(
        name=item.name,
        type=get_args(hint)[0] if get_origin(hint) is Annotated else hint,
        keys=next((mark.keys for mark in marks if mark.keys), (item.name,)),
        unit=next((mark.unit for mark in marks if mark.unit), ""),
        remainder=any(mark.remainder for mark in marks),
        kind=kind,
        optional=optional,
    )
