"""A strict reader of MATLAB version 5 files: real vectors, texts and plain structs, within bounds.

A file is a chain of elements: a tag (type, length) and as many bytes, padded to eight; a variable
may be compressed with zlib. SciPy's reader believes the tags, and a damaged file brings it to read
outside its memory; this one checks every length and count before it uses them.
"""

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from elevon.errors import FormatError
from elevon.recording.assemble import check_size

__all__ = ["Value", "read_variables"]

Value = npt.NDArray[np.float64] | str | dict[str, npt.NDArray[np.float64]]

_MATRIX, _COMPRESSED = 14, 15
_STRUCT, _TEXT, _NUMBERS = 2, 4, range(6, 16)
_COMPLEX = 0x08
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8"} | {
    12: "i8",
    13: "u8",
}
_CODES = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16"}
_PIECE = 2**16


@dataclass(frozen=True)
class _Source:
    """The file and its byte order, which every step needs."""

    path: Path
    order: str

    def damaged(self, why: str) -> FormatError:
        return FormatError(f"{self.path}: is a damaged MATLAB file: {why}")

    def element(self, data: memoryview, at: int) -> tuple[int, memoryview, int]:
        """Return type, bytes and end of the element at an offset, the short form included."""
        if at + 8 > len(data):
            raise self.damaged("an element is cut off")
        word, length = struct.unpack_from(f"{self.order}II", data, at)
        if word >> 16:
            kind, length, start, end = word & 0xFFFF, word >> 16, at + 4, at + 8
            if length > 4:
                raise self.damaged("a short element is too long")
        else:
            kind, start, end = word, at + 8, at + 8 + length + (-length) % 8
        if start + length > len(data):
            raise self.damaged("an element is longer than what holds it")
        return kind, data[start : start + length], end

    def integers(self, data: memoryview) -> tuple[int, ...]:
        if len(data) % 4 or not data:
            raise self.damaged("a list of integers is cut off")
        return struct.unpack(f"{self.order}{len(data) // 4}i", data)


def read_variables(path: Path, max_bytes: int) -> dict[str, Value]:
    """Read the variables of a file; those of other kinds are passed over.

    Parameters
    ----------
    path : Path
        The file.
    max_bytes : int
        The most that all variables together may expand to.

    Returns
    -------
    dict of str to (ndarray of shape (n,), str, or dict of such arrays)
        Real arrays as vectors, texts, and structs of one row with their real arrays.

    Raises
    ------
    FormatError
        Not version 5, damaged, or too large.
    """
    check_size(str(path), path.stat().st_size, max_bytes)
    content = memoryview(path.read_bytes())
    head = bytes(content[:128])
    if head.startswith((b"MATLAB 7.3", b"\x89HDF")):
        raise FormatError(f"{path}: is a MATLAB 7.3 file (HDF5); save it with -v7")
    order = {b"IM": "<", b"MI": ">"}.get(head[126:128])
    if len(head) < 128 or order is None or head[124:126] not in {b"\x00\x01", b"\x01\x00"}:
        raise FormatError(f"{path}: is not a MATLAB version 5 file")
    source = _Source(path, order)
    variables: dict[str, Value] = {}
    at, budget = 128, max_bytes
    while at < len(content):
        kind, body, at = _top(source, content, at)
        if kind == _COMPRESSED:
            expanded = _expanded(source, body, budget)
            kind, body, _ = source.element(expanded, 0)
        budget -= len(body)
        if kind != _MATRIX or budget < 0:
            raise source.damaged(f"an element of type {kind} stands where a variable should")
        name, value = _matrix(source, body)
        if value is None:
            continue
        if name in variables:
            raise source.damaged(f"two variables are named {name!r}")
        variables[name] = value
    return variables


def _top(source: _Source, content: memoryview, at: int) -> tuple[int, memoryview, int]:
    """Return an element at the top, where compressed ones are not padded."""
    if at + 8 > len(content):
        raise source.damaged("it is cut off")
    kind, length = struct.unpack_from(f"{source.order}II", content, at)
    if at + 8 + length > len(content):
        raise source.damaged("it is cut off")
    padding = 0 if kind == _COMPRESSED else (-length) % 8
    return kind, content[at + 8 : at + 8 + length], at + 8 + length + padding


