"""A bounded look into a MATLAB v5 file before a library loads it.

A v5 file is a chain of elements, each a tag (type, length) and its bytes; most are compressed with
zlib. Every element is expanded here piece by piece, against the limit, and its structure walked:
only variables that are plain numbers, or one structure of plain numbers, are let through.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, replace
from pathlib import Path

from elevon.bench.logs.limits import Limits, quoted
from elevon.errors import FormatError

__all__ = ["plain_variables"]

_COMPRESSED, _MATRIX = 15, 14
_STRUCT, _NUMERIC = 2, range(6, 16)
_OTHER = {1: "cell", 3: "object", 4: "text", 5: "sparse", 16: "function", 17: "opaque object"}
_COMPLEX = 0x08
_MOST_VARIABLES = 512
_PIECE = 1 << 16


def plain_variables(path: Path, limits: Limits, notes: list[str]) -> list[str]:
    """Return the names of the variables that are safe and useful to load.

    Parameters
    ----------
    path : Path
        The file.
    limits : Limits
        Bound on the expanded size, of all variables together.
    notes : list of str
        What is passed over is added here.

    Raises
    ------
    FormatError
        Not a v5 file, a damaged chain of elements, or an expansion over the limit.
    """
    names: list[str] = []
    expanded = numbers = 0
    with path.open("rb") as stream:
        order = _byte_order(stream.read(128), path)
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
            matrix = _matrix(body[:length], order, path)
            numbers += matrix.count
            limits.check_shape(str(path), numbers, 1)
            _sort(matrix, names, notes)
            if len(names) + len(notes) > _MOST_VARIABLES:
                raise FormatError(f"{path}: more than {_MOST_VARIABLES} variables")
    return names


@dataclass(frozen=True, slots=True)
class _Matrix:
    name: str
    kind: int
    complex_: bool
    count: int
    rest: bytes


def _sort(matrix: _Matrix, names: list[str], notes: list[str]) -> None:
    if matrix.kind in _OTHER or matrix.complex_:
        what = "complex numbers" if matrix.complex_ else _OTHER[matrix.kind]
        notes.append(f"{quoted(matrix.name)} passed over: {what}")
    elif matrix.name in names:
        raise FormatError(f"two variables are named {quoted(matrix.name)}")
    else:
        names.append(matrix.name)


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


def _matrix(data: bytes, order: str, path: Path, depth: int = 0) -> _Matrix:
    """Read a matrix's heading, and walk inside a structure."""
    _, flags, at = _element(data, 0, order, path)
    if len(flags) < 4:
        raise FormatError(f"{path}: damaged: array flags of {len(flags)} bytes")
    (word,) = struct.unpack_from(order + "I", flags)
    kind, complex_ = word & 0xFF, bool((word >> 8) & _COMPLEX)
    if kind == 17:  # an opaque object has no size
        return _Matrix("", kind, complex_, 0, b"")
    _, size, at = _element(data, at, order, path)
    _, name, at = _element(data, at, order, path)
    matrix = _Matrix(name.decode("latin-1"), kind, complex_, _count(size, order, path), data[at:])
    if kind == _STRUCT:
        return replace(matrix, count=_walk_structure(matrix, order, path, depth))
    if kind not in _NUMERIC and kind not in _OTHER:
        raise FormatError(f"{path}: damaged: array class {kind}")
    if kind in _NUMERIC:
        _check_numbers(matrix, order, path)
    return matrix


def _count(size: bytes, order: str, path: Path) -> int:
    if len(size) % 4 or not 8 <= len(size) <= 32:
        raise FormatError(f"{path}: damaged: sizes of {len(size)} bytes")
    count = 1
    for length in struct.unpack(f"{order}{len(size) // 4}i", size):
        if length < 0:
            raise FormatError(f"{path}: damaged: a negative size")
        count *= length
    return count


def _check_numbers(matrix: _Matrix, order: str, path: Path) -> None:
    """Refuse a declared size with fewer bytes behind it: the library would allocate it blindly."""
    _, stored, _ = _element(matrix.rest, 0, order, path) if matrix.count else (0, b"", 0)
    if matrix.count > len(stored):
        raise FormatError(
            f"{path}, {quoted(matrix.name)}: {matrix.count} numbers declared, "
            f"{len(stored)} bytes stored"
        )


def _walk_structure(matrix: _Matrix, order: str, path: Path, depth: int) -> int:
    """Check each field of a structure; return how many numbers they declare together."""
    if matrix.count != 1 or depth > 0:
        raise FormatError(
            f"{path}, {quoted(matrix.name)}: only one structure of vectors can be read, "
            "not an array of structures or structures within one"
        )
    _, width, at = _element(matrix.rest, 0, order, path)
    _, names, at = _element(matrix.rest, at, order, path)
    if len(width) != 4:
        raise FormatError(f"{path}: damaged: width of the field names")
    (step,) = struct.unpack(order + "i", width)
    if not 0 < step <= 64 or len(names) % step:
        raise FormatError(f"{path}: damaged: field names of width {step}")
    numbers = 0
    for _ in range(len(names) // step):
        kind, body, at = _element(matrix.rest, at, order, path)
        if kind != _MATRIX:
            raise FormatError(f"{path}: damaged: a field of type {kind}")
        field = _matrix(body, order, path, depth + 1) if body else None
        if field is not None and field.kind not in _NUMERIC and field.kind != 4:
            raise FormatError(
                f"{path}, {quoted(matrix.name)}: holds a "
                f"{_OTHER.get(field.kind, 'value')}; only numbers and text can be read"
            )
        numbers += field.count if field is not None else 0
    return numbers
