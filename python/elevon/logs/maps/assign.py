"""From columns to signals: which column is which signal, and its factor to SI."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from elevon.arrays import Floats
from elevon.errors import FormatError, InputError, quoted, unknown
from elevon.logs.clocks.clock_fit import IntArray
from elevon.logs.formats.table import RawTable
from elevon.logs.maps.column_map import (
    ColumnEntry,
    ColumnMap,
    drive_columns,
    drive_unit,
    find_drive_columns,
    known_roles,
    known_signals,
    looks_like_drive,
    safe_name,
    unit_among,
)
from elevon.logs.maps.shafts import (
    PositionStatement,
    settle_encoder,
    settle_motor,
    travel_from_speed,
)
from elevon.logs.report import ImportReport
from elevon.units import parse_unit, si_unit


@dataclass(slots=True)
class Assignment:
    """A signal: its column, its factor from the file to SI (offset for temperatures), its unit.

    `role` is empty where it has none; `subtract_from` names the column it is subtracted
    from.
    """

    signal: str
    column: str
    factor: float | None
    unit: str
    offset: float = 0.0
    role: str = ""
    subtract_from: str | None = None

    def values(self, table: RawTable) -> Floats:
        """Return the column as the file means it, before factor and offset."""
        column = table.columns[self.column]
        return column if self.subtract_from is None else table.columns[self.subtract_from] - column


def playing(assigned: Mapping[str, Assignment], role: str) -> Assignment | None:
    """Return the signal that has a role, if any."""
    return next((item for item in assigned.values() if item.role == role), None)


def assign_columns(
    table: RawTable,
    column_map: ColumnMap | None,
    gear_ratio: float | None,
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
        What the caller stated; it wins over the headers.
    gear_ratio : float or None
        Motor over output, where it is known.
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
    assigned: dict[str, Assignment] = {}
    for entry in column_map.column if column_map else ():
        for name in (entry.name, entry.subtract_from):
            if name is not None and name not in table.columns:
                raise unknown("column", name, table.columns, table.source)
        assigned[entry.channel] = _mapped(entry, table, gear_ratio)
    if layout == "drive" or (layout != "csv" and looks_like_drive(table)):
        report.file_format = f"{table.file_format}, drive trace"
        _add_drive(assigned, table)
    else:
        _add_named(assigned, table)
    _check_some(assigned, table)
    _add_extra(assigned, table, report)
    return assigned


def _check_some(assigned: Mapping[str, Assignment], table: RawTable) -> None:
    """Refuse a table without time, or without any column whose meaning is known."""
    if "time" in assigned and len(assigned) > 1:
        return
    what = "no column is known" if "time" in assigned else "no time column"
    raise FormatError(
        f"{table.source}: {what}; columns: "
        f"{', '.join(quoted(name) for name in list(table.columns)[:12])}; say what they are in "
        "a column map (--map; elevon import --guess --out writes a first one)"
    )


def settle_positions(
    assigned: dict[str, Assignment],
    table: RawTable,
    time: Floats,
    keep: IntArray,
    gear_ratio: float | None,
    *,
    report: ImportReport,
) -> None:
    """Give the positions their factors, and check those the caller stated; errors as the settlers.

    `time` and `keep` are the clock's instants and the rows they stand in; `gear_ratio` in rad of
    the motor for one rad or m of the output, None where nobody says it.
    """
    speeds = [
        item.values(table)[keep] * (item.factor or 1.0)
        for role in ("motor_speed", "speed_ref")
        if (item := playing(assigned, role)) is not None
    ]
    motor, output = (playing(assigned, f"{which}_position") for which in ("motor", "output"))
    reference, trusted = None, False
    if motor is not None:
        values, stated = motor.values(table)[keep], motor.factor
        motor.factor, trusted = settle_motor(
            _statement(motor), time, values, speeds, report, name=motor.signal
        )
        motor.factor = motor.factor if stated is None else stated
        reference = values * motor.factor
    elif speeds:
        reference, trusted = travel_from_speed(time, speeds[0]), True
    if output is None or (gear_ratio is None and output.factor is not None):
        return
    stated = output.factor
    values = output.values(table)[keep]
    if reference is None:
        reference = 0.0 * values
    output.factor, _ = settle_encoder(
        _statement(output),
        reference,
        values,
        gear_ratio or 1.0,
        report,
        trusted=trusted and gear_ratio is not None,
        name=output.signal,
    )
    output.factor = output.factor if stated is None else stated


def _statement(assignment: Assignment) -> PositionStatement:
    per_rad = None if assignment.factor is None else 1.0 / assignment.factor
    return PositionStatement(quoted(assignment.column), per_rad)


def _mapped(entry: ColumnEntry, table: RawTable, gear_ratio: float | None) -> Assignment:
    known = known_roles()[entry.role] if entry.role else known_signals().get(entry.channel)
    stated = entry.unit if entry.unit is not None else table.units.get(entry.name)
    if stated and known:
        stated = drive_unit(stated, known.units)
    place = f"{table.source}: column {quoted(entry.name)}"
    expected = unit_among(known.units if known else (stated or "1",), stated, place)
    unit = parse_unit(stated or expected, place)
    factor = float(unit.to_si(1.0) - unit.to_si(0.0)) * entry.sign * entry.scale
    offset = float(unit.to_si(0.0))
    if entry.shaft is not None:
        if known is None or not known.shaft or parse_unit(expected).dimension[0] == 1:
            raise InputError(f"{place}: {entry.channel} belongs to no shaft")
        if entry.shaft != known.shaft:
            if gear_ratio is None:
                raise InputError(f"{place}: shaft = {entry.shaft!r} needs the map's gear_ratio")
            power = {"angle": 1.0, "torque": -1.0}[known.scaled]
            factor *= gear_ratio ** (power if entry.shaft == "slow" else -power)
    return Assignment(
        entry.channel,
        entry.name,
        factor,
        si_unit(expected),
        offset,
        "" if entry.role_name == "time" else entry.role_name,
        entry.subtract_from,
    )


def _add_drive(assigned: dict[str, Assignment], table: RawTable) -> None:
    """Recognise the drive's columns among those that no map names."""
    used = {item.column for item in assigned.values()}
    free = {name: values for name, values in table.columns.items() if name not in used}
    entries = drive_columns()
    covered = {
        key
        for key, entry in entries.items()
        if entry.channel in assigned or (entry.role_name and playing(assigned, entry.role_name))
    }
    others = RawTable(table.source, free or table.columns, table.units)
    for key, name in find_drive_columns(others, given=covered).items():
        entry = entries[key]
        if key in covered or name in used:
            continue
        stated = table.units.get(name) or entry.unit
        item = _mapped(entry.model_copy(update={"name": name, "unit": stated}), table, None)
        if not stated:
            item.factor = None  # settled by what the log itself shows
        assigned[entry.channel] = item


