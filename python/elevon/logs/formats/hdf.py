"""Logs in HDF5 files (MATLAB 7.3, NetCDF 4): every vector of numbers, matrices as signals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.containers.hdf import array, datasets, opened, text_attribute
from elevon.errors import quoted
from elevon.logs.formats.limits import Limits
from elevon.logs.formats.vectors import columns_of, signals_side_by_side


def numeric_vectors(
    path: Path, limits: Limits
) -> tuple[dict[str, Floats], dict[str, str], list[str]]:
    """Read every vector of numbers of an HDF5 file.

    Parameters
    ----------
    path : Path
        The file.
    limits : Limits
        Bounds, applied to the declared sizes before anything is read.

    Returns
    -------
    vectors : dict of str to ndarray, shape (n,)
        By path within the file, groups joined by ``/``.
    units : dict of str to str
        The text attribute ``units`` of each vector that has one.
    notes : list of str
        What was passed over, and why.

    Raises
    ------
    FormatError
        Damaged file, or content larger than the limits.
    """
    vectors: dict[str, Floats] = {}
    units: dict[str, str] = {}
    notes: list[str] = []
    with opened(path) as file:
        total = 0
        for name, data in datasets(file):
            values = data if isinstance(data, str) else _array(path, name, data, limits, total)
            if isinstance(values, str):
                notes.append(f"{quoted(name)} passed over: {values}")
                continue
            total += values.size
            numbers = values.astype(np.float64)
            unit = text_attribute(data, "units")
            several = signals_side_by_side(numbers.shape)
            signals = columns_of(name, numbers) if several else {name: numbers.reshape(-1)}
            vectors.update(signals)
            units.update(dict.fromkeys(signals, unit) if unit else {})
    return vectors, units, notes


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
