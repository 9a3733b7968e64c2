"""Logs read from files, with what stands beside them."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, cast

from elevon.documents import Document, validated
from elevon.errors import FormatError, InputError, QuestionError
from elevon.logs.command.note import CommandNote, read_command_note
from elevon.logs.drive import drive_log
from elevon.logs.formats.detect import read_table
from elevon.logs.formats.frames import Source, table_of
from elevon.logs.formats.table import RawTable
from elevon.logs.importing import ImportedLog, find_sidecars, import_table, same_rate, saved_log
from elevon.logs.log import Log
from elevon.logs.maps.column_map import ColumnMap, find_map, looks_like_drive
from elevon.logs.maps.guess import Guess, guess_map, guess_text
from elevon.logs.report import ImportReport
from elevon.option import Option
from elevon.recording import Recording

#: A column map, its file or its name; None where the headers say what is what.
MapLike = ColumnMap | str | Path | None
#: One log or several, read already or by their files.
LogsLike = Annotated[
    Log | str | os.PathLike[str] | Sequence[Log | str | os.PathLike[str]], Option(reads="logs")
]


@dataclass(frozen=True)
class Answers:
    """Answers to what a guess asks.

    Attributes
    ----------
    drive : str or None
        Which of several drives in the file.
    roles : mapping of str to str
        Role to the column that has it.
    """

    drive: str | None = None
    roles: Mapping[str, str] = field(default_factory=dict)


NO_ANSWERS = Answers()


def read_log(
    path: Source,
    map: MapLike = None,  # noqa: A002 - the option's name
    note: str | Path | None = None,
    loadcell: str | Path | None = None,
    *,
    gear_ratio: float | None = None,
    sidecars: bool = True,
    drive: str | None = None,
    roles: Mapping[str, str] | None = None,
) -> Log:
    """Read a log, or a recording of the package's own.

    Parameters
    ----------
    path : path, DataFrame, Dataset or mapping of str to array_like
        A file in any format that `elevon.logs.importing.import_log` reads; or the columns
        themselves: a DataFrame of pandas or polars, a Dataset of xarray, arrays by name. Masked
        and missing values become gaps.
    map : ColumnMap or path, optional
        What the columns are. Without one they are guessed from data, units and headers.
    note, loadcell : path, optional
        Command note and load-cell file; by default those that stand beside the log.
    gear_ratio : float, optional
        Motor over output.
    sidecars : bool
        Whether files beside the log are looked for.
    drive : str, optional
        Which drive, where the file holds several.
    roles : mapping of str to str, optional
        Role to the column that has it, where the guess leaves it open.

    Returns
    -------
    Log
        SI, by roles.

    Raises
    ------
    QuestionError
        The columns leave open which one has a role, or which drive is meant.
    InputError, FormatError
        Anything in the files that cannot be read as one consistent log.
    """
    answers = Answers(drive, roles or {})
    return log_of(
        imported_log(path, map, note, loadcell, gear_ratio=gear_ratio, sidecars=sidecars,
                  answers=answers)
    )  # fmt: skip


def log_of(imported: ImportedLog) -> Log:
    """Return an imported log by its roles."""
    report = imported.report
    warnings = [f"{f.place}: {f.text}" for f in report.findings if f.level == "warning"]
    name = Path(report.source).name
    return Log.of(imported.recording, name, note=imported.note, warnings=warnings)


def read_logs(
    paths: Sequence[str | Path],
    map: MapLike | Sequence[MapLike] = None,  # noqa: A002 - as `read_log`
    *,
    loadcells: Sequence[str | Path | None] = (),
    notes: Sequence[str | Path | None] = (),
    one_rate: bool = False,
    answers: Answers = NO_ANSWERS,
) -> list[Log]:
    """Read several logs; of those with one name the folder stands before it.

    Parameters
    ----------
    paths : sequence of path
        As `read_log`.
    map : ColumnMap or path, or a sequence of them, optional
        For all of them, or one for each.
    loadcells, notes : sequence of path or None
        One for each log, or none at all.
    one_rate : bool
        Refuse logs of different rates.
    answers : Answers
        To what the guess of their columns asks.

    Raises
    ------
    InputError
        Two rates, or as `read_log`.
    """
    cells = [*loadcells, *[None] * len(paths)]
    texts = [*notes, *[None] * len(paths)]
    one = map is None or isinstance(map, (ColumnMap, str, Path))
    maps = cast("list[MapLike]", [map] * len(paths) if one else list(map))  # type: ignore[arg-type]
    read = [
        imported_log(p, maps[k], texts[k], cells[k], answers=answers) for k, p in enumerate(paths)
    ]
    if one_rate:
        same_rate(read)
    return named_apart(read)


def named_apart(read: Sequence[ImportedLog]) -> list[Log]:
    """Return imported logs by their roles; before one name of several stands the folder."""
    logs = [log_of(item) for item in read]
    names = [log.name for log in logs]
    return [
        replace(log, name=f"{Path(item.report.source).resolve().parent.name}/{log.name}")
        if names.count(log.name) > 1
        else log
        for item, log in zip(read, logs, strict=True)
    ]


def read_drive_logs(
    paths: Sequence[str | Path],
    map: MapLike = None,  # noqa: A002 - as `read_log`
    *,
    loadcells: Sequence[str | Path | None] = (),
    notes: Sequence[str | Path | None] = (),
    one_rate: bool = True,
) -> list[Log]:
    """Read logs of a drive, each as `elevon.logs.drive.drive_log` makes it; as `read_logs`."""
    logs = read_logs(paths, map, loadcells=loadcells, notes=notes, one_rate=one_rate)
    return [drive_log(log) for log in logs]


def imported_log(
    path: Source,
    column_map: MapLike = None,
    note: str | Path | None = None,
    loadcell: str | Path | None = None,
    *,
    gear_ratio: float | None = None,
    sidecars: bool = True,
    answers: Answers = NO_ANSWERS,
) -> ImportedLog:
    """Read a file or columns in memory into a recording; parameters and errors as `read_log`."""
    if not isinstance(path, (str, os.PathLike)):
        table = table_of(path)
        mapped = find_map(column_map) if isinstance(column_map, (str, Path)) else column_map
        known = None if note is None else read_command_note(note)
        return settled(_by_headers(table, mapped, known, loadcell, answers=answers))
    try:
        read = import_foreign(
            Path(path), column_map, loadcell=loadcell, command=note, gear_ratio=gear_ratio,
            sidecars=sidecars, answers=answers,
        )  # fmt: skip
        return settled(read)
    except QuestionError:
        raise
    except (FormatError, InputError):
        if column_map is not None or note is not None or loadcell is not None:
            raise
        try:  # a table of ours without the file beside it
            recording = Recording.load(path)
        except (FormatError, InputError):
            recording = None
        if recording is None:
            raise
    return ImportedLog(recording, ImportReport(str(path), "recording"), None)


def settled(read: ForeignLog) -> ImportedLog:
    """Return a log whose columns leave no question open.

    Raises
    ------
    QuestionError
        One that is open; the option that answers it is named.
    """
    if read.guess is not None:
        for question in read.guess.questions:
            raise QuestionError(f"{read.guess.source}: {question.text}")
    return read.imported


def as_logs(given: LogsLike) -> list[Log]:
    """Return logs: as given, or read from their files, each name once.

    Raises
    ------
    InputError
        No log, two of one name, or as `read_log`.
    """
    items = [given] if isinstance(given, (Log, str, os.PathLike)) else list(given)
    paths = [item for item in items if not isinstance(item, Log)]
    read = iter(read_logs([Path(path) for path in paths]) if paths else ())
    logs = [item if isinstance(item, Log) else next(read) for item in items]
    names = [log.name for log in logs]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"two logs are named {twice}; give them different names")
    return logs


#: Roles that a motion is judged by: one of each is enough to leave the headers as they are.
_ENOUGH = (
    ("command", "speed_ref"),
    ("torque_current", "current_ref", "effort"),
    ("output_position", "motor_position", "motor_speed", "output_speed"),
)


@dataclass(frozen=True)
class ForeignLog:
    """A log and how its columns were found.

    Attributes
    ----------
    imported : ImportedLog
        Recording and report.
    column_map : ColumnMap or None
        As given or guessed; None where the headers say what is what.
    guess : Guess or None
        With a reason for each column, where it was guessed.
    """

    imported: ImportedLog
    column_map: ColumnMap | None = None
    guess: Guess | None = None


def import_foreign(
    path: str | Path,
    column_map: ColumnMap | str | Path | None = None,
    *,
    loadcell: str | Path | None = None,
    command: str | Path | None = None,
    gear_ratio: float | None = None,
    sidecars: bool = True,
    answers: Answers = NO_ANSWERS,
) -> ForeignLog:
    """Read a log by a map, by its headers, or by a guess where these say too little.

    Parameters
    ----------
    path : path
        In any format that `elevon.logs.importing.import_log` reads.
    column_map : ColumnMap, path or str, optional
        What the columns are.
    loadcell, command : path, optional
        Load-cell file and command note; by default those that stand beside the log.
    gear_ratio : float, optional
        Motor over output.
    sidecars : bool
        Whether files beside the log are looked for.
    answers : Answers
        Which drive, and which column has which role, where the guess asks.

    Raises
    ------
    InputError, FormatError
        As `import_log`; no column that could be the time.
    """
    mapped = find_map(column_map) if isinstance(column_map, (str, Path)) else column_map
    saved = None if mapped is not None else saved_log(path, "auto")
    if saved is not None:
        return ForeignLog(
            saved if command is None else replace(saved, note=read_command_note(command))
        )
    near_cell, near_note = find_sidecars(path) if sidecars else (None, None)
    note_path = command or near_note
    note = None if note_path is None else read_command_note(note_path)
    return _by_headers(
        read_table(path), mapped, note, loadcell or near_cell, gear_ratio=gear_ratio,
        answers=answers,
    )  # fmt: skip


def _by_headers(
    table: RawTable,
    mapped: ColumnMap | None,
    note: CommandNote | None,
    loadcell: str | Path | None,
    *,
    gear_ratio: float | None = None,
    answers: Answers = NO_ANSWERS,
) -> ForeignLog:
    """Import a table by its map, its headers or a guess; as `import_foreign`."""

    def read(by: ColumnMap | None) -> ImportedLog:
        return import_table(table, by, note, loadcell, gear_ratio=gear_ratio)

    if mapped is not None:
        return ForeignLog(read(mapped), mapped)
    plain = None
    if not answers.drive and not answers.roles:
        try:
            plain = read(None)
        except FormatError:
            if looks_like_drive(table):
                raise  # the columns are known by the drive's own numbers: the file is at fault
        if plain is not None and _says_enough(plain):
            return ForeignLog(plain)
    guess = guess_map(table, drive=answers.drive, answers=answers.roles)
    try:
        by_guess = read(map_of(guess))
    except InputError as error:
        raise FormatError(
            f"{table.source}: its columns were guessed, and the guess does not hold: {error}; "
            f"elevon import {table.source} --guess --out map.toml writes it; corrected, it is "
            "given with --map"
        ) from error
    if plain is not None and len(plain.recording.roles) >= len(by_guess.recording.roles):
        return ForeignLog(plain)
    return ForeignLog(by_guess, map_of(guess), guess)


def map_of(guess: Guess) -> ColumnMap:
    """Return the column map that a guess is written as."""
    text = guess_text(guess)
    data = tomllib.loads(text)
    return validated(ColumnMap, data, Document(f"the guess of {guess.source}", text, data))


def _says_enough(log: ImportedLog) -> bool:
    roles = log.recording.roles.keys()
    return all(any(role in roles for role in needed) for needed in _ENOUGH)