def _expanded(source: _Source, body: memoryview, budget: int) -> memoryview:
    """Expand a compressed variable to the length that it declares, when the budget allows it."""
    worker = zlib.decompressobj()
    try:
        result = bytearray(worker.decompress(body, 8))
        if len(result) < 8:
            raise source.damaged("a compressed variable is cut off")
        length = struct.unpack_from(f"{source.order}II", result)[1]
        check_size(str(source.path), length, budget)
        while len(result) < 8 + length:
            piece = worker.decompress(worker.unconsumed_tail, min(_PIECE, 8 + length - len(result)))
            if not piece:
                raise source.damaged("a compressed variable is cut off")
            result += piece
        if worker.decompress(worker.unconsumed_tail, _PIECE) or not worker.eof:
            raise source.damaged("a compressed variable has another length than it says")
    except zlib.error as error:
        raise source.damaged(f"a compressed variable: {error}") from error
    return memoryview(result)


def _matrix(source: _Source, data: memoryview) -> tuple[str, Value | None]:
    """Read one variable: flags, sizes, name, content."""
    _, flags, at = source.element(data, 0)
    word = source.integers(flags)[0]
    kind, is_complex = word & 0xFF, bool((word >> 8) & _COMPLEX)
    if kind not in {_STRUCT, _TEXT, *_NUMBERS}:
        return "", None  # cells, sparse matrices, objects: laid out in other ways
    _, sizes, at = source.element(data, at)
    shape = source.integers(sizes)
    if len(shape) < 2 or min(shape) < 0:
        raise source.damaged("a variable has no size")
    _, raw, at = source.element(data, at)
    name = bytes(raw).decode("latin-1")
    count = 1
    for length in shape:
        count *= length
    if kind == _STRUCT:
        return name, _fields(source, data, at) if count == 1 else None
    if is_complex:
        return name, None
    stored, values, _ = source.element(data, at)
    if kind == _TEXT:
        return name, _text(source, stored, values)
    return name, _numbers(source, stored, values, count)


def _numbers(
    source: _Source, stored: int, values: memoryview, count: int
) -> npt.NDArray[np.float64]:
    if stored not in _STORED:
        raise source.damaged(f"numbers are stored as type {stored}")
    dtype = np.dtype(source.order + _STORED[stored])
    if len(values) != count * dtype.itemsize:
        raise source.damaged(f"{len(values)} bytes for {count} numbers")
    return np.frombuffer(values, dtype).astype(np.float64)


def _text(source: _Source, stored: int, values: memoryview) -> str:
    code = _CODES.get(stored)
    if code is None:
        raise source.damaged(f"text is stored as type {stored}")
    if code == "utf-16":
        code = "utf-16-le" if source.order == "<" else "utf-16-be"
    try:
        return bytes(values).decode(code)
    except UnicodeDecodeError as error:
        raise source.damaged(f"text is not {code}") from error


def _fields(source: _Source, data: memoryview, at: int) -> dict[str, npt.NDArray[np.float64]]:
    """Read the real arrays of a struct; its other fields, and structs in it, are passed over."""
    _, raw, at = source.element(data, at)
    (width,) = source.integers(raw)[:1]
    _, names, at = source.element(data, at)
    if width < 1 or len(names) % width:
        raise source.damaged("the names of a struct's fields have no length")
    fields: dict[str, npt.NDArray[np.float64]] = {}
    for start in range(0, len(names), width):
        name = bytes(names[start : start + width]).split(b"\0")[0].decode("latin-1")
        kind, body, at = source.element(data, at)
        if kind != _MATRIX:
            raise source.damaged(f"the field {name!r} is an element of type {kind}")
        value = _plain(source, body)
        if value is not None:
            fields[name] = value
    return fields


def _plain(source: _Source, data: memoryview) -> npt.NDArray[np.float64] | None:
    """Read a field when it is a real array, without going down into anything else."""
    if not len(data):
        return np.empty(0)  # how version 5 writes an empty field
    _, flags, _ = source.element(data, 0)
    if source.integers(flags)[0] & 0xFF not in _NUMBERS:
        return None
    _, value = _matrix(source, data)
    return value if isinstance(value, np.ndarray) else None
