"""Recordings as comma-separated text, for eyes, spreadsheets and other programs.

The first line is ``# elevon {...}``, the description (`Header`); the second names the columns with
their units: ``time [s],user_position [rad]``. Numbers have the digits that give back every
bit (a NaN comes back as the plain one).
A file holds ONE clock; a recording of several is refused (Parquet, NetCDF and MAT hold them).

A table without the first line is read as well, in any units, as a recording without meta.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.errors import FormatError, InputError, UncheckedWarning
from elevon.recording.channel import in_si
from elevon.recording.clock import Clock
from elevon.recording.contents import Contents, check_size, header_bytes, rebuild
from elevon.recording.header import Header

if TYPE_CHECKING:
    from elevon.recording.recording import Recording
from elevon.units import check_kind, to_si

__all__ = ["check", "read", "write"]

_MARK = "# elevon "
_COLUMN = re.compile(r'\s*"?\s*([A-Za-z][A-Za-z0-9_]*)\s*\[\s*([^\[\],"]*?)\s*\]\s*"?\s*')
_LONGEST_LINE = 64 * 2**20
_EXPANSION = 4
"""A number of two characters, with its comma, takes eight bytes in memory."""


def check(recording: Recording) -> None:
    """Refuse a recording of several clocks."""
    if len(recording.clocks) != 1:
        names = ", ".join(map(repr, recording.clocks)) or "none"
        raise InputError(
            f"a .csv file holds one clock, the recording has {len(recording.clocks)} ({names}); "
            "choose one with select(clock=...), or save as .parquet, .nc or .mat"
        )


def write(recording: Recording, path: Path) -> None:
    """Write the two first lines and the numbers."""
    import pyarrow as pa
    from pyarrow import csv

    channels = recording.channels
    heads = ["time [s]", *(f"{c.name} [{c.unit}]" for c in channels)]
    arrays = [pa.array(recording.clock().time), *(pa.array(c.values) for c in channels)]
    options = csv.WriteOptions(include_header=False, quoting_style="none")
    with path.open("wb") as stream:
        stream.write(f"{_MARK}{Header.sealed(recording).to_json()}\n{','.join(heads)}\n".encode())
        csv.write_csv(pa.Table.from_arrays(arrays, heads), stream, options)


def read(path: Path, max_bytes: int) -> Contents:
    """Read the first lines, then the numbers."""
    check_size(str(path), path.stat().st_size, max_bytes)
    with path.open("rb") as stream:
        first = _line(path, stream)
        header = None
        if first.startswith(_MARK):
            header = Header.from_json(first.removeprefix(_MARK), str(path))
            check_size(str(path), header_bytes(header), max_bytes)
            first = _line(path, stream)
        else:
            check_size(str(path), _EXPANSION * path.stat().st_size, max_bytes)
        columns = _heads(path, first)
        arrays = _numbers(path, stream, list(columns))
    if header is None:
        contents = _without_header(path, columns, arrays)
        warnings.warn(f"{path}: carries no checksum: damage cannot be seen", UncheckedWarning, 4)
        return contents
    if len(header.clocks) != 1:
        raise FormatError(f"{path}: describes {len(header.clocks)} clocks, a .csv holds one")
    described = {name: unit for name, (unit, _) in header.clocks[0].channels.items()}
    if columns != {"time": "s", **described}:
        raise FormatError(f"{path}: the column names do not agree with the first line")
    return rebuild(header, lambda _: arrays, str(path))


def _line(path: Path, stream: Any) -> str:
    raw = stream.readline(_LONGEST_LINE)
    try:
        text: str = raw.decode("utf-8-sig").rstrip("\r\n")
    except UnicodeDecodeError as error:
        raise FormatError(f"{path}: is not UTF-8 text") from error
    return text


def _heads(path: Path, line: str) -> dict[str, str]:
    """Read the column names and units."""
    columns: dict[str, str] = {}
    for text in line.split(","):
        match = _COLUMN.fullmatch(text)
        if match is None:
            raise FormatError(f"{path}: the column {text[:60]!r} is not of the form 'name [unit]'")
        if match[1] in columns:
            raise FormatError(f"{path}: the column {match[1]!r} is there twice")
        columns[match[1]] = match[2] or "1"
    if next(iter(columns)) != "time":
        raise FormatError(f"{path}: the first column must be 'time [s]'")
    return columns


def _numbers(path: Path, stream: Any, names: list[str]) -> dict[str, npt.NDArray[np.float64]]:
    import pyarrow as pa
    from pyarrow import csv

    rest = stream.read()
    if not rest.strip():
        return {name: np.empty(0) for name in names}
    kinds = dict.fromkeys(names, pa.float64())
    try:
        table = csv.read_csv(
            pa.BufferReader(rest),
            csv.ReadOptions(column_names=names),
            csv.ParseOptions(quote_char=False),
            csv.ConvertOptions(column_types=kinds, null_values=[], strings_can_be_null=False),
        )
    except (pa.ArrowException, ValueError) as error:
        raise FormatError(f"{path}: {error}") from error
    return {name: table.column(name).to_numpy() for name in names}


def _without_header(
    path: Path, columns: dict[str, str], arrays: dict[str, npt.NDArray[np.float64]]
) -> Contents:
    try:
        values = {name: arrays[name] for name in columns if name != "time"}
        units = {name: unit for name, unit in columns.items() if name != "time"}
        check_kind(columns["time"], "s", "time")
        time = arrays["time"]
        if columns["time"] != "s":
            time = to_si(time, columns["time"])
        base = Clock("main", time)
        return Contents([in_si(name, units[name], values[name], base) for name in values], [base])
    except InputError as error:
        raise FormatError(f"{path}: {error}") from error
