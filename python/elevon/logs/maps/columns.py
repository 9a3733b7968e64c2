"""The drive's trace: its columns are recognised by the numbers of the drive's parameters."""

from __future__ import annotations

import re
from collections.abc import Collection

from elevon.errors import FormatError, did_you_mean, quoted
from elevon.logs.formats.table import RawTable
from elevon.logs.maps.column_map import ColumnEntry, shipped_map

_PARAMETER = re.compile(r"(?:^|[^a-z])r0*(\d{2,4})(?:\[(\d)\]|\.\d+)?$")
_TIME = {"xms", "x", "x[ms]", "time", "timems", "t", "tms", "zeit"}


def drive_columns() -> dict[str, ColumnEntry]:
    """Return the columns of the drive's trace by parameter (``r62``), ``time`` among them."""
    return {entry.match: entry for entry in shipped_map("torino").column if entry.match}


def find_drive_columns(table: RawTable, given: Collection[str] = ()) -> dict[str, str]:
    """Find the drive's columns by the parameter number in their headers.

    Case, blanks, the axis prefix and the trace prefix (``C0``, ``C1``) do not matter.

    Parameters
    ----------
    table : RawTable
        A log.
    given : collection of str
        Keys known already, from a column map.

    Returns
    -------
    dict of str to str
        Drive parameter (or ``time``) to the name of the column in the table.

    Raises
    ------
    FormatError
        No time column, no position column, or two columns of one parameter.
    """
    recognised: dict[str, str] = {}
    for name in table.columns:
        key = parameter_key(name)
        if key is None:
            continue
        if key in recognised:
            raise FormatError(
                f"{table.source}: columns {quoted(recognised[key])} and {quoted(name)} are both "
                f"{key}; name one of them in a column map"
            )
        recognised[key] = name
    _check_columns(table, {*recognised, *given})
    return recognised


def looks_like_drive(table: RawTable) -> bool:
    """Whether at least two columns carry numbers of the drive's parameters."""
    return sum(parameter_key(name) not in {None, "time"} for name in table.columns) >= 2


def parameter_key(name: str) -> str | None:
    """Return the drive's parameter that a header carries (``r62``), ``time``, or None."""
    text = re.sub(r"\s+", "", name).lower()
    if text in _TIME:
        return "time"
    match = _PARAMETER.search(text) or _PARAMETER.search(re.sub(r"(axis_\d+)", r"\1.", text))
    if match is None:
        return None
    number = match.group(1) + (match.group(2) or "")
    return f"r{number}" if f"r{number}" in drive_columns() else None


def _check_columns(table: RawTable, recognised: Collection[str]) -> None:
    names = ", ".join(quoted(name) for name in list(table.columns)[:12])
    if "time" not in recognised:
        raise FormatError(
            f"{table.source}: no time column (Xms){did_you_mean('Xms', table.columns)}; "
            f"columns: {names}"
        )
    if "r4820" not in recognised and "r4821" not in recognised:
        raise FormatError(
            f"{table.source}: neither the motor's position (r4820) nor the output's (r4821); "
            f"columns: {names}"
        )
