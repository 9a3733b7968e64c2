"""HDF5 files (MATLAB 7.3, NetCDF 4), read with every expansion bounded first.

Only plain datasets are touched. Links out of the file, external storage, virtual datasets,
references, objects and foreign filters are never followed or loaded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.errors import FormatError, quoted

Check = Callable[[int], None]
"""Refuses a number of bytes that is too many."""

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_DEEPEST = 3
_MOST_ITEMS = 2000
_FILTERS = {1, 2, 3, 4, 32000}  # deflate, shuffle, Fletcher-32, szip, LZF
_LONGEST_TEXT = 40


def is_hdf5(path: Path) -> bool:
    """Whether the file has the HDF5 signature at its start or after MATLAB's 512-byte header."""
    with path.open("rb") as stream:
        first = stream.read(8)
        stream.seek(512)
        return _SIGNATURE in (first, stream.read(8))


@contextmanager
def opened(path: Path) -> Iterator[object]:
    """Open a file; whatever goes wrong inside, also in the library, is a clear error.

    Raises
    ------
    FormatError
        The file is damaged.
    """
    import h5py

    try:
        with h5py.File(path, "r") as file:
            yield file
    except FormatError:
        raise
    except Exception as error:
        raise FormatError(f"{path}: damaged HDF5 file: {quoted(str(error))}") from error


def datasets(file: object) -> Iterator[tuple[str, object]]:
    """Yield path and dataset of everything in a file, over hard links only.

    Of what is passed over, such as a link, the reason stands in the dataset's place.

    Parameters
    ----------
    file : h5py.File
        From `opened`.

    Raises
    ------
    FormatError
        More items than any log has.
    """
    yield from _walk(file, "", 0, count())


def _walk(group: Any, prefix: str, depth: int, items: Iterator[int]) -> Iterator[tuple[str, Any]]:
    import h5py

    for name in group:
        if next(items) >= _MOST_ITEMS:
            raise FormatError(f"{group.file.filename}: more than {_MOST_ITEMS} items")
        path = f"{prefix}{name}"
        if path.startswith("#"):
            continue  # MATLAB's own bookkeeping (#refs#, #subsystem#)
        if not _is_own(group, name):
            yield path, "a link"
            continue
        item = group[name]
        if isinstance(item, h5py.Dataset):
            yield path, item
        elif isinstance(item, h5py.Group) and depth < _DEEPEST:
            yield from _walk(item, f"{path}/", depth + 1, items)
        else:
            yield path, "nested too deep or not a dataset"


def _is_own(group: Any, name: str) -> bool:
    import h5py

    return isinstance(group.get(name, getlink=True), h5py.HardLink)


def dataset(file: Any, name: str) -> Any:
    """Return a dataset at the top of a file by its name; None where there is nothing of that name.

    Raises
    ------
    FormatError
        A link, or no dataset.
    """
    import h5py

    if name not in file:
        return None
    if not _is_own(file, name):
        raise FormatError(f"{file.filename}: {name!r} is a link to elsewhere; refused")
    if not isinstance(file[name], h5py.Dataset):
        raise FormatError(f"{file.filename}: {name!r} is not a dataset; refused")
    return file[name]


def vector(data: Any, kinds: str, check: Check) -> npt.NDArray[Any] | str:
    """Read a vector as it is stored.

    Parameters
    ----------
    data : h5py.Dataset
        From `datasets` or `dataset`.
    kinds : str
        The kinds of type allowed, by NumPy's letters: ``"fiub"`` for numbers.
    check : callable
        Of the bytes, called before they are read.

    Returns
    -------
    ndarray of shape (n,), or str
        The values, or why they are not read.
    """
    values = array(data, kinds, check, also=lambda _shape: False)
    return values if isinstance(values, str) else values.reshape(-1)


def array(
    data: Any, kinds: str, check: Check, *, also: Callable[[Sequence[int]], bool]
) -> npt.NDArray[Any] | str:
    """Read a vector, or an array of a shape that `also` allows; the rest as of `vector`.

    Returns
    -------
    ndarray of the stored shape, or str
        The values, or why they are not read.
    """
    reason = _refusal(data, kinds, also)
    if reason:
        return reason
    if data.chunks is not None:
        check(int(np.prod(data.chunks)) * data.dtype.itemsize)
    check(int(data.size) * data.dtype.itemsize)
    return np.asarray(data[()])


def _refusal(data: Any, kinds: str, also: Callable[[Sequence[int]], bool]) -> str:
    """Why a dataset is not read; empty when it is a plain array of a kind and size allowed."""
    if data.dtype.kind not in kinds:
        return "not numbers" if "f" in kinds else "not text"
    if data.attrs.get("MATLAB_object_decode") is not None:
        return "a MATLAB object"
    if data.is_virtual or data.external:
        return "its data lie outside the file"
    if data.shape is None or (
        sum(length > 1 for length in data.shape) > 1 and not also(data.shape)
    ):
        return f"not a vector: shape {data.shape}"
    plan = data.id.get_create_plist()
    codes = {plan.get_filter(k)[0] for k in range(plan.get_nfilters())}
    return f"unknown compression filter {sorted(codes - _FILTERS)}" if codes - _FILTERS else ""


def text_attribute(data: Any, name: str) -> str:
    """Return a short text attribute of a dataset; empty where there is none."""
    kind = data.attrs.get_id(name).dtype.kind if name in data.attrs else ""
    if kind not in {"S", "O", "U"}:
        return ""
    value = data.attrs[name]
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    return value[:_LONGEST_TEXT] if isinstance(value, str) else ""
