"""From loose vectors (MATLAB, HDF5, NetCDF) to one table: those as long as the time vector."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from elevon.arrays import Floats
from elevon.errors import FormatError, quoted
from elevon.logs.formats.limits import Limits
from elevon.logs.formats.table import RawTable

#: A matrix with at most so many columns, and at least so many rows a column, holds signals side by
#: side (ASSUMED): what is nearer to a square is something else.
_MOST_SIGNALS, _ROWS = 64, 10
_TIMES = ("xms", "time", "t", "time_s", "time_ms", "timems", "x")


@dataclass
class Vectors:
    """Vectors of numbers as a file holds them; those of one length become its table.

    Attributes
    ----------
    source : str
        The file.
    limits : Limits
        Bounds on size.
    values : dict of str to ndarray
        The vectors, by name; the length that the time has, or else the longest, is the table's.
    units : dict of str to str
        Units that the file states.
    notes : list of str
        What was passed over.
    size : int
        Numbers so far.
    """

    source: str
    limits: Limits
    values: dict[str, Floats] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    size: int = 0

    def pass_over(self, name: str, why: str) -> None:
        """Note what is no vector of numbers."""
        self.notes.append(f"{quoted(name)} passed over: {why}")

    def add(self, name: str, numbers: Floats, unit: str = "") -> None:
        """Add a vector, or signals side by side.

        Raises
        ------
        FormatError
            A name that is there, or more numbers than the limits allow.
        """
        several = signals_side_by_side(numbers.shape)
        signals = columns_of(name, numbers) if several else {name: numbers.reshape(-1)}
        for label, vector in signals.items():
            if label in self.values:
                raise FormatError(f"{self.source}: two variables are named {quoted(label)}")
            self.size += len(vector)
            self.limits.check_shape(self.source, self.size, 1)
            self.values[label] = vector
            if unit:
                self.units[label] = unit

    def table(self, file_format: str) -> RawTable:
        """Return the vectors of one length as a table.

        Raises
        ------
        FormatError
            No vector, or empty ones.
        """
        if not self.values:
            raise FormatError(f"{self.source}: no vector of numbers")
        length = _length(self.values)
        if length == 0:
            raise FormatError(f"{self.source}: the vectors are empty")
        aligned = {n: quiet(values) for n, values in self.values.items() if len(values) == length}
        for name in self.values.keys() - aligned.keys():
            self.pass_over(name, f"{len(self.values[name])} values, not {length}")
        self.limits.check_shape(self.source, length, len(aligned))
        last = [name.rpartition("/")[2] for name in aligned]
        short = {
            name: tail if last.count(tail) == 1 else name
            for name, tail in zip(aligned, last, strict=True)
        }
        columns = {short[name]: values for name, values in aligned.items()}
        stated = {short[name]: unit for name, unit in self.units.items() if name in aligned}
        return RawTable(self.source, columns, stated, tuple(self.notes), file_format)


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
