"""MATLAB v5 files, read within bounds: plain numeric vectors, at the top or in one structure.

A v5 file is a chain of elements, each a tag (type, length) and its bytes; most are compressed with
zlib. Every element is expanded here piece by piece, against the limit. The numbers are then decoded
here too, and not by scipy's reader, which a damaged file can bring to read outside its memory.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from elevon.bench.logs.limits import Limits, quoted
from elevon.bench.logs.opening import head
from elevon.bench.logs.table import FloatArray
from elevon.errors import FormatError

__all__ = ["has_variable", "read_vectors"]

_COMPRESSED, _MATRIX = 15, 14
_STRUCT, _NUMERIC = 2, range(6, 16)
_OTHER = {1: "cell", 3: "object", 4: "text", 5: "sparse", 16: "function", 17: "opaque object"}
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8",
           13: "u8"}  # fmt: skip
_COMPLEX = 0x08
_MOST_VARIABLES = 512
_PIECE = 1 << 16


@dataclass(frozen=True, slots=True)
class _Matrix:
    """A variable's heading, and the bytes that follow it."""

    name: str
    kind: int
    complex_: bool
    shape: tuple[int, ...]
    rest: bytes


def read_vectors(path: Path, limits: Limits, notes: list[str]) -> dict[str, FloatArray]:
    """Return the numeric vectors of a file; those inside a structure as ``name/field``.

    Parameters
    ----------
    path : Path
        The file.
    limits : Limits
        Bound on the expanded size, of all variables together.
    notes : list of str
        What is passed over is added here: matrices, cells, objects, text, complex numbers.

    Raises
    ------
    FormatError
        Not a v5 file, damaged, or an expansion over the limit.
    """
    found: dict[str, FloatArray] = {}
    numbers = 0
    order = _byte_order(head(path, 128), path)
    for body in _variables(path, order, limits):
        for matrix in _unpacked(_matrix(body, order, path), order, path):
            vector = _vector(matrix, order, path, notes)
            if vector is None:
                continue
            if matrix.name in found:
                raise FormatError(f"{path}: two variables are named {quoted(matrix.name)}")
            numbers += len(vector)
            limits.check_shape(str(path), numbers, 1)
            found[matrix.name] = vector
    return found


def has_variable(path: Path, name: str, limits: Limits) -> bool:
    """Whether a v5 file holds a variable of a name at its top; False for any other file."""
    try:
        order = _byte_order(head(path, 128), path)
        return any(
            _matrix(body, order, path).name == name for body in _variables(path, order, limits)
        )
    except FormatError:
        return False


def _variables(path: Path, order: str, limits: Limits) -> Iterator[bytes]:
    """Yield the expanded bytes of each variable."""
    expanded = count = 0
    with path.open("rb") as stream:
        stream.seek(128)
        while tag := stream.read(8):
            kind, length = _tag(tag, order, path)
            body = stream.read(length)
            if len(body) < length:
                raise FormatError(f"{path}: cut off inside a variable")
            if kind == _COMPRESSED:
                body = _expand(body, limits, expanded, path)
                kind, length = _tag(body[:8], order, path)
                body = body[8:]
            expanded += len(body)
            limits.check_bytes(str(path), expanded)
            if kind != _MATRIX or length > len(body):
                raise FormatError(f"{path}: damaged: an element of type {kind} at the top")
            count += 1
            if count > _MOST_VARIABLES:
                raise FormatError(f"{path}: more than {_MOST_VARIABLES} variables")
            yield body[:length]


def _byte_order(header: bytes, path: Path) -> str:
    mark = header[126:128]
    if len(header) < 128 or mark not in (b"IM", b"MI"):
        raise FormatError(f"{path}: not a MATLAB file of version 5 or 7.3")
    order = "<" if mark == b"IM" else ">"
    (version,) = struct.unpack(order + "H", header[124:126])
    if version != 0x0100:
        raise FormatError(f"{path}: MATLAB file of unknown version {version:#06x}")
    return order


def _tag(data: bytes, order: str, path: Path) -> tuple[int, int]:
    if len(data) < 8:
        raise FormatError(f"{path}: cut off inside a tag")
    kind, length = struct.unpack(order + "II", data[:8])
    return kind, length


def _expand(body: bytes, limits: Limits, already: int, path: Path) -> bytes:
    """Expand one element, stopping as soon as the limit is passed."""
    worker = zlib.decompressobj()
    pieces: list[bytes] = []
    size = already
    data = body
    try:
        while data:
            piece = worker.decompress(data, _PIECE)
            size += len(piece)
            limits.check_bytes(str(path), size)
            pieces.append(piece)
            data = worker.unconsumed_tail
    except zlib.error as error:
        raise FormatError(f"{path}: damaged compressed variable: {error}") from error
    if not worker.eof:
        raise FormatError(f"{path}: cut off inside a compressed variable")
    return b"".join(pieces)


