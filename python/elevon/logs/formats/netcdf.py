"""NetCDF files: version 4 is HDF5, version 3 is plain and read with scipy."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from elevon.arrays import Floats
from elevon.containers.hdf import is_hdf5
from elevon.errors import FormatError, quoted
from elevon.logs.formats.hdf import numeric_vectors
from elevon.logs.formats.limits import DEFAULT_LIMITS, Limits, existing_file
from elevon.logs.formats.opening import head
from elevon.logs.formats.table import RawTable
from elevon.logs.formats.vectors import table_of_vectors


def read_netcdf(path: str | Path, *, limits: Limits = DEFAULT_LIMITS) -> RawTable:
    """Read the numeric vectors of a NetCDF file, with their ``units`` attributes.

    Raises
    ------
    FormatError
        Not NetCDF, damaged, or larger than the limits.
    """
    file = existing_file(path, limits)
    if is_hdf5(file):
        vectors, units, notes = numeric_vectors(file, limits)
        return table_of_vectors(
            str(file), vectors, units, notes, file_format="netcdf 4", limits=limits
        )
    if head(file, 4) not in (b"CDF\x01", b"CDF\x02"):
        raise FormatError(f"{file}: not a NetCDF file")
    limits.check_bytes(str(file), file.stat().st_size)
    return _classic(file, limits)


def _classic(file: Path, limits: Limits) -> RawTable:
    from scipy.io import netcdf_file

    vectors: dict[str, Floats] = {}
    units: dict[str, str] = {}
    notes: list[str] = []
    try:
        with netcdf_file(str(file), "r", mmap=False) as content:
            for name, variable in content.variables.items():
                data = np.asarray(variable.data)
                if data.dtype.kind not in "fiub" or sum(n > 1 for n in data.shape) > 1:
                    notes.append(f"{quoted(name)} passed over: not a vector of numbers")
                    continue
                limits.check_shape(str(file), data.size, 1)
                vectors[name] = data.astype(np.float64).reshape(-1)
                unit = getattr(variable, "units", b"")
                if isinstance(unit, bytes) and unit:
                    units[name] = unit.decode("utf-8", "replace")[:40]
    except FormatError:
        raise
    except Exception as error:
        raise FormatError(f"{file}: damaged NetCDF file: {quoted(str(error))}") from error
    return table_of_vectors(str(file), vectors, units, notes, file_format="netcdf 3", limits=limits)
