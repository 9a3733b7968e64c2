"""Parquet files, bounded by their own declared sizes before a page is expanded."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from elevon.errors import FormatError
from elevon.logs.formats.limits import DEFAULT_LIMITS, Limits, existing_file, quoted
from elevon.logs.formats.table import FloatArray, RawTable, split_unit, unique_names
from elevon.logs.formats.vectors import quiet

__all__ = ["read_parquet"]


def read_parquet(path: str | Path, *, limits: Limits = DEFAULT_LIMITS) -> RawTable:
    """Read the numeric columns of a Parquet file; a missing value becomes NaN.

    Units are taken from the field metadata (``unit`` or ``units``) where present. Columns of
    anything but numbers are named in the notes.

    Raises
    ------
    FormatError
        Damaged, empty, or larger than the limits.
    """
    import pyarrow.parquet as pq

    file = existing_file(path, limits)
    try:
        with pq.ParquetFile(file, memory_map=False, pre_buffer=False) as parquet:
            return _read(str(file), parquet, limits)
    except FormatError:
        raise
    except Exception as error:
        raise FormatError(f"{file}: damaged Parquet file: {quoted(str(error))}") from error


def _read(source: str, parquet: Any, limits: Limits) -> RawTable:
    schema = parquet.schema_arrow
    notes: list[str] = []
    names = [field.name for field in schema if _numeric(field.type)]
    for field in schema:
        if not _numeric(field.type):
            notes.append(f"{quoted(field.name)} passed over: {quoted(str(field.type))}")
    if not names:
        raise FormatError(f"{source}: no column of numbers")
    rows = int(parquet.metadata.num_rows)
    if rows == 0:
        raise FormatError(f"{source}: no row")
    limits.check_shape(source, rows, len(names))
    groups = [parquet.metadata.row_group(k) for k in range(parquet.metadata.num_row_groups)]
    limits.check_bytes(source, sum(int(group.total_byte_size) for group in groups))
    parts: dict[str, list[FloatArray]] = {name: [] for name in names}
    seen = 0
    for batch in parquet.iter_batches(columns=names, batch_size=65_536):
        seen += batch.num_rows
        limits.check_shape(source, seen, len(names))
        for name in names:
            parts[name].append(_floats(batch.column(name)))
    if seen == 0:
        raise FormatError(f"{source}: no row")
    units = {name: _unit(schema.field(name)) for name in names}
    labels = unique_names(source, [split_unit(name)[0] for name in names])
    columns = {
        label: quiet(np.concatenate(parts[name])) for label, name in zip(labels, names, strict=True)
    }
    stated = {label: units[name] for label, name in zip(labels, names, strict=True) if units[name]}
    return RawTable(source, columns, stated, tuple(notes), "parquet")


def _numeric(kind: Any) -> bool:
    from pyarrow import types

    return bool(types.is_floating(kind) or types.is_integer(kind) or types.is_boolean(kind))


def _floats(column: Any) -> FloatArray:
    import pyarrow as pa

    return np.asarray(
        column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False), dtype=np.float64
    )


def _unit(field: Any) -> str:
    metadata = field.metadata or {}
    for key in (b"unit", b"units"):
        if key in metadata:
            return str(metadata[key].decode("utf-8", "replace"))[:40]
    return split_unit(field.name)[1]
