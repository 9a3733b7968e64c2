"""A log whose columns nobody has stated: read by its headers, else by a guess of its columns."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

from elevon.documents import Document, validated
from elevon.errors import FormatError, InputError
from elevon.logs.formats.detect import read_table
from elevon.logs.importing import ImportedLog, import_log
from elevon.logs.maps.column_map import ColumnMap, find_map
from elevon.logs.maps.guess import Guess, guess_map
from elevon.logs.maps.guess_write import guess_text

#: Roles that a motion is judged by: one of each is enough to leave the headers as they are.
_ENOUGH = (
    ("command", "speed_ref"),
    ("torque_current", "current_ref"),
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

    Raises
    ------
    InputError, FormatError
        As `import_log`; no column that could be the time.
    """
    mapped = find_map(column_map) if isinstance(column_map, (str, Path)) else column_map

    def read(by: ColumnMap | None) -> ImportedLog:
        return import_log(path, column_map=by, loadcell=loadcell, command=command)

    if mapped is not None:
        return ForeignLog(read(mapped), mapped)
    try:
        plain = read(None)
    except FormatError:
        plain = None
    if plain is not None and (plain.report.file_format == "recording" or _says_enough(plain)):
        return ForeignLog(plain)
    guess = guess_map(read_table(path))
    try:
        by_guess = read(map_of(guess))
    except InputError as error:
        raise FormatError(
            f"{path}: its columns were guessed, and the guess does not hold: {error}; "
            f"elevon import {path} --guess map.toml writes it; corrected, it is given with --map"
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
