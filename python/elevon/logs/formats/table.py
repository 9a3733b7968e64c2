"""The raw table every reader returns: named columns of numbers, before any meaning is given."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, cast

import numpy as np

from elevon.arrays import Floats
from elevon.errors import FormatError, InputError, quoted


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds of one log.

    Attributes
    ----------
    file_bytes : int
        Largest file on disk.
    values : int
        Most numbers (rows x columns) after expansion, whatever the compression; 8 bytes each.
    columns : int
        Most columns.
    line_bytes : int
        Longest line of a text file.
    """

    file_bytes: int = 2_000_000_000
    values: int = 30_000_000
    columns: int = 256
    line_bytes: int = 65_536

    def check_shape(self, place: str, rows: int, columns: int) -> None:
        """Refuse a table that is too large, before any of it is held in memory.

        Raises
        ------
        FormatError
            More columns or more numbers than allowed.
        """
        if columns > self.columns:
            raise FormatError(f"{place}: {columns} columns, more than the limit of {self.columns}")
        if rows * columns > self.values:
            raise FormatError(
                f"{place}: {rows} rows x {columns} columns is more than the limit of "
                f"{self.values} numbers"
            )

    def check_bytes(self, place: str, count: int) -> None:
        """Refuse expanded content larger than the numbers it may hold; errors as `check_shape`."""
        if count > 8 * self.values:
            raise FormatError(
                f"{place}: expands to {count} bytes or more, over the limit of {8 * self.values}"
            )


DEFAULT_LIMITS = Limits()


def existing_file(path: str | Path, limits: Limits = DEFAULT_LIMITS) -> Path:
    """Return the path of a readable, non-empty regular file within the size limit.

    Raises
    ------
    InputError
        No such file, not a regular file (a folder, a pipe), or not readable.
    FormatError
        Empty, or larger than `limits.file_bytes`.
    """
    file = Path(path).expanduser()
    try:
        if not file.exists():
            raise InputError(f"{file}: no such file")
        if not file.is_file():
            raise InputError(f"{file}: is not a regular file")
        size = file.stat().st_size
        with file.open("rb"):
            pass
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(f"{quoted(str(file))}: cannot be read: {error}") from error
    if size == 0:
        raise FormatError(f"{file}: is empty")
    if size > limits.file_bytes:
        raise FormatError(f"{file}: {size} bytes, more than the limit of {limits.file_bytes}")
    return file


GZIP = b"\x1f\x8b"


@contextmanager
def open_bytes(path: Path) -> Iterator[IO[bytes]]:
    """Open a file for streaming; a gzip file is expanded as it is read, never at once.

    Raises
    ------
    FormatError
        The compressed stream is damaged or cut.
    InputError
        The file cannot be read.
    """
    try:
        if head(path, 2) == GZIP:
            with gzip.open(path, "rb") as packed:
                yield cast("IO[bytes]", packed)
        else:
            with path.open("rb") as plain:
                yield plain
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise FormatError(f"{path}: damaged gzip file: {error}") from error
    except OSError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: cannot be read: {error}") from error


def head(path: Path, count: int) -> bytes:
    """Return the first bytes of a file."""
    try:
        with path.open("rb") as stream:
            return stream.read(count)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error}") from error


_LARGEST = 1e100  # beyond it squares overflow; nothing measured comes near


@dataclass(frozen=True, slots=True)
class RawTable:
    """Columns of a log as they stand in the file.

    Attributes
    ----------
    source : str
        The file's path.
    columns : mapping of str to ndarray, shape (rows,)
        Float64, all of one length; a missing cell is NaN.
    units : mapping of str to str
        Units the file itself states, by column.
    notes : tuple of str
        What the reader saw and the caller should know (encoding, decimal comma, skipped variables).
    file_format : str
        Which reader it was.
    attributes : mapping of str to str
        Text the file carries beside the columns (labels, metadata), already bounded.
    """

    source: str
    columns: Mapping[str, Floats]
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    file_format: str = "csv"
    attributes: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        lengths = {values.shape for values in self.columns.values()}
        if len(lengths) > 1:
            raise FormatError(f"{self.source}: columns of different lengths {sorted(lengths)}")
        if not self.columns:
            raise FormatError(f"{self.source}: no column of numbers")
        for name, values in self.columns.items():
            bad = ~np.isnan(values) & ~(np.abs(values) < _LARGEST)
            if bad.any():
                row = int(np.argmax(bad))
                raise FormatError(
                    f"{self.source}, row {row + 1}, column {quoted(name)}: {values[row]:g} is no "
                    "finite number that anything could measure"
                )

    @property
    def rows(self) -> int:
        """Number of rows."""
        return int(next(iter(self.columns.values())).shape[0])


def unique_names(source: str, names: Iterable[str]) -> list[str]:
    """Return the names stripped, refusing an empty one and one that occurs twice.

    Raises
    ------
    FormatError
        A column without a name, or two columns of the same name.
    """
    result: list[str] = []
    for position, raw in enumerate(names, start=1):
        name = raw.strip()
        if not name:
            raise FormatError(f"{source}: column {position} has no name")
        if name in result:
            raise FormatError(
                f"{source}: columns {result.index(name) + 1} and {position} are both named "
                f"{quoted(name)}"
            )
        result.append(name)
    return result


def split_unit(name: str) -> tuple[str, str]:
    """Split ``"speed [rpm]"`` or ``"speed (rpm)"`` into name and unit; the unit may be empty.

    A bracket that holds only digits is an index (``r482[1]``), not a unit.
    """
    text = name.strip()
    for opening, closing in (("[", "]"), ("(", ")")):
        if text.endswith(closing) and opening in text:
            head, _, unit = text[:-1].rpartition(opening)
            if head.strip() and not unit.strip().isdigit():
                return head.strip(), unit.strip()
    return text, ""
