"""The drive's trace: which column is which signal, and in what unit it is written.

The nine columns are those of the bench's trace files (test-bench thesis, "Testing campaign"), plus
r78, the torque-generating current as measured. The units of the two positions are not printed
anywhere: the reader confirms them by consistency (`elevon.logs.maps.consistency`).
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass

from elevon.errors import FormatError, did_you_mean
from elevon.logs.formats.limits import quoted
from elevon.logs.formats.table import RawTable

__all__ = ["DRIVE_COLUMNS", "DriveColumn", "find_drive_columns", "looks_like_drive"]


@dataclass(frozen=True, slots=True)
class DriveColumn:
    """One column of the drive's trace.

    Attributes
    ----------
    key : str
        The drive's parameter (``r62``), or ``time``.
    header : str
        The header as the bench writes it.
    signal : str
        Name in a recording.
    unit : str
        Unit in the file; empty where the file does not tell (positions) or there is none (trigger).
    si_unit : str
        Unit in a recording.
    text : str
        What it is.
    """

    key: str
    header: str
    signal: str
    unit: str
    si_unit: str
    text: str


DRIVE_COLUMNS: tuple[DriveColumn, ...] = (
    DriveColumn("time", "Xms", "time", "ms", "s", "time"),
    DriveColumn(
        "r4821", "C0Drive_axis_1r4821", "encoder_position", "", "rad", "position, user encoder"
    ),
    DriveColumn(
        "r4820", "C1Drive_axis_1r4820", "resolver_position", "", "rad", "position, motor encoder"
    ),
    DriveColumn("r62", "Drive_axis_1.r62", "speed_ref", "rpm", "rad/s", "speed set point"),
    DriveColumn("r63", "Drive_axis_1.r63", "motor_speed", "rpm", "rad/s", "actual speed, smoothed"),
    DriveColumn("r77", "Drive_axis_1.r77", "current_ref", "A", "A", "torque current set point"),
    DriveColumn("r76", "Drive_axis_1.r76", "current_d_meas", "A", "A", "field current, actual"),
    DriveColumn("r78", "Drive_axis_1.r78", "current_q_meas", "A", "A", "torque current, actual"),
    DriveColumn("r1733", "Drive_axis_1.r1733", "voltage_q_ref", "V", "V", "q voltage set point"),
    DriveColumn("r722", "Drive_control.r722", "trigger", "", "1", "digital inputs: trigger"),
)

_BY_KEY = {column.key: column for column in DRIVE_COLUMNS}
_PARAMETER = re.compile(r"(?:^|[^a-z])r0*(\d{2,4})(?:\[(\d)\]|\.\d+)?$")
_TIME = {"xms", "x", "x[ms]", "time", "timems", "t", "tms", "zeit"}


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
    found: dict[str, str] = {}
    for name in table.columns:
        key = _key(name)
        if key is None:
            continue
        if key in found:
            raise FormatError(
                f"{table.source}: columns {quoted(found[key])} and {quoted(name)} are both "
                f"{key}; name one of them in a column map"
            )
        found[key] = name
    _check_found(table, {*found, *given})
    return found


def looks_like_drive(table: RawTable) -> bool:
    """Whether at least two columns carry numbers of the drive's parameters."""
    return sum(_key(name) not in {None, "time"} for name in table.columns) >= 2


def _key(name: str) -> str | None:
    text = re.sub(r"\s+", "", name).lower()
    if text in _TIME:
        return "time"
    match = _PARAMETER.search(text) or _PARAMETER.search(re.sub(r"(axis_\d+)", r"\1.", text))
    if match is None:
        return None
    number = match.group(1) + (match.group(2) or "")
    return f"r{number}" if f"r{number}" in _BY_KEY else None


def _check_found(table: RawTable, found: Collection[str]) -> None:
    names = ", ".join(quoted(name) for name in list(table.columns)[:12])
    if "time" not in found:
        raise FormatError(
            f"{table.source}: no time column (Xms){did_you_mean('Xms', table.columns)}; "
            f"columns: {names}"
        )
    if "r4820" not in found and "r4821" not in found:
        raise FormatError(
            f"{table.source}: neither the motor's position (r4820) nor the user's (r4821); "
            f"columns: {names}"
        )
