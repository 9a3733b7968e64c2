"""Tables of (time, value) points given inline or in a CSV file: read and checked."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from elevon.errors import FormatError, InputError
from elevon.files import read_regular

LONGEST = 256 * 2**20
"""Bytes of a table of points: some ten million rows."""

Points = tuple[tuple[float, ...], tuple[float, ...]]


def check_series(
    times: Sequence[float], values: Sequence[float], place: str
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Check the points of a table and return them as arrays, shape (n,).

    Raises
    ------
    InputError
        Lengths differ, there is no point, a number is not finite, or the times do not increase;
        the message names the first offending row.
    """
    import numpy as np

    if len(times) != len(values):
        raise InputError(f"{place}: {len(times)} times but {len(values)} values")
    if not len(times):
        raise InputError(f"{place}: the table has no points")
    try:
        t, v = np.asarray(times, dtype=np.float64), np.asarray(values, dtype=np.float64)
    except OverflowError as error:
        raise InputError(f"{place}: a whole number is too large for a float") from error
    for name, array in (("times", t), ("values", v)):
        if not np.isfinite(array).all():
            row = int(np.flatnonzero(~np.isfinite(array))[0])
            raise InputError(f"{place}: {name}[{row}] = {array[row]} is not a finite number")
    falls = np.flatnonzero(np.diff(t) <= 0.0)
    if falls.size:
        row = int(falls[0]) + 1
        raise InputError(
            f"{place}: the times must increase, but times[{row}] = {t[row]:g} "
            f"follows {t[row - 1]:g}"
        )
    return t, v


def read_series(path: str | os.PathLike[str], place: str) -> Points:
    """Read a CSV file of two columns, time and value, with or without a line of titles.

    Raises
    ------
    InputError
        The file cannot be read.
    FormatError
        A row does not hold two numbers; the message names file and line.
    """
    if not isinstance(path, str | os.PathLike):
        raise InputError(f"{place}: {path!r} is not the path of a file")
    file = Path(path).expanduser()
    try:
        stamp = file.stat().st_mtime_ns
        return _read(file, stamp, place)
    except OSError as error:
        raise InputError(f"{place}: {file} cannot be read: {error.strerror or error}") from error


@lru_cache(maxsize=16)
def _read(file: Path, stamp: int, place: str) -> Points:  # noqa: ARG001 - a changed file is read anew
    try:
        text = read_regular(file, LONGEST).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(f"{place}: {file}: is not UTF-8 text") from error
    except InputError as error:
        raise type(error)(f"{place}: {error}") from error
    return _points(csv.reader(io.StringIO(text, newline="")), file, place)


def _points(rows: Iterable[Sequence[str]], file: Path, place: str) -> Points:
    times: list[float] = []
    values: list[float] = []
    for line, row in enumerate(rows, start=1):
        cells = [cell.strip() for cell in row]
        if not any(cells) or cells[0].startswith("#"):
            continue
        numbers = [_number(cell) for cell in cells]
        if line == 1 and all(number is None for number in numbers):
            continue
        if len(cells) != 2 or numbers[0] is None or numbers[1] is None:
            raise FormatError(
                f"{place}: {file}:{line}: expected two numbers (time, value), "
                f"found {','.join(row)!r}"
            )
        times.append(numbers[0])
        values.append(numbers[1])
    return tuple(times), tuple(values)


def _number(cell: str) -> float | None:
    try:
        number = float(cell)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
