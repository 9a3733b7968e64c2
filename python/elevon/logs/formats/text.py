"""Text tables, read line by line: delimiter, decimal comma, encoding and line ends are seen.

Nothing is guessed cell by cell: what cannot be read as one consistent table is refused, with the
line and the column.
"""

from __future__ import annotations

import csv
import math
import warnings
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import IO

import numpy as np

from elevon.arrays import Floats
from elevon.errors import FormatError, quoted
from elevon.logs.formats.table import (
    DEFAULT_LIMITS,
    Limits,
    RawTable,
    existing_file,
    open_bytes,
    split_unit,
    unique_names,
)

_MISSING = {"", "nan"}
_BYTES_PER_VALUE = 32
_COMMENTS = 20
_WORDS = 64
_NUMBER = set("0123456789+-.eE \t")
_PLAIN = b"0123456789+-.eE,\n"
_BLOCK = 1 << 20  # bytes


def read_text_table(
    path: str | Path,
    *,
    limits: Limits = DEFAULT_LIMITS,
    header: bool | None = True,
    text_columns: tuple[str, ...] = (),
) -> RawTable:
    """Read a delimited text file of numbers.

    Parameters
    ----------
    path : path
        Plain or gzip-compressed text.
    limits : Limits
        Bounds on size.
    header : bool or None
        Whether the first line names the columns. None: decided by whether the first line is all
        numbers; columns without names are called ``column_1``, ``column_2``, ...
    text_columns : tuple of str
        Columns that hold words: each different word becomes its number, 0, 1, 2..., and the words
        stand in the table's attributes, one to a line.

    Returns
    -------
    RawTable
        Columns in file order; an empty or ``nan`` cell is NaN.

    Raises
    ------
    FormatError
        Empty file, header alone, text in numbers, rows of another length, a cut last line, a
        binary file, or more than the limits allow.
    """
    file = existing_file(path, limits)
    with open_bytes(file) as stream:
        return LineReader(str(file), limits, text_columns).read(stream, header)