def _add_named(assigned: dict[str, Assignment], table: RawTable) -> None:
    """Columns that carry a signal's or a role's own name, in the unit the file states, else SI."""
    used = {item.column for item in assigned.values()}
    for name in table.columns:
        signal = name.strip().lower()
        if name in used or signal in assigned:
            continue
        if signal not in known_signals() and signal not in known_roles():
            continue
        entry = (
            ColumnEntry(name=name, signal=signal)
            if signal in known_signals()
            else ColumnEntry(name=name, role=signal)
        )
        item = _mapped(entry, table, None)
        if item.role and playing(assigned, item.role):
            item.role = ""
        assigned[signal] = item


def _add_extra(assigned: dict[str, Assignment], table: RawTable, report: ImportReport) -> None:
    used = {assignment.column for assignment in assigned.values()}
    for name in table.columns:
        if name in used:
            continue
        signal = safe_name(name, set(assigned))
        stated = table.units.get(name, "")
        report.say(signal, "extra-column", quoted(name))
        if stated:
            report.say(signal, "extra-unit", quoted(stated))
        assigned[signal] = Assignment(signal, name, 1.0, "1")


def rms_to_peak(assigned: dict[str, Assignment]) -> list[str]:
    """Turn the drive's currents and voltage from rms to peak; return the signals concerned."""
    changed = []
    for signal, assignment in assigned.items():
        known = known_roles().get(assignment.role)
        if known is not None and known.drive_current and assignment.factor is not None:
            assignment.factor *= math.sqrt(2.0)
            changed.append(signal)
    return changed
