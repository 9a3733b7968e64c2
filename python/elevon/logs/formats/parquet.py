"""Logs in Parquet files: the columns of numbers, with the units their fields state."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from elevon.containers.parquet import columns, declared_bytes, is_numeric, opened, unit_of
from elevon.errors import FormatError, quoted
from elevon.logs.formats.limits import DEFAULT_LIMITS, Limits, existing_file
from elevon.logs.formats.table import RawTable, split_unit, unique_names
from elevon.logs.formats.vectors import quiet


def read_parquet(path: str | Path, *, limits: Limits = DEFAULT_LIMITS) -> RawTable:
    """Read the numeric columns of a Parquet file; a missing value becomes NaN.

    Units are taken from the field metadata (``unit`` or ``units``) where present. Columns of
    anything but numbers are named in the notes.

    Raises
    ------
    FormatError
        Damaged, empty, or larger than the limits.
    """
    file = existing_file(path, limits)
    with opened(file) as parquet:
        return _read(str(file), parquet, limits)


def _read(source: str, parquet: Any, limits: Limits) -> RawTable:
    schema = parquet.schema_arrow
    fields = [field for field in schema if is_numeric(field.type)]
    notes = [
        f"{quoted(field.name)} passed over: {quoted(str(field.type))}"
        for field in schema
        if not is_numeric(field.type)
    ]
    if not fields:
        raise FormatError(f"{source}: no column of numbers")
    limits.check_shape(source, int(parquet.metadata.num_rows), len(fields))
    limits.check_bytes(source, declared_bytes(parquet))
    names = [field.name for field in fields]
    labels = unique_names(source, [split_unit(name)[0] for name in names])
    table = columns(parquet, names, lambda rows: limits.check_shape(source, rows, len(names)))
    values = {label: quiet(table.values[name]) for label, name in zip(labels, names, strict=True)}
    if not len(values[labels[0]]):
        raise FormatError(f"{source}: no row")
    units = (unit_of(field) or split_unit(field.name)[1] for field in fields)
    stated = {label: unit for label, unit in zip(labels, units, strict=True) if unit}
    return RawTable(source, values, stated, tuple(notes), "parquet")
