"""A log made into a recording, with a report of everything seen on the way."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from elevon.arrays import Floats
from elevon.errors import DamageError, FormatError, InputError, RangeError, VersionError
from elevon.logs.clocks.clock_fit import ClockQuality, clipped_share, clock_quality, stuck_spans
from elevon.logs.clocks.loadcell_join import join_loadcell
from elevon.logs.command.note import CommandNote, read_command_note
from elevon.logs.command.reconstruct import SPEED_LIMIT
from elevon.logs.formats.detect import read_table
from elevon.logs.formats.table import DEFAULT_LIMITS, Limits, RawTable
from elevon.logs.formats.vectors import has_variable
from elevon.logs.maps.agreement import check_agreement
from elevon.logs.maps.assign import Assignment, assign_columns, rms_to_peak, settle_positions
from elevon.logs.maps.column_map import ColumnMap, find_map, looks_like_drive, shipped_map
from elevon.logs.report import ImportReport
from elevon.recording import Recording
from elevon.recording.csv import describes, description_path, joined_tables
from elevon.scenario import Scenario

_CLIP_SHARE = 0.01
_FREE_TRAVEL = 0.08  # rad at the output: more than the widest backlash the bench can set (0.0457)
_CLIPPING = {"speed_ref", "motor_speed", "current_ref", "torque_current", "direct_current",
             "torque_voltage", "load_cell"}  # fmt: skip


def examine_channels(recording: Recording, ratio: float | None, report: ImportReport) -> None:
    """Add findings about every channel of the drive's clock.

    Parameters
    ----------
    recording : Recording
        SI, with roles.
    ratio : float or None
        Motor over output, where it is known.
    report : ImportReport
        Findings are added to it.
    """
    values = {channel.name: channel.values for channel in recording.channels}
    roles = {name: role for role, name in recording.roles.items()}
    for name, data in values.items():
        missing = int(np.isnan(data).sum())
        if missing == len(data):
            report.say(name, "empty")
            continue
        if missing:
            report.say(name, "missing", missing, len(data))
        _constant(name, data, values, report)
        if roles.get(name) in _CLIPPING:
            _clipping(name, data, report, limited=roles[name] == "speed_ref")
    if ratio is not None and {"motor_position", "output_position"} <= recording.roles.keys():
        _stuck(recording, ratio, report)


def _constant(name: str, data: Floats, values: Mapping[str, Floats], report: ImportReport) -> None:
    good = data[np.isfinite(data)]
    moved = any(
        np.nanmax(v) > np.nanmin(v)
        for other, v in values.items()
        if other != name and np.isfinite(v).any()
    )
    if good.size > 1 and np.ptp(good) == 0.0 and moved:
        if name == "trigger":
            report.say(name, "no-edge", good[0])
        else:
            report.say(name, "stuck-throughout", good[0])


def _clipping(name: str, data: Floats, report: ImportReport, *, limited: bool) -> None:
    shares = clipped_share(data)
    for share, value in zip(shares, (np.nanmin(data), np.nanmax(data)), strict=True):
        if share <= _CLIP_SHARE or value == 0.0:
            continue
        if limited and abs(abs(value) - SPEED_LIMIT) < 0.01 * SPEED_LIMIT:
            report.say(name, "saturated", np.sign(value) * 500, 100 * share)
        else:
            report.say(name, "clipped", 100 * share, value)


def _stuck(recording: Recording, ratio: float, report: ImportReport) -> None:
    outer, inner = recording.role("output_position"), recording.role("motor_position")
    if outer.unit != "rad":
        return
    both = np.isfinite(inner.values) & np.isfinite(outer.values)
    motor, output = inner.values[both] / ratio, outer.values[both]
    for name, data, drive in ((outer.name, output, motor), (inner.name, motor, output)):
        for start, end in stuck_spans(outer.time[both], data, drive, _FREE_TRAVEL)[:10]:
            report.say(name, "stuck", start, end)


_ROUNDING = 0.6  # ms: a clock written in whole ms jitters by half of one


@dataclass(frozen=True, slots=True)
class ImportedLog:
    """A recording and the report of how it came about."""

    recording: Recording
    report: ImportReport
    note: CommandNote | None

    @property
    def scenario(self) -> Scenario | None:
        """The command, where the log is a simulation's own recording."""
        return _scenario(self.recording, self.report.source)


