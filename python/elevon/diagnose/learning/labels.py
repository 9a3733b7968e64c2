"""What is known of logs beside them: a table (CSV) with a line for each, by its file's name."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from elevon.errors import FormatError, InputError, did_you_mean
from elevon.faults.catalogue import catalogue
from elevon.files import read_regular
from elevon.parameters.records import wirings
from elevon.units import parse_quantity

_MOST_BYTES = 16 * 2**20
HEALTHY = "healthy"
#: Columns that a table of labels may have beside ``log`` and ``label``.
OPTIONAL = ("unit", "condition", "severity", HEALTHY, "day")
_WORDS = {"yes": True, "true": True, "1": True, "no": False, "false": False, "0": False}


@dataclass(frozen=True)
class LabelledLog:
    """What is known of a log.

    Attributes
    ----------
    label : str
        ``healthy``, ``KIND@PLACE`` of a fault, or a word for what was wrong.
    unit, condition, day : str
        Which unit wrote it, under which condition, on which day; empty where nobody knows.
    severity : float
        Of the fault [`severity_unit`]; NaN where nobody knows.
    severity_unit : str
        SI unit of the severity.
    """

    label: str = HEALTHY
    unit: str = ""
    condition: str = ""
    day: str = ""
    severity: float = math.nan
    severity_unit: str = "1"


def read_labels(table: str | os.PathLike[str], logs: Sequence[str | Path]) -> list[LabelledLog]:
    """Return what a table says of each log.

    Parameters
    ----------
    table : path
        CSV with columns ``log``, ``label``, and some of `OPTIONAL`. ``severity`` is a number, or a
        number with its unit; ``healthy`` is yes or no: a log marked yes is of the class healthy
        whatever its label is.
    logs : sequence of path or str
        Of each the table must have one line.

    Raises
    ------
    FormatError, InputError
        As `log_table` and `looked_up`; a severity that is none, or of a healthy log; a label and a
        mark that contradict each other.
    """
    rows = looked_up(log_table(table, ("label",), OPTIONAL), logs, table)
    return [_labelled(row, f"{table}: {log}") for row, log in zip(rows, logs, strict=True)]


def _labelled(row: Mapping[str, str], place: str) -> LabelledLog:
    label, mark = row["label"], row.get(HEALTHY, "").lower()
    if mark and mark not in _WORDS:
        raise FormatError(f"{place}: healthy = {row[HEALTHY]!r}; yes or no is needed")
    if mark and not _WORDS[mark] and label == HEALTHY:
        raise FormatError(f"{place}: its label is healthy, its column healthy says no")
    if mark and _WORDS[mark]:
        label = HEALTHY
    severity, unit = math.nan, severity_unit(label)
    if text := row.get("severity", ""):
        if label == HEALTHY:
            raise FormatError(f"{place}: severity = {text!r} of a healthy log")
        severity = parse_quantity(text, unit, f"{place}: severity")
        if not math.isfinite(severity) or severity == 0.0:
            raise FormatError(f"{place}: severity = {text!r}; a number other than nought is needed")
    known = {name: row.get(name, "") for name in ("unit", "condition", "day")}
    return LabelledLog(label, severity=severity, severity_unit=unit, **known)


def severity_unit(label: str) -> str:
    """Return the SI unit of a fault's severity by its ``KIND@PLACE``; ``1`` of any other label."""
    kind, _, place = label.partition("@")
    for wiring in wirings():
        for record in catalogue(wiring):
            if record.kind == kind and place in record.places:
                return record.unit or "1"
    return "1"


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
