"""What is known of logs beside them: a table (CSV) with a line for each, by its file's name."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from elevon.errors import FormatError, InputError, did_you_mean
from elevon.files import read_regular

_MOST_BYTES = 16 * 2**20


def log_table(
    path: str | os.PathLike[str], columns: Sequence[str], optional: Sequence[str] = ()
) -> dict[str, dict[str, str]]:
    """Read a table with the column ``log`` and others.

    Parameters
    ----------
    path : path
        CSV, UTF-8, the first line its header.
    columns, optional : sequence of str
        Columns that it must have, and that it may have.

    Returns
    -------
    dict of str to dict of str to str
        Log, as it stands in the table, to the other columns' values.

    Raises
    ------
    FormatError
        No such table: a column that is missing, unknown or twice, a line without a value, a log
        on two lines.
    """
    text = read_regular(path, _MOST_BYTES).decode("utf-8-sig", errors="replace")
    rows = list(csv.reader(io.StringIO(text), skipinitialspace=True))
    head = [name.strip() for name in rows[0]] if rows else []
    known = ["log", *columns, *optional]
    for name in ("log", *columns):
        if head.count(name) != 1:
            raise FormatError(f"{path}: the header must name {name!r} once; it has {head}")
    for name in head:
        if name not in known:
            raise FormatError(f"{path}: unknown column {name!r}{did_you_mean(name, known)}")
    out: dict[str, dict[str, str]] = {}
    for number, row in enumerate(rows[1:], start=2):
        if not any(cell.strip() for cell in row):
            continue
        cells = dict(zip(head, (cell.strip() for cell in row), strict=False))
        if len(row) != len(head) or not all(cells[name] for name in ("log", *columns)):
            raise FormatError(f"{path}:{number}: {len(head)} values are needed, one a column")
        if cells["log"] in out:
            raise FormatError(f"{path}:{number}: log {cells['log']!r} is there already")
        out[cells.pop("log")] = cells
    return out


def looked_up(
    table: Mapping[str, Mapping[str, str]], logs: Sequence[str | Path], place: object
) -> list[Mapping[str, str]]:
    """Return the line of each log: that of its path, or else of the end of its path.

    Raises
    ------
    InputError
        A log without a line, or with two; a line whose log was not given.
    """
    out, used = [], set()
    for log in logs:
        parts = Path(log).parts
        lines = [
            name
            for name in table
            if Path(name).parts == parts[len(parts) - len(Path(name).parts) :]
        ]
        if len(lines) != 1:
            what = f"has {len(lines)} lines for" if lines else "has no line for"
            raise InputError(f"{place}: {what} {log}{did_you_mean(str(log), table)}")
        used.add(lines[0])
        out.append(table[lines[0]])
    left = [name for name in table if name not in used]
    if left:
        raise InputError(f"{place}: {left[0]} is not among the logs that were given")
    return out
