"""How large a log may be: logs come from outside, so every reader is bounded before it reads."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

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
