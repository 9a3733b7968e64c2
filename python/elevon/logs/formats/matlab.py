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
from elevon.logs.formats.vectors import Vectors, signals_side_by_side


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
    for field in variable.fields():
        if field.kind == "struct":
            raise FormatError(
                f"{path}, {quoted(variable.name)}: a structure within a structure cannot be read"
            )
        yield f"{variable.name}/{field.name}", field


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
