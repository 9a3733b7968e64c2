"""Columns that are in memory already: DataFrames, Datasets and arrays by name."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import FormatError, InputError, quoted
from elevon.logs.formats.table import DEFAULT_LIMITS, RawTable, split_unit, unique_names


@runtime_checkable
class DataTable(Protocol):
    """A table of another library: named columns, each of which becomes an array."""

    def __getitem__(self, name: str, /) -> npt.ArrayLike:
        """Return a column."""

    def __len__(self) -> int:
        """Return the number of rows or of columns."""


#: A file, or columns in memory.
Source = str | os.PathLike[str] | Mapping[str, npt.ArrayLike] | DataTable


def table_of(given: object) -> RawTable:
    """Return the table of columns in memory.

    Parameters
    ----------
    given : DataFrame, Dataset or mapping of str to array_like, shape (n,)
        Of pandas, polars or xarray; the index of a pandas table, or the one coordinate of a
        Dataset, is a column where it is named or rises as a time does. Masked values, nulls and
        NaT become NaN.

    Raises
    ------
    InputError
        None of those.
    FormatError
        No column of numbers, columns of different lengths, two of one name.
    """
    source = type(given).__name__
    columns: dict[str, Floats] = {}
    units: dict[str, str] = {}
    notes = []
    named = list(_columns(given))
    labels = unique_names(source, [split_unit(name)[0] for name, _, _ in named])
    for label, (name, values, stated) in zip(labels, named, strict=True):
        numbers, seconds = _numbers(values)
        if numbers is None:
            notes.append(f"column {quoted(name)} holds no numbers and is left out")
            continue
        if numbers.ndim != 1:
            raise FormatError(
                f"{source}: {quoted(name)} has shape {numbers.shape}, not one value a row"
            )
        columns[label] = numbers
        unit = "s" if seconds else stated or split_unit(name)[1]
        if unit:
            units[label] = unit
    if not columns:
        raise FormatError(f"{source}: no column of numbers")
    DEFAULT_LIMITS.check_shape(source, max(map(len, columns.values())), len(columns))
    return RawTable(source, columns, units, tuple(notes), source)


def _columns(given: object) -> Iterator[tuple[str, object, str]]:
    """Yield name, values and stated unit of each column."""
    library = type(given).__module__.partition(".")[0]
    if isinstance(given, Mapping) and library != "xarray":
        for name, values in given.items():
            yield str(name), values, ""
    elif library == "xarray" and hasattr(given, "data_vars"):
        for name, item in {**given.coords, **given.data_vars}.items():  # type: ignore[attr-defined]
            yield str(name), item.values, str(item.attrs.get("units", ""))
    elif library == "pandas" and hasattr(given, "columns"):
        index = given.index  # type: ignore[attr-defined]
        if index.name is not None:
            yield str(index.name), index.to_numpy(), ""
        for place, name in enumerate(given.columns):
            yield str(name), given.iloc[:, place], ""  # type: ignore[attr-defined]
    elif library == "polars" and hasattr(given, "columns"):
        for name in given.columns:
            yield str(name), given[name].to_numpy(), ""  # type: ignore[index]
    else:
        raise InputError(
            f"read_log: {type(given).__name__} is no path, DataFrame of pandas or polars, Dataset "
            "of xarray or mapping of names to arrays"
        )


def _numbers(values: object) -> tuple[Floats | None, bool]:
    """Return a copy as numbers, None of anything else; and whether they are instants in s."""
    array = np.asarray(values)
    stamps = array.dtype.kind in "mM"
    numbers: Floats | None = None
    if stamps:
        numbers = _seconds(array)
    elif array.dtype.kind == "O":
        numbers = _of_objects(array)
    elif array.dtype.kind in "fiub":
        numbers = np.array(array, dtype=np.float64)
    if numbers is not None and isinstance(values, np.ma.MaskedArray):
        numbers = np.where(np.ma.getmaskarray(values), np.nan, numbers)
    return numbers, stamps


def _seconds(array: npt.NDArray[np.generic]) -> Floats:
    """Return instants as seconds since the first; durations as seconds."""
    missing = np.isnat(array)
    first = array[~missing][:1]
    since = array - first[0] if len(first) and array.dtype.kind == "M" else array
    seconds = since.astype("timedelta64[ns]").astype(np.float64) * 1e-9
    return np.where(missing, np.nan, seconds)


def _of_objects(array: npt.NDArray[np.generic]) -> Floats | None:
    """Return numbers; None, and pandas' NA, as NaN. None where something else is no number."""
    out = np.full(array.shape, np.nan)
    for place, value in enumerate(array.tolist() if array.ndim == 1 else ()):
        if value is None or type(value).__name__ in {"NAType", "NaTType"}:
            continue
        if isinstance(value, (str, bytes)):
            return None
        try:
            out[place] = float(value)
        except (TypeError, ValueError):
            return None
    return out
