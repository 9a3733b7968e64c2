"""Logs in HDF5 files (MATLAB 7.3, NetCDF 4): every vector of numbers, matrices as signals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.containers.hdf import array, datasets, opened, text_attribute
from elevon.errors import quoted
from elevon.logs.formats.limits import Limits
from elevon.logs.formats.vectors import Vectors, signals_side_by_side


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
