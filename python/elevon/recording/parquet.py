"""Recordings in Parquet: one file, whatever the number of clocks.

Layout, version 3. The schema metadata entry ``elevon`` holds the description (`Header`); each
field has its ``unit`` and ``text``. With one clock the columns are ``time`` and the channels. With
several clocks a first column ``clock`` names the clock of the row; the rows of the clocks follow
each other, every clock starting a row group, and a channel is null in the rows of the others. So
``frame[frame.clock == "drive"].dropna(axis=1, how="all")`` is one clock for any reader.

Snappy and plain or dictionary pages only, which every reader knows.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.containers.parquet import columns, declared_bytes, opened
from elevon.errors import FormatError
from elevon.recording.contents import Contents, check_size, header_bytes, rebuild
from elevon.recording.header import Header

if TYPE_CHECKING:
    from elevon.recording.recording import Recording

_GROUP = 2**18


def write(recording: Recording, path: Path) -> None:
    """Write all clocks, row group after row group."""
    import pyarrow.parquet as pq

    schema = _schema(recording)
    with pq.ParquetWriter(
        path,
        schema,
        compression="snappy",
        use_byte_stream_split=False,
        use_dictionary=["clock"],
        write_page_checksum=True,
    ) as writer:
        for batch in _tables(recording, schema):
            writer.write_table(batch, row_group_size=_GROUP)


def read(path: Path, max_bytes: int) -> Contents:
    """Read every clock from its rows."""
    with opened(path) as file:
        header = _header(path, file)
        check_size(str(path), max(header_bytes(header), declared_bytes(file)), max_bytes)
        starts = _row_groups(path, file, header)
        return rebuild(header, lambda name: _columns(path, file, header, name, starts), str(path))


def _schema(recording: Recording) -> Any:
    import pyarrow as pa

    several = len(recording.clocks) > 1
    fields = [pa.field("clock", pa.string(), nullable=False)] if several else []
    fields.append(pa.field("time", pa.float64(), nullable=False, metadata={"unit": "s"}))
    fields += [
        pa.field(c.name, pa.float64(), metadata={"unit": c.unit, "text": c.text})
        for c in recording.channels
    ]
    return pa.schema(fields, metadata={"elevon": Header.sealed(recording).to_json()})


def _tables(recording: Recording, schema: Any) -> Iterator[Any]:
    """Yield one table a clock, with nulls for the channels of other clocks."""
    import pyarrow as pa

    for clock in recording.clocks.values():
        if not len(clock) and len(recording.clocks) > 1:
            continue
        values_of = {channel.name: channel.values for channel in recording.on_clock(clock.name)}
        columns = {"time": pa.array(clock.time)}
        if len(recording.clocks) > 1:
            columns["clock"] = pa.repeat(pa.scalar(clock.name), len(clock))
        for channel in recording.channels:
            values = values_of.get(channel.name)
            columns[channel.name] = (
                pa.nulls(len(clock), pa.float64()) if values is None else pa.array(values)
            )
        yield pa.Table.from_arrays([columns[name] for name in schema.names], schema=schema)


def _header(path: Path, file: Any) -> Header:
    text = (file.schema_arrow.metadata or {}).get(b"elevon")
    if text is None:
        raise FormatError(f"{path}: is Parquet, but no recording (no 'elevon' metadata)")
    return Header.from_json(text, str(path))


def _row_groups(path: Path, file: Any, header: Header) -> dict[str, list[int]]:
    """Find the row groups of each clock from the sample counts, checking that they fit."""
    sizes = [file.metadata.row_group(k).num_rows for k in range(file.num_row_groups)]
    groups: dict[str, list[int]] = {}
    position = 0
    for clock in header.clocks:
        groups[clock.name], rows = [], 0
        while rows < clock.samples and position < len(sizes):
            groups[clock.name].append(position)
            rows += sizes[position]
            position += 1
        if rows != clock.samples:
            raise FormatError(f"{path}: clock {clock.name!r} does not end with a row group")
    if sum(sizes[position:]):
        raise FormatError(f"{path}: has rows that belong to no clock")
    return groups


def _columns(
    path: Path, file: Any, header: Header, name: str, groups: dict[str, list[int]]
) -> dict[str, Floats]:
    import pyarrow as pa

    entry = next(clock for clock in header.clocks if clock.name == name)
    wanted = ["time", *entry.channels]
    for column in wanted:
        index = file.schema_arrow.get_field_index(column)
        if index < 0 or file.schema_arrow.field(index).type != pa.float64():
            raise FormatError(f"{path}: column {column!r} is missing or not float64")
    if not groups[name]:
        return {column: np.empty(0) for column in wanted}

    def check_rows(rows: int) -> None:
        if rows > entry.samples:
            raise FormatError(f"{path}: clock {name!r} has more rows than its description says")

    table = columns(file, wanted, check_rows, groups[name])
    for column in wanted:
        if column in table.missing:
            raise FormatError(f"{path}: column {column!r} has nulls on its own clock")
    return table.values