@dataclass
class LineReader:
    """State of one reading: the dialect found so far and the numbers collected.

    A file is read whole (`read`). Of a stream each line is taken as it comes: `decode`, `preface`,
    `begin` with the first line behind the preface, then `row`; `drain` gives what was collected.
    """

    source: str
    limits: Limits
    text_columns: tuple[str, ...] = ()
    delimiter: str | None = None
    decimal_comma: bool = False
    decimal_point_line: int = 0
    decimal_comma_line: int = 0
    encoding: str = "ascii"
    notes: list[str] = field(default_factory=list)
    values: array[float] = field(default_factory=lambda: array("d"))
    words: dict[int, dict[str, int]] = field(default_factory=dict)
    expanded: int = 0
    ended: bool = True
    number: int = 0
    blank: int = 0

    def read(self, stream: IO[bytes], header: bool | None) -> RawTable:
        """Read all lines."""
        lines = self._lines(stream)
        first = next(((n, text) for n, text in lines if not self.preface(text)), None)
        if first is None:
            raise FormatError(f"{self.source}: holds no line of text")
        names = self.begin(first[1], first[0], header)
        while block := self._block(stream):
            if not self._plain(block, len(names)):
                for position, text in self._lines(BytesIO(block)):
                    self.row(text, position, len(names))
        if self.blank:
            self.notes.append(f"{self.blank} blank lines passed over")
        return self._table(names)

    def _block(self, stream: IO[bytes]) -> bytes:
        """Return whole lines, about as many as a block holds; one that is too long is cut."""
        block = stream.read(_BLOCK)
        whole = not block or block.endswith(b"\n")
        return block if whole else block + stream.readline(self.limits.line_bytes + 1)

    def _plain(self, block: bytes, columns: int) -> bool:
        """Take a block whose every line is numbers between commas; whether it is one.

        Any other block is left to be read line by line, which takes twice the time.
        """
        if self.delimiter != "," or self.words:
            return False
        block = block.replace(b"\r\n", b"\n")
        if block.translate(None, _PLAIN):
            return False
        lines = block.removesuffix(b"\n").split(b"\n")
        expanded, count = self.expanded + len(block) + len(lines), len(lines) * columns
        if (
            any(line.count(b",") != columns - 1 for line in lines)
            or max(map(len, lines)) + 2 > self.limits.line_bytes
            or expanded > _BYTES_PER_VALUE * self.limits.values
            or len(self.values) + count > self.limits.values
        ):
            return False
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # an empty cell, say
            try:
                numbers = np.fromstring(b",".join(lines).decode("ascii"), sep=",")
            except (DeprecationWarning, ValueError):
                return False
        if len(numbers) != count:
            return False
        self.values.frombytes(numbers.tobytes())
        self.expanded, self.number = expanded, self.number + len(lines)
        self.ended = block.endswith(b"\n")
        return True

    def begin(self, line: str, number: int, header: bool | None) -> list[str]:
        """Take the first line behind the preface; return the names of the columns."""
        names, start = self._names(line, number, header)
        trailing = len(names) > 1 and not names[-1].strip()
        names = unique_names(self.source, names[:-1] if trailing else names)
        self.limits.check_shape(self.source, 1, len(names))
        self.words = {k: {} for k, name in enumerate(names) if name in self.text_columns}
        if start:
            self.row(start[1], start[0], len(names))
        return names

    def drain(self) -> list[float]:
        """Return the numbers collected since the last time."""
        numbers = self.values.tolist()
        del self.values[:]
        return numbers

    def _lines(self, stream: IO[bytes]) -> Iterator[tuple[int, str]]:
        while raw := stream.readline(self.limits.line_bytes + 1):
            self.number += 1
            number = self.number
            if len(raw) > self.limits.line_bytes:
                raise FormatError(
                    f"{self.source}, line {number}: longer than {self.limits.line_bytes} bytes"
                )
            self.expanded += len(raw)
            if self.expanded > _BYTES_PER_VALUE * self.limits.values:
                raise FormatError(f"{self.source}: expands to more than {self.expanded} bytes")
            self.ended = raw.endswith(b"\n")
            text = self.decode(raw, number).rstrip("\r\n")
            if not text.strip():
                self.blank += 1
                continue
            yield number, text

    def decode(self, raw: bytes, number: int) -> str:
        """Return the text of a line."""
        if number == 1 and raw.startswith(b"\xef\xbb\xbf"):
            raw = raw[3:]
            self.notes.append("UTF-8 byte-order mark")
        if number == 1 and raw.startswith((b"\xff\xfe", b"\xfe\xff")):
            raise FormatError(f"{self.source}: UTF-16 text; save it as UTF-8")
        if b"\0" in raw:
            raise FormatError(f"{self.source}, line {number}: a zero byte; not a text file")
        if raw.isascii():
            return raw.decode("ascii")
        try:
            text = raw.decode("utf-8")
            encoding = "UTF-8"
        except UnicodeDecodeError:
            text = raw.decode("latin-1")
            encoding = "Latin-1"
        if self.encoding == "ascii":
            self.encoding = encoding
            self.notes.append(f"{encoding} text")
        return text

    def preface(self, line: str) -> bool:
        """Take a line that stands before the table; whether it is one."""
        if line.lower().startswith("sep=") and len(line) == 5:
            self.delimiter = line[4]
        elif line.startswith("#"):
            if len(self.notes) < _COMMENTS:
                self.notes.append(f"comment: {quoted(line[1:].strip())}")
        else:
            return False
        return True

    def _names(
        self, line: str, number: int, header: bool | None
    ) -> tuple[list[str], tuple[int, str] | None]:
        """Find the delimiter and the names; the line itself comes back when it holds numbers."""
        if self.delimiter is None:
            self.delimiter = _delimiter(line)
        cells = self._split(line, number)
        numeric = all(_is_number(cell, self.delimiter != ",") for cell in cells if cell.strip())
        if not numeric and header is not False:
            return cells, None
        if header is True:
            raise FormatError(
                f"{self.source}, line {number}: column names expected, found numbers only"
            )
        self.notes.append("no header line: columns named by position")
        return [f"column_{k}" for k in range(1, len(cells) + 1)], (number, line)

    def _split(self, line: str, number: int) -> list[str]:
        if '"' in line:
            try:
                return next(csv.reader([line], delimiter=self.delimiter or ",", strict=True))
            except (csv.Error, StopIteration) as error:
                raise FormatError(f"{self.source}, line {number}: bad quotes: {error}") from error
        if self.delimiter == " ":
            return line.split()
        return line.split(self.delimiter)

    def row(self, line: str, number: int, columns: int) -> None:
        """Take a row of the table."""
        cells = self._split(line, number)
        if len(cells) == columns + 1 and not cells[-1].strip():
            cells.pop()  # a delimiter at the end of the line
        if len(cells) != columns:
            self._ragged(cells, number, columns)
        for place, words in self.words.items():
            cells[place] = self._word(cells[place], words)
        if self.delimiter != ",":
            cells = self._commas(cells, number)
        try:
            if "_" in line or not line.isascii():
                raise ValueError  # float() also reads 1_000 and foreign digits; no log writes those
            self.values.extend(map(float, cells))
        except ValueError:
            del self.values[len(self.values) - len(self.values) % columns :]
            self.values.extend(
                self._cell(cell, number, place) for place, cell in enumerate(cells, start=1)
            )
        if len(self.values) > self.limits.values:
            self.limits.check_shape(self.source, len(self.values) // columns, columns)

    def _word(self, cell: str, words: dict[str, int]) -> str:
        code = words.setdefault(cell.strip(), len(words))
        if len(words) > _WORDS or len(cell) > 100:
            raise FormatError(f"{self.source}: more than {_WORDS} words, or one too long")
        return str(code)

    def _ragged(self, cells: list[str], number: int, columns: int) -> None:
        cut = "" if self.ended else "; the file is cut off there"
        hint = ""
        if self.delimiter == "," and len(cells) == 2 * columns:
            hint = "; decimal commas between commas cannot be distinguished: separate by semicolons"
        raise FormatError(
            f"{self.source}, line {number}: {len(cells)} cells where the header has {columns}"
            f"{cut}{hint}"
        )

    def _commas(self, cells: list[str], number: int) -> list[str]:
        """Turn decimal commas into points; a file that uses both is ambiguous and refused."""
        text = "".join(cells)
        if "." in text and not self.decimal_point_line:
            self.decimal_point_line = number
        if "," in text and not self.decimal_comma_line:
            self.decimal_comma_line = number
            self.notes.append("decimal comma")
        if self.decimal_comma_line and self.decimal_point_line:
            raise FormatError(
                f"{self.source}: decimal comma on line {self.decimal_comma_line} and decimal point "
                f"on line {self.decimal_point_line}; thousands separators cannot be distinguished"
            )
        return [cell.replace(",", ".") for cell in cells] if self.decimal_comma_line else cells

    def _cell(self, cell: str, number: int, place: int) -> float:
        text = cell.strip()
        if text.lower() in _MISSING:
            return math.nan
        if not _is_number(text, comma=False):
            cut = "" if self.ended else " (the file is cut off there)"
            raise FormatError(
                f"{self.source}, line {number}, column {place}: {quoted(text)} is not a number{cut}"
            )
        return float(text)

    def _table(self, names: list[str]) -> RawTable:
        if not self.values:
            raise FormatError(f"{self.source}: a header alone, no row of numbers")
        data = np.frombuffer(self.values, dtype=np.float64).reshape(-1, len(names))
        if not self.ended:
            self.notes.append("the last line has no line end: its last number may be cut short")
        columns, units = named_columns(names, data)
        words = {names[k]: "\n".join(values) for k, values in self.words.items()}
        return RawTable(self.source, columns, units, tuple(self.notes), "csv", words)


def named_columns(names: list[str], data: Floats) -> tuple[dict[str, Floats], dict[str, str]]:
    """Return the columns of a table, shape (n, c), by name, and the units that the names state."""
    pairs = [split_unit(name) for name in names]
    short = [name for name, _ in pairs]
    labels = short if len(set(short)) == len(short) else names
    columns = {label: data[:, k].copy() for k, label in enumerate(labels)}
    return columns, {label: unit for label, (_, unit) in zip(labels, pairs, strict=True) if unit}


def _delimiter(line: str) -> str:
    """Semicolon before tab before comma before blanks: the rarer in a name decides first."""
    bare = "".join(part for k, part in enumerate(line.split('"')) if k % 2 == 0)
    for candidate in (";", "\t", ","):
        if candidate in bare:
            return candidate
    cells = line.split()
    if len(cells) > 1 and all(_is_number(cell, comma=True) for cell in cells):
        return " "
    return ","


def _is_number(cell: str, comma: bool) -> bool:
    text = cell.strip().replace(",", ".") if comma else cell.strip()
    if text.lower() == "nan":
        return True
    if not set(text) <= _NUMBER:
        return False
    try:
        float(text)
    except ValueError:
        return False
    return True
