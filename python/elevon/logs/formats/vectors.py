"""From loose vectors (MATLAB, HDF5, NetCDF) to one table: those as long as the time vector."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.containers.hdf import array, datasets, is_hdf5, opened, text_attribute
from elevon.containers.mat5 import Variable, variables
from elevon.containers.parquet import columns, declared_bytes, is_numeric, unit_of
from elevon.containers.parquet import opened as opened_parquet
from elevon.errors import FormatError, quoted
from elevon.logs.formats.table import (
    DEFAULT_LIMITS,
    Limits,
    RawTable,
    existing_file,
    head,
    split_unit,
    unique_names,
)

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
        scalars = {n: repr(float(v[0])) for n, v in self.values.items() if len(v) == 1 < length}
        for name in self.values:
            if name in scalars:
                self.notes.append(f"{quoted(name)} = {scalars[name]} is kept as a note")
            elif name not in aligned:
                self.pass_over(name, f"{len(self.values[name])} values, not {length}")
        self.limits.check_shape(self.source, length, len(aligned))
        last = [name.rpartition("/")[2] for name in aligned]
        short = {
            name: tail if last.count(tail) == 1 else name
            for name, tail in zip(aligned, last, strict=True)
        }
        columns = {short[name]: values for name, values in aligned.items()}
        stated = {short[name]: unit for name, unit in self.units.items() if name in aligned}
        return RawTable(self.source, columns, stated, tuple(self.notes), file_format, scalars)


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


def numeric_vectors(path: Path, limits: Limits) -> Vectors:
    """Return all vectors of numbers of an HDF5 file, with their units.

    Raises
    ------
    FormatError
        A damaged file, or one beyond the limits.
    """
    vectors = Vectors(str(path), limits)
    with opened(path) as file:
        for name, data in datasets(file):
            values = (
                data if isinstance(data, str) else _array(path, name, data, limits, vectors.size)
            )
            if isinstance(values, str):
                vectors.pass_over(name, values)
            else:
                vectors.add(name, values.astype(np.float64), text_attribute(data, "units"))
    return vectors


def _array(
    path: Path, name: str, data: object, limits: Limits, before: int
) -> npt.NDArray[np.generic] | str:
    """Return the numbers of a vector or a long matrix; of anything else say why not."""
    bound = _bound(limits, f"{path}, {quoted(name)}", before, data)
    return array(data, "fiub", bound, also=signals_side_by_side)


def _bound(limits: Limits, place: str, before: int, data: Any) -> Callable[[int], None]:
    """Return the check of a vector's bytes, and of its numbers beside those read before."""

    def check(size: int) -> None:
        limits.check_bytes(place, size)
        limits.check_shape(place, before + int(data.size), 1)

    return check


def read_netcdf(path: str | Path, *, limits: Limits = DEFAULT_LIMITS) -> RawTable:
    """Read the numeric vectors of a NetCDF file, with their ``units`` attributes.

    Raises
    ------
    FormatError
        Not NetCDF, damaged, or larger than the limits.
    """
    file = existing_file(path, limits)
    if is_hdf5(file):
        return numeric_vectors(file, limits).table("netcdf 4")
    if head(file, 4) not in (b"CDF\x01", b"CDF\x02"):
        raise FormatError(f"{file}: not a NetCDF file")
    limits.check_bytes(str(file), file.stat().st_size)
    return _classic(file, limits)


def _classic(file: Path, limits: Limits) -> RawTable:
    from scipy.io import netcdf_file

    vectors = Vectors(str(file), limits)
    try:
        with netcdf_file(str(file), "r", mmap=False) as content:
            for name, variable in content.variables.items():
                data = np.asarray(variable.data)
                if data.dtype.kind not in "fiub" or sum(n > 1 for n in data.shape) > 1:
                    vectors.pass_over(name, "not a vector of numbers")
                    continue
                unit = getattr(variable, "units", b"")
                text = unit.decode("utf-8", "replace")[:40] if isinstance(unit, bytes) else ""
                vectors.add(name, data.astype(np.float64).reshape(-1), text)
    except FormatError:
        raise
    except Exception as error:
        raise FormatError(f"{file}: damaged NetCDF file: {quoted(str(error))}") from error
    return vectors.table("netcdf 3")