def find_sidecars(path: str | Path) -> tuple[Path | None, Path | None]:
    """Return ``NAME_loadcell.csv`` and ``NAME_command.json`` (or ``.toml``) beside ``NAME.csv``."""
    file = Path(path).expanduser()
    if not file.name:
        raise InputError(f"{str(path)!r}: is no file name")
    stem = file.name[: -len(file.suffix)] if file.suffix else file.name
    cell = file.with_name(f"{stem}_loadcell.csv")
    notes = [file.with_name(f"{stem}_command{ending}") for ending in (".json", ".toml")]
    present = [note for note in notes if note.is_file()]
    if len(present) > 1:
        raise InputError(f"{present[0]} and {present[1].name} both exist; say which with --command")
    return (cell if cell.is_file() else None), (present[0] if present else None)


def import_log(
    path: str | Path,
    *,
    log_format: str = "auto",
    column_map: ColumnMap | str | Path | None = None,
    loadcell: str | Path | None = None,
    command: str | Path | None = None,
    gear_ratio: float | None = None,
    sidecars: bool = True,
    limits: Limits = DEFAULT_LIMITS,
) -> ImportedLog:
    """Read a log into a recording.

    Parameters
    ----------
    path : path
        The log.
    log_format : str
        One of `elevon.logs.formats.detect.FORMATS` but ``cranfield``, which has a loader of
        its own.
    column_map : ColumnMap or path, optional
        What the columns are, where the headers do not tell.
    loadcell : path, optional
        Load-cell file; by default the one beside the log.
    command : path, optional
        Command note; by default the one beside the log.
    gear_ratio : float, optional
        Motor over output (rad a m for a linear output); else the map's. The traces of the Torino
        drive have a map of their own.
    sidecars : bool
        Whether files beside the log are looked for.
    limits : Limits
        Bounds on size.

    Returns
    -------
    ImportedLog
        Recording on the clock ``drive`` (and ``load_cell``), SI, currents as peak; the report is
        also in its ``meta["import"]``.

    Raises
    ------
    InputError, FormatError
        Anything in the files that cannot be read as one consistent log.
    """
    if log_format in {"auto", "recording"}:
        saved = saved_log(path, log_format)
        if saved is not None:
            return saved if command is None else replace(saved, note=read_command_note(command))
    near_cell, near_note = find_sidecars(path) if sidecars else (None, None)
    note_path = command or near_note
    note = None if note_path is None else read_command_note(note_path)
    mapped = find_map(column_map) if isinstance(column_map, (str, Path)) else column_map
    return import_table(
        read_table(path, log_format, limits), mapped, note, loadcell or near_cell,
        log_format=log_format, gear_ratio=gear_ratio, limits=limits,
    )  # fmt: skip


