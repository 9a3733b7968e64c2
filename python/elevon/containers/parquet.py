"""Parquet files, bounded by their own declared sizes before a page is expanded."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.errors import FormatError, quoted

_BATCH = 65_536
_LONGEST_TEXT = 40


@contextmanager
def opened(path: Path) -> Iterator[object]:
    """Open a file; whatever goes wrong inside, also in the library, is a clear error.

    Pages that carry a checksum are held to it.

    Raises
    ------
    FormatError
        The file is damaged.
    """
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(
            path, memory_map=False, pre_buffer=False, page_checksum_verification=True
        ) as file:
            yield file
    except FormatError:
        raise
    except Exception as error:
        raise FormatError(f"{path}: damaged Parquet file: {quoted(str(error))}") from error


def is_numeric(kind: object) -> bool:
    """Return whether an Arrow type holds plain numbers."""
    from pyarrow import types

    return bool(types.is_floating(kind) or types.is_integer(kind) or types.is_boolean(kind))


def unit_of(field: Any) -> str:
    """Return the unit in a field's metadata; empty where there is none."""
    metadata = field.metadata or {}
    for key in (b"unit", b"units"):
        if key in metadata:
            return str(metadata[key].decode("utf-8", "replace"))[:_LONGEST_TEXT]
    return ""


def declared_bytes(file: Any) -> int:
    """Return what all row groups say they expand to."""
    groups = (file.metadata.row_group(k) for k in range(file.num_row_groups))
    return sum(int(group.total_byte_size) for group in groups)


@dataclass(frozen=True, slots=True)
class Columns:
    """Columns of numbers.

    Attributes
    ----------
    values : dict of str to ndarray, shape (rows,)
        A missing value is NaN.
    missing : frozenset of str
        The columns with missing values (nulls, which are no NaN of the file's own).
    """

    values: dict[str, npt.NDArray[np.float64]]
    missing: frozenset[str]


def columns(
    file: Any,
    names: Sequence[str],
    check_rows: Callable[[int], None],
    groups: Sequence[int] | None = None,
) -> Columns:
    """Read columns of numbers, a batch of rows at a time.

    Parameters
    ----------
    file : pyarrow.parquet.ParquetFile
        From `opened`.
    names : sequence of str
        Columns of numbers.
    check_rows : callable
        Of the rows so far, called before a batch is converted: refuses too many.
    groups : sequence of int, optional
        The row groups to read; default all.
    """
    parts: dict[str, list[npt.NDArray[np.float64]]] = {name: [] for name in names}
    missing: set[str] = set()
    rows = 0
    for batch in file.iter_batches(columns=list(names), row_groups=groups, batch_size=_BATCH):
        rows += batch.num_rows
        check_rows(rows)
        for name in names:
            column = batch.column(name)
            parts[name].append(_floats(column))
            if column.null_count:
                missing.add(name)
    empty = np.empty(0)
    values = {name: np.concatenate(part) if part else empty for name, part in parts.items()}
    return Columns(values, frozenset(missing))


def _floats(column: Any) -> npt.NDArray[np.float64]:
    import pyarrow as pa

    plain = column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
    return np.asarray(plain, dtype=np.float64)
