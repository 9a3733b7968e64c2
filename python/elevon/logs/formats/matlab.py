"""MATLAB files of version 5 and 7.3."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import closing
from pathlib import Path

from elevon.arrays import Floats
from elevon.containers.hdf import is_hdf5
from elevon.containers.mat5 import Variable, variables
from elevon.errors import FormatError, quoted
from elevon.logs.formats.hdf import numeric_vectors
from elevon.logs.formats.limits import DEFAULT_LIMITS, Limits, existing_file
from elevon.logs.formats.table import RawTable
from elevon.logs.formats.vectors import columns_of, signals_side_by_side, table_of_vectors


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
        vectors, _, notes = numeric_vectors(file, limits)
        return table_of_vectors(str(file), vectors, {}, notes, file_format="mat 7.3", limits=limits)
    vectors, notes = _vectors(file, limits)
    return table_of_vectors(str(file), vectors, {}, notes, file_format="mat 5", limits=limits)


def has_variable(path: Path, name: str, limits: Limits) -> bool:
    """Whether a version 5 file holds a variable of a name at its top; False for any other file."""
    try:
        with closing(_bounded(path, limits)) as listed:
            return any(variable.name == name for variable in listed)
    except FormatError:
        return False


def _bounded(path: Path, limits: Limits) -> Generator[Variable, None, None]:
    return variables(path, lambda size: limits.check_bytes(str(path), size))


def _vectors(path: Path, limits: Limits) -> tuple[dict[str, Floats], list[str]]:
    """Return the numeric vectors of a version 5 file; those inside a structure as ``name/field``.

    Columns of a long matrix are vectors. The notes name what is passed over: cells, objects, text,
    complex numbers.
    """
    vectors: dict[str, Floats] = {}
    notes = []
    total = 0
    for variable in _bounded(path, limits):
        for label, item in _members(path, variable):
            columns = _columns(label, item)
            if isinstance(columns, str):
                notes.append(f"{quoted(label)} passed over: {columns}")
                continue
            for name, vector in columns.items():
                if name in vectors:
                    raise FormatError(f"{path}: two variables are named {quoted(name)}")
                total += len(vector)
                limits.check_shape(str(path), total, 1)
                vectors[name] = vector
    return vectors, notes


def _members(path: Path, variable: Variable) -> Iterator[tuple[str, Variable]]:
    """Yield the variable itself, or the fields of a structure."""
    if variable.kind != "struct":
        yield variable.name, variable
        return
    for field in variable.fields():
        if field.kind == "struct":
            raise FormatError(
                f"{path}, {quoted(variable.name)}: a structure within a structure cannot be read"
            )
        yield f"{variable.name}/{field.name}", field


def _columns(label: str, item: Variable) -> dict[str, Floats] | str:
    """Decode a vector, or the columns of a long matrix; of anything else say what it is."""
    reason = "" if item.kind == "numbers" else item.kind
    if not reason and item.is_complex:
        reason = "complex numbers"
    if not reason and signals_side_by_side(item.shape):
        return columns_of(label, item.numbers().reshape(item.shape, order="F"))
    if not reason and sum(length != 1 for length in item.shape) > 1:
        reason = f"neither a vector nor signals side by side, shape {item.shape}"
    return reason or {label: item.numbers()}
