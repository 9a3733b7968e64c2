"""From loose vectors (MATLAB, HDF5, NetCDF) to one table: those as long as the time vector."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from elevon.arrays import Floats
from elevon.errors import FormatError, quoted
from elevon.logs.formats.limits import Limits
from elevon.logs.formats.table import RawTable

#: A matrix with at most so many columns, and at least so many rows a column, holds signals side by
#: side (ASSUMED): what is nearer to a square is something else.
_MOST_SIGNALS, _ROWS = 64, 10
_TIMES = ("xms", "time", "t", "time_s", "time_ms", "timems", "x")


def table_of_vectors(
    source: str,
    vectors: Mapping[str, Floats],
    units: Mapping[str, str],
    notes: Sequence[str],
    *,
    file_format: str,
    limits: Limits,
) -> RawTable:
    """Return the vectors that share the time vector's length; the others are named in the notes.

    Group names are dropped where the last part of the path is unique.

    Raises
    ------
    FormatError
        No vector, or more than the limits allow.
    """
    if not vectors:
        raise FormatError(f"{source}: no vector of numbers")
    length = _length(vectors)
    if length == 0:
        raise FormatError(f"{source}: the vectors are empty")
    aligned = {name: quiet(values) for name, values in vectors.items() if len(values) == length}
    others = [
        f"{quoted(name)} passed over: {len(vectors[name])} values, not {length}"
        for name in vectors.keys() - aligned.keys()
    ]
    limits.check_shape(source, length, len(aligned))
    last = [name.rpartition("/")[2] for name in aligned]
    short = {
        name: tail if last.count(tail) == 1 else name
        for name, tail in zip(aligned, last, strict=True)
    }
    columns = {short[name]: values for name, values in aligned.items()}
    stated = {short[name]: unit for name, unit in units.items() if name in aligned}
    return RawTable(source, columns, stated, (*notes, *others), file_format)


def signals_side_by_side(shape: Sequence[int]) -> bool:
    """Whether a matrix of this shape holds signals, one a column (or a row, where rows are few)."""
    if len(shape) != 2:
        return False
    few, many = sorted(shape)
    return 1 < few <= _MOST_SIGNALS and many >= _ROWS * few


def columns_of(name: str, matrix: Floats) -> dict[str, Floats]:
    """Return the signals of a matrix by name and number, counted from 1 as MATLAB does.

    Parameters
    ----------
    name : str
        The matrix's.
    matrix : ndarray, shape (n, k) or (k, n)
        The longer side is time.
    """
    rows = matrix if matrix.shape[0] >= matrix.shape[1] else matrix.T
    return {f"{name}_{k + 1}": np.ascontiguousarray(rows[:, k]) for k in range(rows.shape[1])}


def quiet(values: Floats) -> Floats:
    """Return the values with every kind of NaN replaced by the plain one.

    A file may hold signalling NaNs, which raise floating-point flags in the next operation.
    """
    missing = np.isnan(values)
    return np.where(missing, np.nan, values) if missing.any() else values


def _length(vectors: Mapping[str, Floats]) -> int:
    for wanted in _TIMES:
        for name, values in vectors.items():
            if name.rpartition("/")[2].lower() == wanted:
                return len(values)
    return max(len(values) for values in vectors.values())