def import_table(
    table: RawTable,
    mapped: ColumnMap | None = None,
    note: CommandNote | None = None,
    loadcell: str | Path | None = None,
    *,
    log_format: str = "auto",
    gear_ratio: float | None = None,
    limits: Limits = DEFAULT_LIMITS,
) -> ImportedLog:
    """Make a table of columns into a recording; as `import_log`, which reads it from a file.

    Raises
    ------
    InputError, FormatError
        As `import_log`.
    """
    path = table.source
    report = ImportReport(path, table.file_format)
    for text in table.notes:
        report.say("file", "format", text)
    if gear_ratio is None and mapped is None and note is not None:
        gear_ratio = note.gear_ratio
    ratio = gear_ratio_of(gear_ratio, mapped, table, log_format)
    assigned = assign_columns(table, mapped, ratio, report, layout=log_format)
    quality, time = _clock(table, assigned, report)
    settle_positions(assigned, table, time, quality.keep, ratio, report=report)
    drive = log_format == "drive" or (log_format != "csv" and looks_like_drive(table))
    usual = "rms" if drive or mapped is not None else "peak"
    convention = settle_currents(assigned, mapped, note, report, usual=usual)
    recording = _build(table, assigned, quality, time, report=report)
    check_agreement(recording, ratio, report, mapped)
    examine_channels(recording, ratio, report)
    if loadcell is not None:
        recording = join_loadcell(recording, loadcell, note, report, limits, gear_ratio=ratio)
    meta = _meta(path, report, note, ratio, convention)
    if table.attributes:
        meta["notes"] = dict(table.attributes)
    return ImportedLog(recording.with_meta(**meta), report, note)


def same_rate(logs: list[ImportedLog]) -> None:
    """Check that logs imported together run at one rate.

    Raises
    ------
    InputError
        Two rates that differ by more than 1 %; both files are named.
    """
    rates = [(log.report.source, log.report.clocks["drive"]["rate_hz"]) for log in logs]
    for source, rate in rates[1:]:
        if abs(rate - rates[0][1]) > 0.01 * rates[0][1]:
            raise InputError(
                f"{rates[0][0]} runs at {rates[0][1]:.4g} Hz, {source} at {rate:.4g} Hz; "
                "logs used together must have one rate"
            )


def saved_log(path: str | Path, log_format: str) -> ImportedLog | None:
    """Return a recording that this package saved, as it is; None for anything else."""
    file = Path(path).expanduser()
    if log_format == "auto" and not (file.is_file() and _begins_saved(file)):
        return None
    recording = Recording.load(file)
    report = ImportReport(str(path), "recording")
    for name, clock in recording.clocks.items():
        quality = clock_quality(f"{path}, clock {name}", np.asarray(clock.time))
        report.clocks[name] = quality.to_dict()
    for channel in recording.channels:
        report.channels.append(_channel_facts(channel.name, channel.name, channel.values, channel))
    report.clocks.setdefault("drive", next(iter(report.clocks.values()), {}))
    return ImportedLog(recording, report, _own_note(recording, str(path)))


def _own_note(recording: Recording, source: str) -> CommandNote | None:
    """Return what a saved recording says of its command: the note imported with it, or a scenario.

    Files come from outside: what cannot be read as one says nothing.
    """
    noted = recording.meta.get("command_note")
    try:
        if isinstance(noted, Mapping):
            return CommandNote.from_dict(noted, source)
        scenario = _scenario(recording, source)
    except (InputError, TypeError, ValueError):
        return None
    return None if scenario is None else CommandNote.of_scenario(scenario, source)


def _scenario(recording: Recording, source: str) -> Scenario | None:
    stated = recording.meta.get("scenario")
    return Scenario.from_dict(stated, source) if isinstance(stated, Mapping) else None


def _begins_saved(file: Path) -> bool:
    try:
        if file.suffix.lower() == ".csv" and (
            describes(description_path(file)) or joined_tables(file)
        ):
            return True
        with file.open("rb") as stream:
            if stream.read(9) == b"# elevon ":
                return True  # of an earlier version: its reader says what to do
        if file.suffix.lower() == ".mat" and not has_variable(file, "elevon", DEFAULT_LIMITS):
            return False
        if file.suffix.lower() in {".parquet", ".nc", ".mat"}:
            Recording.load(file)
            return True
    except (DamageError, VersionError):
        raise  # ours, and not readable here: no table of somebody else's
    except (InputError, OSError):
        return False
    return False


