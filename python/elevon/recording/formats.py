"""The file formats of recordings, chosen by the file's ending."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from elevon.errors import FormatError, InputError, UnknownNameError, nearest, unknown
from elevon.files import atomic_path, check_output
from elevon.recording.contents import Contents

if TYPE_CHECKING:
    from elevon.recording.recording import Recording

ENDINGS = (".parquet", ".nc", ".csv", ".mat")


class _Format(Protocol):
    def check(self, recording: Recording) -> None:
        """Refuse what the format cannot hold, before anything is written."""

    def write(self, recording: Recording, path: Path) -> None:
        """Write to a fresh temporary path."""

    def read(self, path: Path, max_bytes: int) -> Contents:
        """Read a file that nobody vouches for."""


def save(recording: Recording, path: str | os.PathLike[str], *, force: bool) -> Path:
    """Write a recording; see `Recording.save`."""
    target = Path(path).expanduser()
    if check_ending(target) == ".csv":
        from elevon.recording import csv

        csv.save(recording, target, force=force)
        return target
    handler = _handler(target)
    check_output(target, force=force)
    handler.check(recording)
    with atomic_path(target, force=force) as temporary:
        handler.write(recording, temporary)
    return target


def load(path: str | os.PathLike[str], *, max_bytes: int) -> Contents:
    """Read what a file holds; see `Recording.load`."""
    source = Path(path).expanduser()
    check_ending(source)
    try:
        if not files_of(source):
            near = _neighbours(source)
            raise InputError(f"{source}: no such file{near}")
        return _read(source, max_bytes)
    except OSError as error:
        raise FormatError(f"{source}: cannot be read: {error}") from error


def _read(source: Path, max_bytes: int) -> Contents:
    if source.suffix.lower() == ".csv":
        from elevon.recording import csv

        return csv.load(source, max_bytes)
    return _handler(source).read(source, max_bytes)


def files_of(path: Path) -> list[Path]:
    """Return the files of a saved recording: a CSV has a description beside each table."""
    if path.suffix.lower() != ".csv":
        return [path] if path.is_file() else []
    from elevon.recording import csv
    from elevon.recording.description import description_path

    parts = [path] if path.is_file() else csv.joined_tables(path)
    return [file for table in parts for file in (table, description_path(table)) if file.is_file()]


def check_target(path: Path, clocks: Iterable[str], *, force: bool) -> None:
    """Check, before the work, that a recording of these clocks could be saved as `path`.

    Raises
    ------
    UnknownNameError
        The ending is no format.
    OutputError
        A file exists already (a CSV has one a clock, each with a description), or cannot be made.
    """
    if check_ending(path) == ".csv":
        from elevon.recording import csv

        csv.check(path, clocks, force=force)
    else:
        check_output(path, force=force)


def check_ending(path: str | os.PathLike[str]) -> str:
    """Return the ending of a path when it is a recording format.

    Raises
    ------
    UnknownNameError
        It is not; the message lists those that are.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in ENDINGS:
        raise _unknown_ending(Path(path), ENDINGS)
    return suffix


def _handler(path: Path) -> _Format:
    suffix = check_ending(path)
    if suffix == ".parquet":
        from elevon.recording import parquet

        return parquet
    if suffix == ".nc":
        from elevon.recording import netcdf

        return netcdf
    from elevon.recording import mat

    return mat


def _unknown_ending(path: Path, endings: tuple[str, ...]) -> UnknownNameError:
    if not path.suffix:
        return UnknownNameError(f"{path}: has no ending; valid: {', '.join(endings)}")
    return unknown("ending", path.suffix, endings, str(path))


def _neighbours(path: Path) -> str:
    """Name files of nearly the same name in the same folder."""
    try:
        names = [entry.name for entry in path.parent.iterdir() if entry.is_file()]
    except OSError:
        return ""
    near = nearest(path.name, names)
    return f"; did you mean {' or '.join(repr(name) for name in near)}?" if near else ""
