"""MATLAB files: v5 through scipy after a bounded look at their structure, v7.3 through HDF5."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from elevon.bench.logs.hdf import is_hdf5, numeric_vectors
from elevon.bench.logs.limits import DEFAULT_LIMITS, Limits, existing_file, quoted
from elevon.bench.logs.mat5 import plain_variables
from elevon.bench.logs.table import FloatArray, RawTable
from elevon.bench.logs.vectors import table_of_vectors
from elevon.errors import FormatError

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
    names = plain_variables(file, limits, notes)
    found: dict[str, FloatArray] = {}
    for name, value in _load(file, names).items():
        _collect(name, value, found, notes)
    return table_of_vectors(str(file), found, {}, notes, file_format="mat 5", limits=limits)


def _load(file: Path, names: list[str]) -> dict[str, Any]:
    from scipy.io import loadmat

    if not names:
        raise FormatError(f"{file}: no plain numeric variable")
    try:
        content = loadmat(str(file), variable_names=names, chars_as_strings=False)
    except Exception as error:
        raise FormatError(f"{file}: damaged .mat file: {quoted(str(error))}") from error
    return {name: content[name] for name in names if name in content}


def _collect(name: str, value: Any, found: dict[str, FloatArray], notes: list[str]) -> None:
    if not isinstance(value, np.ndarray):
        return
    if value.dtype.names is not None and value.size == 1:
        for part in value.dtype.names:
            _collect(f"{name}/{part}", value.reshape(-1)[0][part], found, notes)
    elif value.dtype.kind not in "fiub":
        notes.append(f"{quoted(name)} passed over: not plain numbers")
    elif sum(length > 1 for length in value.shape) > 1:
        notes.append(f"{quoted(name)} passed over: not a vector, shape {value.shape}")
    else:
        found[name] = np.asarray(value, dtype=np.float64).reshape(-1)
