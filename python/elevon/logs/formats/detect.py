"""Which reader a file needs, seen from its first bytes before its name."""

from __future__ import annotations

from pathlib import Path

from elevon.containers.hdf import is_hdf5
from elevon.errors import InputError, unknown
from elevon.extras import missing_package
from elevon.logs.formats.table import DEFAULT_LIMITS, Limits, RawTable, existing_file, head

#: What `elevon import --format` takes.
FORMATS = (
    "auto", "drive", "csv", "parquet", "netcdf", "mat", "mdf", "tdms", "mcap", "recording",
    "cranfield",
)  # fmt: skip


_MARKS = {b"MDF ": "mdf", b"UnFinMF ": "mdf", b"TDSm": "tdms", b"\x89MCAP0\r\n": "mcap"}


def file_kind(path: Path) -> str:
    """Return the format of `FORMATS` that a file's first bytes say; ``csv`` for any other."""
    first = head(path, 128)
    for mark, kind in _MARKS.items():
        if first.startswith(mark):
            return kind
    if first.startswith(b"PAR1"):
        return "parquet"
    if first.startswith((b"CDF\x01", b"CDF\x02")):
        return "netcdf"
    if first[126:128] in (b"IM", b"MI"):
        return "mat"
    if is_hdf5(path):
        return "mat" if first.startswith(b"MATLAB 7.3") else "netcdf"
    return "csv"


def read_table(
    path: str | Path, log_format: str = "auto", limits: Limits = DEFAULT_LIMITS
) -> RawTable:
    """Read a log's columns with the reader its format needs.

    Parameters
    ----------
    path : path
        The log.
    log_format : str
        One of `FORMATS`.
    limits : Limits
        Bounds on size.

    Raises
    ------
    UnknownNameError
        Unknown format.
    InputError, FormatError
        As the readers.
    """
    if log_format not in FORMATS:
        raise unknown("format", log_format, FORMATS)
    file = existing_file(path, limits)
    kind = file_kind(file) if log_format in {"auto", "drive", "recording"} else log_format
    if kind == "parquet":
        from elevon.logs.formats.vectors import read_parquet

        return read_parquet(file, limits=limits)
    if kind == "netcdf":
        from elevon.logs.formats.vectors import read_netcdf

        return read_netcdf(file, limits=limits)
    if kind == "mat":
        from elevon.logs.formats.vectors import read_matlab

        return read_matlab(file, limits=limits)
    if kind in _MARKS.values():
        from elevon.logs.formats import measurements

        read = {
            "mdf": measurements.read_mdf,
            "tdms": measurements.read_tdms,
            "mcap": measurements.read_mcap,
        }
        try:
            return read[kind](file, limits=limits)
        except ModuleNotFoundError as error:
            raise InputError(f"{file}: {missing_package(error) or error}") from error
    from elevon.logs.formats.text import read_text_table

    header = True if log_format == "drive" else None
    return read_text_table(file, limits=limits, header=header)
