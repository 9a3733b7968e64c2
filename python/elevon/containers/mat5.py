"""The one reader of MATLAB version 5 files: strict, lazy, and bounded in what it expands.

A file is a chain of elements: a tag (type, length) and as many bytes, padded to eight; a variable
may be compressed with zlib. SciPy's reader believes the tags, and a damaged file brings it to read
outside its memory; this one checks every length and count before it uses them. Only numbers, texts
and the fields of plain structs are ever decoded: cells, objects, function handles and sparse
matrices are recognised by their kind, and their content is not looked at.
"""

import struct
import zlib
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from elevon.errors import FormatError, quoted

_MATRIX, _COMPRESSED = 14, 15
_OPAQUE = 17
_NUMBERS = range(6, 16)
_KINDS = {
    1: "cell", 2: "struct", 3: "object", 4: "text", 5: "sparse", 16: "function",
    _OPAQUE: "opaque object",
} | dict.fromkeys(_NUMBERS, "numbers")  # fmt: skip
_COMPLEX = 0x08
_STORED = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
_CODES = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16"}
_HEAD = 128
_PIECE = 2**16
_MOST_VARIABLES = 512
_MOST_SIZES = 32
_LONGEST_FIELD = 64


@dataclass(frozen=True, slots=True)
class _Source:
    """The file and its byte order, which every step needs."""

    path: Path
    order: str

    def damaged(self, why: str) -> FormatError:
        return FormatError(f"{self.path}: is a damaged MATLAB file: {why}")

    def tag(self, data: bytes | memoryview, at: int = 0) -> tuple[int, int]:
        """Return the two integers of a tag."""
        if at + 8 > len(data):
            raise self.damaged("an element is cut off")
        kind, length = struct.unpack_from(f"{self.order}II", data, at)
        return kind, length

    def element(self, data: memoryview, at: int) -> tuple[int, memoryview, int]:
        """Return type, bytes and end of the element at an offset, the short form included."""
        kind, length = self.tag(data, at)
        start, end = at + 8, at + 8 + length + (-length) % 8
        if kind >> 16:
            kind, length, start, end = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            if length > 4:
                raise self.damaged(f"a short element of {length} bytes")
        if start + length > len(data):
            raise self.damaged("an element is longer than what holds it")
        return kind, data[start : start + length], end

    def integers(self, data: memoryview) -> tuple[int, ...]:
        if len(data) % 4 or not data:
            raise self.damaged("a list of integers is cut off")
        return struct.unpack(f"{self.order}{len(data) // 4}i", data)


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable or field: its heading, and its content, decoded on demand.

    Attributes
    ----------
    name : str
        Foreign text; empty for an opaque object.
    kind : str
        ``numbers``, ``text``, ``struct``, ``cell``, ``object``, ``sparse``, ``function`` or
        ``opaque object``.
    is_complex : bool
        Whether there is an imaginary part; it is never decoded.
    shape : tuple of int
        As declared; nothing of that size has been made.
    """

    name: str
    kind: str
    is_complex: bool
    shape: tuple[int, ...]
    _source: _Source
    _content: memoryview

    @property
    def count(self) -> int:
        """Number of elements declared."""
        count = 1
        for length in self.shape:
            count *= length
        return count

    def numbers(self) -> npt.NDArray[np.float64]:
        """Return the real part.

        Returns
        -------
        ndarray, shape (count,)
            Column by column; NaN payloads as stored.

        Raises
        ------
        FormatError
            No numbers, or stored in another number than declared.
        """
        self._expect("numbers")
        if not self.count:
            return np.empty(0)
        stored, values, _ = self._source.element(self._content, 0)
        if stored not in _STORED:
            raise self._damaged(f"numbers are stored as type {stored}")
        dtype = np.dtype(self._source.order + _STORED[stored])
        if len(values) != self.count * dtype.itemsize:
            raise self._damaged(f"{self.count} numbers declared, {len(values)} bytes stored")
        return np.frombuffer(values, dtype).astype(np.float64)

    def text(self) -> str:
        """Return a text; FormatError where it is none, or its bytes are not in their code."""
        self._expect("text")
        stored, values, _ = self._source.element(self._content, 0)
        code = _CODES.get(stored)
        if code is None:
            raise self._damaged(f"text is stored as type {stored}")
        if code == "utf-16":
            code = "utf-16-le" if self._source.order == "<" else "utf-16-be"
        try:
            return bytes(values).decode(code)
        except UnicodeDecodeError as error:
            raise self._damaged(f"text is not {code}") from error

    def fields(self) -> Iterator["Variable"]:
        """Yield the fields of a struct of one row; an empty one as numbers of shape (0, 0).

        Raises
        ------
        FormatError
            No struct of one row, or damaged.
        """
        self._expect("struct")
        if self.count != 1:
            raise FormatError(f"{self._place}: arrays of structures cannot be read")
        source = self._source
        _, raw, at = source.element(self._content, 0)
        width = source.integers(raw)[0]
        _, names, at = source.element(self._content, at)
        if not 0 < width <= _LONGEST_FIELD or len(names) % width:
            raise self._damaged(f"field names of width {width}")
        for start in range(0, len(names), width):
            name = bytes(names[start : start + width]).split(b"\0")[0].decode("latin-1")
            kind, body, at = source.element(self._content, at)
            if kind != _MATRIX:
                raise self._damaged(f"the field {quoted(name)} is an element of type {kind}")
            yield _variable(source, body, name)

    @property
    def _place(self) -> str:
        return f"{self._source.path}, {quoted(self.name)}"

    def _expect(self, kind: str) -> None:
        if self.kind != kind:
            raise FormatError(f"{self._place}: is of kind {self.kind}, not {kind}")

    def _damaged(self, why: str) -> FormatError:
        return self._source.damaged(f"{quoted(self.name)}: {why}")


def variables(path: Path, check: Callable[[int], None]) -> Generator[Variable, None, None]:
    """Yield the variables of a file, one after the other.

    Parameters
    ----------
    path : Path
        The file.
    check : callable
        Called with how many bytes all variables so far expand to, before any of them is held;
        raises where that is too much.

    Yields
    ------
    Variable
        In the order of the file.

    Raises
    ------
    FormatError
        Not version 5, damaged, or more than 512 variables.
    """
    with path.open("rb") as stream:
        source = _Source(path, _byte_order(path, stream.read(_HEAD)))
        size = path.stat().st_size
        total = count = 0
        while raw := stream.read(8):
            kind, length = source.tag(raw)
            if length > size - stream.tell():
                raise source.damaged("it is cut off")
            if kind != _COMPRESSED:
                check(total + length)
            body = memoryview(stream.read(length))
            if kind == _COMPRESSED:
                kind, body = _expanded(source, body, total, check)
            else:
                stream.seek((-length) % 8, 1)
            total, count = total + len(body), count + 1
            if kind != _MATRIX:
                raise source.damaged(f"an element of type {kind} stands where a variable should")
            if count > _MOST_VARIABLES:
                raise FormatError(f"{path}: more than {_MOST_VARIABLES} variables")
            yield _variable(source, body)


def _byte_order(path: Path, head: bytes) -> str:
    if head.startswith((b"MATLAB 7.3", b"\x89HDF")):
        raise FormatError(f"{path}: is a MATLAB 7.3 file (HDF5); save it with -v7")
    order = {b"IM": "<", b"MI": ">"}.get(head[126:128])
    if len(head) < _HEAD or order is None:
        raise FormatError(f"{path}: is not a MATLAB version 5 file")
    (version,) = struct.unpack(f"{order}H", head[124:126])
    if version != 0x0100:
        raise FormatError(f"{path}: is a MATLAB file of unknown version {version:#06x}")
    return order


def _expanded(
    source: _Source, body: memoryview, total: int, check: Callable[[int], None]
) -> tuple[int, memoryview]:
    """Return type and content of a compressed variable, expanded as far as it declares."""
    worker = zlib.decompressobj()
    try:
        tag = worker.decompress(body, 8)
        kind, length = source.tag(tag)
        check(total + length)
        result = bytearray()
        while len(result) < length:
            piece = worker.decompress(worker.unconsumed_tail, min(_PIECE, length - len(result)))
            if not piece:
                raise source.damaged("a compressed variable is cut off")
            result += piece
        if worker.decompress(worker.unconsumed_tail, 1):
            raise source.damaged("a compressed variable expands to more than it declares")
        if not worker.eof:
            raise source.damaged("a compressed variable is cut off")
    except zlib.error as error:
        raise source.damaged(f"a compressed variable: {error}") from error
    return kind, memoryview(result)


def _variable(source: _Source, data: memoryview, name: str | None = None) -> Variable:
    """Read a heading: flags, sizes and name; fields are named by their struct."""
    if not data:  # how version 5 writes an empty field
        return Variable(name or "", "numbers", False, (0, 0), source, data)
    _, flags, at = source.element(data, 0)
    word = source.integers(flags)[0]
    kind = _KINDS.get(word & 0xFF)
    if kind is None:
        raise source.damaged(f"a variable of class {word & 0xFF}")
    if word & 0xFF == _OPAQUE:  # it has no size, and its name is not where others have theirs
        return Variable(name or "", kind, False, (0, 0), source, data[:0])
    _, sizes, at = source.element(data, at)
    _, raw, at = source.element(data, at)
    shape = source.integers(sizes)
    if not 2 <= len(shape) <= _MOST_SIZES or min(shape) < 0:
        raise source.damaged("a variable has no size")
    if name is None and not raw:  # what a file's objects hold, kept beside its variables
        return Variable("", _KINDS[_OPAQUE], False, shape, source, data[:0])
    label = bytes(raw).decode("latin-1") if name is None else name
    return Variable(label, kind, bool((word >> 8) & _COMPLEX), shape, source, data[at:])
