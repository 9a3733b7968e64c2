"""MATLAB files of version 5 and 7.3."""

from __future__ import annotations

from pathlib import Path

from elevon.bench.logs.hdf import is_hdf5, numeric_vectors
from elevon.bench.logs.limits import DEFAULT_LIMITS, Limits, existing_file
from elevon.bench.logs.mat5 import read_vectors
from elevon.bench.logs.table import RawTable
from elevon.bench.logs.vectors import table_of_vectors

__all__ = ["read_matlab"]


def read_matlab(path: str | Path, *, limits: Limits = DEFAULT_LIMITS) -> RawTable:
    """Read the numeric vectors of a .mat file, at the top or inside one plain structure.

    Cells, objects, function handles, sparse and complex values are named in the notes and never
    loaded.

    Raises
    ------
    FormatError
        Not a .mat file of version 5 or 7.3, damaged, or larger than the limits after expansion.
    """
    file = existing_file(path, limits)
    notes: list[str] = []
    if is_hdf5(file):
        vectors, _, notes = numeric_vectors(file, limits)
        return table_of_vectors(str(file), vectors, {}, notes, file_format="mat 7.3", limits=limits)
    vectors = read_vectors(file, limits, notes)
    return table_of_vectors(str(file), vectors, {}, notes, file_format="mat 5", limits=limits)
