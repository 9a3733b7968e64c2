"""HDF5 files (MATLAB v7.3, NetCDF-4), read with every expansion bounded first.

Only plain numeric datasets are touched. Links out of the file, external storage, virtual datasets,
references, objects and foreign filters are never followed or loaded.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from elevon.errors import FormatError
from elevon.logs.formats.limits import Limits, quoted
from elevon.logs.formats.table import FloatArray

__all__ = ["SIGNATURE", "is_hdf5", "numeric_vectors"]

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_DEEPEST = 3
_MOST_ITEMS = 2000
_FILTERS = {1, 2, 3, 4, 32000}  # deflate, shuffle, Fletcher-32, szip, LZF


def is_hdf5(path: Path) -> bool:
    """Whether the file has the HDF5 signature at its start or after MATLAB's 512-byte header."""
    with path.open("rb") as stream:
        first = stream.read(8)
        stream.seek(512)
        return SIGNATURE in (first, stream.read(8))


def numeric_vectors(
    path: Path, limits: Limits
) -> tuple[dict[str, FloatArray], dict[str, str], list[str]]:
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
    import h5py

    vectors: dict[str, FloatArray] = {}
    units: dict[str, str] = {}
    notes: list[str] = []
    try:
        with h5py.File(path, "r") as file:
            total = 0
            for name, dataset in _datasets(file, "", 0, notes, [0]):
                reason = _refusal(dataset, limits)
                if reason:
                    notes.append(f"{quoted(name)} passed over: {reason}")
                    continue
                total += int(dataset.size)
                limits.check_shape(f"{path}, {quoted(name)}", total, 1)
                vectors[name] = np.asarray(dataset[()], dtype=np.float64).reshape(-1)
                unit = _text_attribute(dataset, "units")
                if unit:
                    units[name] = unit
    except FormatError:
        raise
    except Exception as error:
        raise FormatError(f"{path}: damaged HDF5 file: {quoted(str(error))}") from error
    return vectors, units, notes


def _datasets(
    group: Any, prefix: str, depth: int, notes: list[str], count: list[int]
) -> Iterator[tuple[str, Any]]:
    """Walk hard links only, to a bounded depth and number."""
    import h5py

    for name in group:
        count[0] += 1
        if count[0] > _MOST_ITEMS:
            raise FormatError(f"more than {_MOST_ITEMS} items")
        path = f"{prefix}{name}"
        if path.startswith("#"):
            continue  # MATLAB's own bookkeeping (#refs#, #subsystem#)
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            notes.append(f"{quoted(path)} passed over: a link")
            continue
        item = group[name]
        if isinstance(item, h5py.Dataset):
            yield path, item
        elif isinstance(item, h5py.Group) and depth < _DEEPEST:
            yield from _datasets(item, f"{path}/", depth + 1, notes, count)
        else:
            notes.append(f"{quoted(path)} passed over: nested too deep or not a dataset")


def _refusal(dataset: Any, limits: Limits) -> str:
    """Why a dataset is not read; empty when it is a plain vector of numbers."""
    if dataset.dtype.kind not in "fiub":
        return "not numbers"
    if dataset.attrs.get("MATLAB_object_decode") is not None:
        return "a MATLAB object"
    if dataset.is_virtual or dataset.external:
        return "its data lie outside the file"
    if dataset.shape is None or sum(length > 1 for length in dataset.shape) > 1:
        return f"not a vector: shape {dataset.shape}"
    plan = dataset.id.get_create_plist()
    codes = {plan.get_filter(k)[0] for k in range(plan.get_nfilters())}
    if codes - _FILTERS:
        return f"unknown compression filter {sorted(codes - _FILTERS)}"
    if dataset.chunks is not None:
        limits.check_bytes("a chunk", int(np.prod(dataset.chunks)) * dataset.dtype.itemsize)
    return ""


def _text_attribute(dataset: Any, name: str) -> str:
    kind = dataset.attrs.get_id(name).dtype.kind if name in dataset.attrs else ""
    if kind not in {"S", "O", "U"}:
        return ""
    value = dataset.attrs[name]
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    return value[:40] if isinstance(value, str) else ""
