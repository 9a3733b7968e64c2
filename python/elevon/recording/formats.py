"""The file formats of recordings, chosen by the file's ending."""

from __future__ import annotations

import os
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

from elevon.errors import FormatError, InputError, UnknownNameError, nearest, unknown
from elevon.files import atomic_path, check_output
from elevon.recording import csv
from elevon.recording.contents import Contents
from elevon.recording.csv import description_path

if TYPE_CHECKING:
    from elevon.recording.recording import Recording

_MODULES = {".parquet": "parquet", ".nc": "netcdf", ".csv": "csv", ".mat": "mat"}
ENDINGS = tuple(_MODULES)


class _Format(Protocol):
    """What each format module offers."""

    def write(self, recording: Recording, path: Path) -> None:
        """Write to a new file; `InputError` if the recording does not fit."""

    def read(self, path: Path, max_bytes: int) -> Contents:
        """Read it back."""


def save(recording: Recording, path: str | os.PathLike[str], *, force: bool = False) -> Path:
    """Write the recording to a file, whole or not at all.

    Parameters
    ----------
    path : path
        The ending chooses the format: ``.parquet``, ``.nc``, ``.mat`` (version 5, at most
        2 GB), ``.csv`` (a plain table with ``NAME.csv.json`` beside it; several clocks: one
        table ``NAME.CLOCK.csv`` each). All give back every bit on load.
    force : bool
        Whether an existing file may be replaced.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    UnknownNameError
        Another ending.
    InputError
        Something this format cannot hold.
    OutputError
        The file exists already or cannot be written.
    """
    target = Path(path).expanduser()
    if check_ending(target) == ".csv":
        csv.save(recording, target, force=force)
        return target
    check_output(target, force=force)
    with atomic_path(target, force=force) as temporary:
        _format(target).write(recording, temporary)
    return target


def load(path: str | os.PathLike[str], *, max_bytes: int) -> Contents:
    """Read what a file holds; see `Recording.load`."""
    source = Path(path).expanduser()
    check_ending(source)
    try:
        if not files_of(source):
            near = _neighbours(source)
            raise InputError(f"{source}: no such file{near}")
        return _format(source).read(source, max_bytes)
    except OSError as error:
        raise FormatError(f"{source}: cannot be read: {error}") from error


def files_of(path: Path) -> list[Path]:
    """Return the files of a saved recording: a CSV has a description beside each table."""
    if path.suffix.lower() != ".csv":
        return [path] if path.is_file() else []
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


def _format(path: Path) -> _Format:
    name = _MODULES[check_ending(path)]
    return cast("_Format", import_module(f"elevon.recording.{name}"))


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
