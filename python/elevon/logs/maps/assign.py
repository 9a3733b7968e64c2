"""From columns to signals: which column is which signal, and its factor to SI."""

from __future__ import annotations

import math
from dataclasses import dataclass

from elevon.errors import FormatError, InputError, unknown
from elevon.logs.clocks.quality import IntArray
from elevon.logs.formats.limits import quoted
from elevon.logs.formats.table import FloatArray, RawTable
from elevon.logs.maps.column_map import ColumnEntry, ColumnMap
from elevon.logs.maps.columns import DRIVE_COLUMNS, find_drive_columns, looks_like_drive
from elevon.logs.maps.shafts import (
    PositionStatement,
    settle_encoder,
    settle_motor,
    travel_from_speed,
)
from elevon.logs.maps.signals import SIGNALS, safe_name
from elevon.logs.report import ImportReport
from elevon.units import check_kind, parse_unit

__all__ = ["Assignment", "assign_columns", "rms_to_peak", "settle_positions"]

_POSITIONS = ("resolver_position", "encoder_position")


@dataclass(slots=True)
class Assignment:
    """A signal: its column, its factor from the file to SI (offset for temperatures), its unit."""

    signal: str
    column: str
    factor: float | None
    unit: str
    offset: float = 0.0


def assign_columns(
    table: RawTable,
    column_map: ColumnMap | None,
    gear_ratio: float,
    report: ImportReport,
    *,
    layout: str = "auto",
) -> dict[str, Assignment]:
    """Decide what every column is.

    Parameters
    ----------
    table : RawTable
        The log.
    column_map : ColumnMap or None
        What the user says; it wins over the headers.
    gear_ratio : float
        Fast over slow.
    report : ImportReport
        Findings are added to it.
    layout : str
        ``drive`` to insist on the drive's columns, ``csv`` to use the map alone.

    Returns
    -------
    dict of str to Assignment
        By signal, ``time`` among them; positions of a drive trace have no factor yet
        (`settle_positions` finds it).

    Raises
    ------
    InputError
        A mapped column that is not in the file, units of the wrong kind, no time.
    """
    found: dict[str, Assignment] = {}
    for entry in column_map.column if column_map else ():
        if entry.name not in table.columns:
            raise unknown("column", entry.name, table.columns, table.source)
        found[entry.signal] = _mapped(entry, table, gear_ratio)
    if layout == "drive" or (layout != "csv" and looks_like_drive(table)):
        report.file_format = f"{table.file_format}, drive trace"
        _add_drive(found, table)
    else:
        _add_named(found, table)
    if "time" not in found:
        raise FormatError(
            f"{table.source}: no time column; columns: "
            f"{', '.join(quoted(name) for name in list(table.columns)[:12])}; say which one it is "
            "in a column map (--map)"
        )
    if len(found) < 2:
        raise FormatError(
            f"{table.source}: no column is known; columns: "
            f"{', '.join(quoted(name) for name in list(table.columns)[:12])}; say what they are in "
            "a column map (--map)"
        )
    _add_extra(found, table, report)
    return found


def settle_positions(
    found: dict[str, Assignment],
    table: RawTable,
    time: FloatArray,
    keep: IntArray,
    gear_ratio: float,
    *,
    report: ImportReport,
) -> None:
    """Give the positions their factors, and check those the user stated; errors as the settlers.

    `time` and `keep` are the clock's instants and the rows they stand in.
    """
    speeds = [
        table.columns[found[name].column][keep] * (found[name].factor or 1.0)
        for name in ("motor_speed", "speed_ref")
        if name in found
    ]
    motor, encoder = (found.get(name) for name in _POSITIONS)
    reference, trusted = None, False
    if motor is not None:
        values = table.columns[motor.column][keep]
        motor.factor, trusted = settle_motor(_statement(motor), time, values, speeds, report)
        reference = values * motor.factor
    elif speeds:
        reference, trusted = travel_from_speed(time, speeds[0]), True
    if encoder is None:
        return
    values = table.columns[encoder.column][keep]
    if reference is None:
        reference = 0.0 * values
    encoder.factor, _ = settle_encoder(
        _statement(encoder), reference, values, gear_ratio, report, trusted=trusted
    )