def gear_ratio_of(
    given: float | None, mapped: ColumnMap | None, table: RawTable, layout: str
) -> float | None:
    """Motor over output, rad a rad or rad a m; None where nobody says it."""
    ratio = given
    if ratio is None and mapped is not None:
        ratio = 2.0 * math.pi / mapped.travel if mapped.travel else mapped.gear_ratio
    if ratio is None and (layout == "drive" or (layout != "csv" and looks_like_drive(table))):
        ratio = shipped_map("torino").gear_ratio
    if ratio is not None and not (math.isfinite(ratio) and ratio > 0.0):
        raise RangeError(f"gear ratio {ratio!r} must be above 0")
    return ratio


def _clock(
    table: RawTable, assigned: dict[str, Assignment], report: ImportReport
) -> tuple[ClockQuality, Floats]:
    base = assigned["time"]
    seconds = table.columns[base.column] * (base.factor or 1.0)
    quality = clock_quality(table.source, seconds)
    report.clocks["drive"] = quality.to_dict()
    if quality.duplicates:
        report.say("drive", "duplicates", quality.duplicates)
    for gap in quality.gaps[:20]:
        report.say("drive", "gap", *gap)
    if 1e3 * quality.jitter_max > _ROUNDING and quality.jitter_max > 0.25 * quality.period:
        report.say("drive", "jitter", 1e3 * quality.jitter_max)
    return quality, seconds[quality.keep]


def settle_currents(
    assigned: dict[str, Assignment],
    mapped: ColumnMap | None,
    note: CommandNote | None,
    report: ImportReport,
    *,
    usual: str = "rms",
) -> str:
    """Settle the convention of the drive's currents: what is stated twice must agree.

    Where nobody states one the `usual` one is taken: of the drive's trace rms, else peak (ASSUMED,
    as a field-oriented drive logs the torque current).
    """
    conventions = {
        c for c in (mapped.current if mapped else None, note.current if note else None) if c
    }
    if len(conventions) > 1:
        raise InputError(
            f"{report.source}: the column map and the command note disagree on the currents "
            "(rms, peak)"
        )
    convention = conventions.pop() if conventions else usual
    changed = rms_to_peak(assigned) if convention == "rms" else []
    stated = (mapped and mapped.current) or (note and note.current)
    if changed:
        name = "convention" if stated else "convention-assumed"
        report.say("currents", name, ", ".join(changed))
    return convention


def _build(
    table: RawTable,
    assigned: dict[str, Assignment],
    quality: ClockQuality,
    time: Floats,
    *,
    report: ImportReport,
) -> Recording:
    values, units = {}, {}
    for signal, item in assigned.items():
        if signal == "time":
            continue
        column = item.values(table)[quality.keep]
        values[signal] = column * (1.0 if item.factor is None else item.factor) + item.offset
        units[signal] = item.unit
    roles = {item.role: signal for signal, item in assigned.items() if item.role}
    recording = Recording.build(
        time, values, units, clock="drive", rate=quality.rate, meta={"roles": roles}
    )
    for signal, item in assigned.items():
        if signal != "time":
            channel = recording[signal]
            facts = _channel_facts(signal, item.column, channel.values, channel)
            report.channels.append(facts | {"factor": item.factor})
    return recording


def _channel_facts(name: str, column: str, values: Any, channel: Any) -> dict[str, Any]:
    good = values[np.isfinite(values)]
    return {
        "name": name,
        "column": column[:100],
        "unit": channel.unit,
        "minimum": float(good.min()) if good.size else None,
        "maximum": float(good.max()) if good.size else None,
        "missing": int(len(values) - good.size),
    }


def _meta(
    path: str | Path,
    report: ImportReport,
    note: CommandNote | None,
    ratio: float | None,
    convention: str,
) -> dict[str, Any]:
    if not report.channels:
        raise FormatError(f"{path}: no channel")
    if note is not None:
        for key in note.ignored:
            report.say("command", "key-ignored", note.source, key)
    return {
        "status": "measured",
        "log": Path(path).name,
        "gear_ratio": ratio,
        "current_convention": convention,
        "command_note": note.to_dict() if note else None,
        "import": report.to_dict(),
    }