def _element(data: bytes, at: int, order: str, path: Path) -> tuple[int, bytes, int]:
    """Return type, bytes and end of the sub-element at an offset, short form included."""
    if at + 8 > len(data):
        raise FormatError(f"{path}: damaged: an element is cut")
    (word,) = struct.unpack_from(order + "I", data, at)
    if word >> 16:
        length = word >> 16
        if length > 4:
            raise FormatError(f"{path}: damaged: a short element of {length} bytes")
        return word & 0xFFFF, data[at + 4 : at + 4 + length], at + 8
    kind, length = struct.unpack_from(order + "II", data, at)
    end = at + 8 + length
    if end > len(data):
        raise FormatError(f"{path}: damaged: an element is longer than its variable")
    return kind, data[at + 8 : end], end + (-length) % 8


def _matrix(data: bytes, order: str, path: Path) -> _Matrix:
    _, flags, at = _element(data, 0, order, path)
    if len(flags) < 4:
        raise FormatError(f"{path}: damaged: array flags of {len(flags)} bytes")
    (word,) = struct.unpack_from(order + "I", flags)
    kind, complex_ = word & 0xFF, bool((word >> 8) & _COMPLEX)
    if kind == 17:  # an opaque object has no size
        return _Matrix("", kind, complex_, (0,), b"")
    if kind not in _NUMERIC and kind not in _OTHER and kind != _STRUCT:
        raise FormatError(f"{path}: damaged: array class {kind}")
    _, size, at = _element(data, at, order, path)
    _, name, at = _element(data, at, order, path)
    shape = _shape(size, order, path)
    return _Matrix(name.decode("latin-1"), kind, complex_, shape, data[at:])


def _shape(size: bytes, order: str, path: Path) -> tuple[int, ...]:
    if len(size) % 4 or not 8 <= len(size) <= 32:
        raise FormatError(f"{path}: damaged: sizes of {len(size)} bytes")
    shape: tuple[int, ...] = struct.unpack(f"{order}{len(size) // 4}i", size)
    if min(shape) < 0:
        raise FormatError(f"{path}: damaged: a negative size")
    return shape


def _unpacked(matrix: _Matrix, order: str, path: Path) -> Iterator[_Matrix]:
    """Yield the variable itself, or the fields of a structure."""
    if matrix.kind != _STRUCT:
        yield matrix
        return
    if any(length != 1 for length in matrix.shape):
        raise FormatError(f"{path}, {quoted(matrix.name)}: arrays of structures cannot be read")
    _, width, at = _element(matrix.rest, 0, order, path)
    _, names, at = _element(matrix.rest, at, order, path)
    if len(width) != 4:
        raise FormatError(f"{path}: damaged: width of the field names")
    (step,) = struct.unpack(order + "i", width)
    if not 0 < step <= 64 or len(names) % step:
        raise FormatError(f"{path}: damaged: field names of width {step}")
    for place in range(0, len(names), step):
        kind, body, at = _element(matrix.rest, at, order, path)
        if kind != _MATRIX:
            raise FormatError(f"{path}: damaged: a field of type {kind}")
        if not body:
            continue
        field = _matrix(body, order, path)
        if field.kind == _STRUCT:
            raise FormatError(
                f"{path}, {quoted(matrix.name)}: a structure within a structure cannot be read"
            )
        label = names[place : place + step].split(b"\0")[0].decode("latin-1")
        full = f"{matrix.name}/{label}"
        yield _Matrix(full, field.kind, field.complex_, field.shape, field.rest)


def _vector(matrix: _Matrix, order: str, path: Path, notes: list[str]) -> FloatArray | None:
    """Decode a vector; None, with a note, for anything else."""
    reason = _OTHER.get(matrix.kind, "complex numbers" if matrix.complex_ else "")
    if not reason and sum(length != 1 for length in matrix.shape) > 1:
        reason = f"not a vector, shape {matrix.shape}"
    if reason:
        notes.append(f"{quoted(matrix.name)} passed over: {reason}")
        return None
    count = max(matrix.shape) if min(matrix.shape) else 0
    if not count:
        return np.empty(0)
    kind, stored, _ = _element(matrix.rest, 0, order, path)
    if kind not in _STORED:
        raise FormatError(f"{path}, {quoted(matrix.name)}: damaged: numbers of type {kind}")
    dtype = np.dtype(order + _STORED[kind])
    if len(stored) != count * dtype.itemsize:
        raise FormatError(
            f"{path}, {quoted(matrix.name)}: {count} numbers declared, {len(stored)} bytes stored"
        )
    return np.frombuffer(stored, dtype=dtype).astype(np.float64)