def read_matlab(path: str | Path, *, limits: Limits = DEFAULT_LIMITS) -> RawTable:
    """Read the numeric vectors of a .mat file, at the top or inside one plain structure.

    A long matrix is read as its columns, ``name_1``, ``name_2`` and on. Cells, objects, function
    handles, sparse and complex values are named in the notes and never loaded.

    Raises
    ------
    FormatError
        Not a .mat file of version 5 or 7.3, damaged, or larger than the limits after expansion.
    """
    file = existing_file(path, limits)
    if is_hdf5(file):
        return numeric_vectors(file, limits).table("mat 7.3")
    vectors = Vectors(str(file), limits)
    for variable in _bounded(file, limits):
        for label, item in _members(file, variable):
            numbers = _numbers(item)
            if isinstance(numbers, str):
                vectors.pass_over(label, numbers)
            else:
                vectors.add(label, numbers)
    return vectors.table("mat 5")


def has_variable(path: Path, name: str, limits: Limits) -> bool:
    """Whether a version 5 file holds a variable of a name at its top; False for any other file."""
    try:
        with closing(_bounded(path, limits)) as listed:
            return any(variable.name == name for variable in listed)
    except FormatError:
        return False


def _bounded(path: Path, limits: Limits) -> Generator[Variable, None, None]:
    return variables(path, lambda size: limits.check_bytes(str(path), size))


def _members(path: Path, variable: Variable) -> Iterator[tuple[str, Variable]]:
    """Yield the variable itself, or the fields of a structure."""
    if variable.kind != "struct":
        yield variable.name, variable
        return
    for member in variable.fields():
        if member.kind == "struct":
            raise FormatError(
                f"{path}, {quoted(variable.name)}: a structure within a structure cannot be read"
            )
        yield f"{variable.name}/{member.name}", member


def _numbers(item: Variable) -> Floats | str:
    """Return a vector, or signals side by side; a text: why it is neither."""
    if item.kind != "numbers":
        return item.kind
    if item.is_complex:
        return "complex numbers"
    if signals_side_by_side(item.shape):
        return item.numbers().reshape(item.shape, order="F")
    if sum(length != 1 for length in item.shape) > 1:
        return f"neither a vector nor signals side by side, shape {item.shape}"
    return item.numbers()


def read_parquet(path: str | Path, *, limits: Limits = DEFAULT_LIMITS) -> RawTable:
    """Read the numeric columns of a Parquet file; a missing value becomes NaN.

    Units are taken from the field metadata (``unit`` or ``units``) where present. Columns of
    anything but numbers are named in the notes.

    Raises
    ------
    FormatError
        Damaged, empty, or larger than the limits.
    """
    file = existing_file(path, limits)
    with opened_parquet(file) as parquet:
        return _read(str(file), parquet, limits)


def _read(source: str, parquet: Any, limits: Limits) -> RawTable:
    schema = parquet.schema_arrow
    fields = [field for field in schema if is_numeric(field.type)]
    notes = [
        f"{quoted(field.name)} passed over: {quoted(str(field.type))}"
        for field in schema
        if not is_numeric(field.type)
    ]
    if not fields:
        raise FormatError(f"{source}: no column of numbers")
    limits.check_shape(source, int(parquet.metadata.num_rows), len(fields))
    limits.check_bytes(source, declared_bytes(parquet))
    names = [field.name for field in fields]
    labels = unique_names(source, [split_unit(name)[0] for name in names])
    table = columns(parquet, names, lambda rows: limits.check_shape(source, rows, len(names)))
    values = {label: quiet(table.values[name]) for label, name in zip(labels, names, strict=True)}
    if not len(values[labels[0]]):
        raise FormatError(f"{source}: no row")
    units = (unit_of(field) or split_unit(field.name)[1] for field in fields)
    stated = {label: unit for label, unit in zip(labels, units, strict=True) if unit}
    return RawTable(source, values, stated, tuple(notes), "parquet")