def _statement(assignment: Assignment) -> PositionStatement:
    per_rad = None if assignment.factor is None else 1.0 / assignment.factor
    return PositionStatement(quoted(assignment.column), per_rad)


def _mapped(entry: ColumnEntry, table: RawTable, gear_ratio: float) -> Assignment:
    signal = "time" if entry.signal == "time" else entry.signal
    known = SIGNALS.get(signal)
    stated = entry.unit if entry.unit is not None else table.units.get(entry.name)
    expected = "s" if signal == "time" else (known.unit if known else stated or "1")
    place = f"{table.source}: column {quoted(entry.name)}"
    unit = check_kind(stated, expected, place) if stated else parse_unit(expected)
    factor = float(unit.to_si(1.0) - unit.to_si(0.0)) * entry.sign * entry.scale
    offset = float(unit.to_si(0.0))
    if entry.shaft is not None:
        if known is None or not known.shaft:
            raise InputError(f"{place}: {signal} belongs to no shaft")
        if entry.shaft != known.shaft:
            power = {"angle": 1.0, "torque": -1.0}[known.scaled]
            factor *= gear_ratio ** (power if entry.shaft == "slow" else -power)
    return Assignment(signal, entry.name, factor, _si(expected), offset)


def _si(unit: str) -> str:
    from elevon.units import si_unit

    return si_unit(unit)


def _add_drive(found: dict[str, Assignment], table: RawTable) -> None:
    taken = {assignment.column for assignment in found.values()}
    mapped = {a.signal for a in found.values()}
    columns = {c.key: c for c in DRIVE_COLUMNS}
    free = {name: values for name, values in table.columns.items() if name not in taken}
    covered = {c.key for c in DRIVE_COLUMNS if c.signal in mapped}
    rest = RawTable(table.source, free or table.columns, table.units)
    for key, name in find_drive_columns(rest, given=covered).items():
        column = columns[key]
        if column.signal in found or name in taken:
            continue
        stated = table.units.get(name) or column.unit
        factor: float | None = None
        if stated:
            place = f"{table.source}: column {quoted(name)}"
            factor = float(check_kind(stated, column.si_unit, place).to_si(1.0))
        elif column.si_unit == "1":
            factor = 1.0
        found[column.signal] = Assignment(column.signal, name, factor, column.si_unit)


def _add_named(found: dict[str, Assignment], table: RawTable) -> None:
    """Columns that carry a signal's own name, in the unit the file states, else SI."""
    taken = {assignment.column for assignment in found.values()}
    for name in table.columns:
        signal = name.strip().lower()
        if name in taken or signal in found or (signal not in SIGNALS and signal != "time"):
            continue
        entry = ColumnEntry(name=name, signal=signal)
        found[signal] = _mapped(entry, table, 1.0)


def _add_extra(found: dict[str, Assignment], table: RawTable, report: ImportReport) -> None:
    taken = {assignment.column for assignment in found.values()}
    for name in table.columns:
        if name in taken:
            continue
        signal = safe_name(name, set(found))
        stated = table.units.get(name, "")
        report.note(
            signal, "extra-column", f"column {quoted(name)} is not known; kept as it stands"
        )
        if stated:
            report.note(signal, "extra-unit", f"its unit, as the file says: {quoted(stated)}")
        found[signal] = Assignment(signal, name, 1.0, "1")


def rms_to_peak(found: dict[str, Assignment]) -> list[str]:
    """Turn the drive's currents and voltage from rms to peak; return the signals concerned."""
    changed = []
    for signal, assignment in found.items():
        known = SIGNALS.get(signal)
        if known is not None and known.drive_current and assignment.factor is not None:
            assignment.factor *= math.sqrt(2.0)
            changed.append(signal)
    return changed
