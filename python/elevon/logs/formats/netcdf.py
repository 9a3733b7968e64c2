"""NetCDF files: version 4 is HDF5, version 3 is plain and read with scipy."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from elevon.containers.hdf import is_hdf5
from elevon.errors import FormatError, quoted
from elevon.logs.formats.hdf import numeric_vectors
from elevon.logs.formats.limits import DEFAULT_LIMITS, Limits, existing_file
from elevon.logs.formats.opening import head
from elevon.logs.formats.table import RawTable
from elevon.logs.formats.vectors import Vectors


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
