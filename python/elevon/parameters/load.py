"""Read a set file: header, entries, and the set it is based on."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from elevon.documents import Document, read_toml, validated
from elevon.errors import InputError, unknown
from elevon.parameters.find import find_set, is_shipped
from elevon.parameters.parameter import Parameter
from elevon.parameters.records import Record, records, wiring_names
from elevon.parameters.set import ParameterSet
from elevon.units import parse_quantity

__all__ = ["SetFile", "load_set"]

_HEADER_KEYS = (
    "name", "title", "wiring", "base", "references", "scenario", "compare", "validation",
)  # fmt: skip


@dataclass(frozen=True)
class SetFile:
    """A parameter set as loaded from its file.

    Attributes
    ----------
    name, title, wiring : str
        As in the header.
    parameters : ParameterSet
        Complete and checked.
    path : Path
        The file.
    references : mapping
        Key to citation, those of the base included.
    scenario : mapping or None
        What runs when no scenario is given.
    validation : mapping or None
        ``transient`` [s] and ``limits``: signal to largest RMS error in percent of its range.
    compare : mapping or None
        ``after`` [s], ``load`` and ``scenario``: what `elevon compare` runs.
    """

    name: str
    title: str
    wiring: str
    parameters: ParameterSet
    path: Path
    references: Mapping[str, str]
    scenario: Mapping[str, Any] | None
    validation: Mapping[str, Any] | None = None
    compare: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class _Layer:
    """One file of a chain of bases, before the values are read."""

    document: Document
    header: Any
    entries: Mapping[str, Any]


def load_set(reference: str | os.PathLike[str]) -> SetFile:
    """Load a parameter set by name or file, with the sets it is based on.

    Parameters
    ----------
    reference : str or path
        Name of a set, or a TOML file.

    Returns
    -------
    SetFile
        Complete and checked.

    Raises
    ------
    InputError
        The file cannot be read, has unknown keys or paths, wrong units or values outside their
        range, or lacks a parameter; the message names file, line, path and limit.
    """
    path = find_set(reference)
    layers = list(_chain(path))
    wiring = next((layer.header.wiring for layer in layers if layer.header.wiring), None)
    top = layers[0]
    if wiring is None:
        raise InputError(f"{top.document.place()}: 'wiring' is missing; {_wirings()}")
    if wiring not in wiring_names():
        raise InputError(
            f"{top.document.place(('wiring',))}: unknown wiring {wiring!r}; {_wirings()}"
        )
    entries: dict[str, Parameter] = {}
    references: dict[str, str] = {}
    for layer in reversed(layers):
        entries.update(_marked(_parameters(layer, wiring), entries, layer, wiring))
        references.update({item.key: item.text for item in layer.header.references})
    scenario = next((layer.header.scenario for layer in layers if layer.header.scenario), None)
    return SetFile(
        name=top.header.name,
        title=next((layer.header.title for layer in layers if layer.header.title), ""),
        wiring=wiring,
        parameters=ParameterSet(wiring, entries, str(path)),
        path=path,
        references=references,
        scenario=scenario,
        validation=_table(layers, "validation"),
        compare=_table(layers, "compare"),
    )


def _marked(
    parameters: Mapping[str, Parameter], base: Mapping[str, Parameter], layer: _Layer, wiring: str
) -> dict[str, Parameter]:
    """Mark what a set of the user's own changes in its base, or in the defaults the base leaves."""
    if not layer.header.base or is_shipped(Path(layer.document.origin)):
        return dict(parameters)
    known = records(wiring)
    marked = {}
    for path, item in parameters.items():
        below = base.get(path)
        value = known[path].default_value() if below is None else below.value
        changed = value is not None and value != item.value
        marked[path] = replace(item, changed=changed or (below is not None and below.changed))
    return marked


def _table(layers: list[_Layer], name: str) -> Mapping[str, Any] | None:
    """Return a table of the header, the nearest one down the bases."""
    tables = (getattr(layer.header, name) for layer in layers)
    table = next((item for item in tables if item is not None), None)
    return None if table is None else table.model_dump()


def _chain(path: Path) -> Iterator[_Layer]:
    """Yield the layers from a set down to its last base."""
    from elevon.parameters.model import Header

    seen: list[Path] = []
    following: Path | None = path
    while following is not None:
        resolved = following.resolve()
        if resolved in seen:
            names = " -> ".join(item.name for item in [*seen, resolved])
            raise InputError(f"{path}: the bases go round in a circle: {names}")
        seen.append(resolved)
        document = read_toml(following)
        rest = {
            key: value
            for key, value in document.data.items()
            if key not in _HEADER_KEYS and isinstance(value, dict)
        }
        head = {key: value for key, value in document.data.items() if key not in rest}
        header = validated(Header, head, document)
        yield _Layer(document, header, rest)
        base = header.base
        following = find_set(base, document.folder) if base else None


def _parameters(layer: _Layer, wiring: str) -> dict[str, Parameter]:
    from elevon.parameters.model import Entry

    known = records(wiring)
    parameters: dict[str, Parameter] = {}
    for path, raw in _leaves(layer, layer.entries, ()):
        place = layer.document.place(tuple(path.split(".")))
        if path not in known:
            raise unknown("parameter", path, known, place)
        entry = validated(Entry, raw, layer.document.within(tuple(path.split("."))))
        parameters[path] = _parameter(path, entry, known[path], place)
    return parameters


def _leaves(
    layer: _Layer, table: Mapping[str, Any], prefix: tuple[str, ...]
) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield each table that holds a value, with its dotted path."""
    for key, item in table.items():
        location = (*prefix, key)
        if not isinstance(item, dict):
            raise InputError(
                f"{layer.document.place(location)}: a parameter is a table with "
                "value, unit, source, note, confidence"
            )
        if "value" in item or "source" in item:
            yield ".".join(location), item
        else:
            yield from _leaves(layer, item, location)


def _parameter(path: str, entry: Any, record: Record, place: str) -> Parameter:
    def si(number: float | str) -> float | str:
        if record.choices is not None or isinstance(number, str):
            return record.read(number, place)
        return parse_quantity(f"{number!r} {entry.unit}".strip(), record.unit or "1", place)

    if isinstance(entry.value, str) and record.choices is None:
        raise InputError(
            f"{place}: value = {entry.value!r} is text; write value = 1.5 and unit = 'm'"
        )
    if not entry.unit and record.choices is None and record.unit not in ("", "1"):
        raise InputError(f"{place}: the unit is missing (such as {record.unit!r})")
    value = si(entry.value)
    if isinstance(value, float):
        record.check(value, place)
    return Parameter(
        path=path,
        value=value,
        unit=entry.unit,
        source=entry.source,
        note=entry.note,
        confidence=entry.confidence,
        old=None if entry.old is None else si(entry.old),
        interval=None if entry.interval is None else _interval(entry.interval, si, place),
    )


def _interval(given: tuple[float, float], si: Any, place: str) -> tuple[float, float]:
    low, high = si(given[0]), si(given[1])
    if not low <= high:
        raise InputError(f"{place}: interval [{given[0]}, {given[1]}] ends before it starts")
    return low, high


def _wirings() -> str:
    return "wirings: " + ", ".join(wiring_names())
