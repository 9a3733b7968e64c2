"""Text tables, read line by line: delimiter, decimal comma, encoding and line ends are seen.

Nothing is guessed cell by cell: what cannot be read as one consistent table is refused, with the
line and the column.
"""

from __future__ import annotations

import csv
import io
import math
import re
import warnings
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import date
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import IO, Any

import numpy as np

from elevon.arrays import Floats
from elevon.errors import FormatError, quoted
from elevon.logs.formats.cells import (
    COMMA,
    MISSING,
    ROWS,
    STAMP,
    WHOLE,
    begins_table,
    find_delimiter,
    is_grouped,
    is_number,
    is_row,
    looks_like_unit,
    split_cells,
    ungrouped,
)
from elevon.logs.formats.table import (
    DEFAULT_LIMITS,
    Limits,
    RawTable,
    existing_file,
    open_bytes,
    split_unit,
    unique_names,
)

_AHEAD = 64  # lines looked at to find where the table begins, and what its columns hold
_NOTED = 60  # lines of a preamble that are kept
_BYTES_PER_VALUE = 32
_COMMENTS = 20
_WORDS = 64
_PLAIN = b"0123456789+-.eE,\n"
_BLOCK = 1 << 20  # bytes
_EPOCH = date(1970, 1, 1).toordinal()


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
    text: dict[int, dict[str, int]] = field(default_factory=dict)
    stamps: set[int] = field(default_factory=set)
    stated: dict[str, str] = field(default_factory=dict)
    comments: list[str] = field(default_factory=list)
    expanded: int = 0
    ended: bool = True
    number: int = 0
    blank: int = 0
    comments_header: list[str] = field(default_factory=list)
    units_row: dict[str, str] = field(default_factory=dict)

    def read(self, stream: IO[bytes], header: bool | None) -> RawTable:
        """Read all lines."""
        stream = self._as_utf8(stream)
        lines = self._lines(stream)
        ahead = [item for item in islice(lines, _AHEAD) if not self.preface(item[1])]
        if not ahead:
            ahead = [item for item in lines if not self.preface(item[1])][:1]
        if not ahead:
            raise FormatError(f"{self.source}: holds no line of text")
        ahead = self._behind_preamble(ahead, header)
        names = self.begin(ahead[0][1], ahead[0][0], self._named(ahead, header))
        ahead = self._units_row(ahead[1:], names)
        self._look_at(ahead, len(names))
        for position, text in ahead:
            self.row(text, position, len(names))
        while block := self._block(stream):
            if not self._plain(block, len(names)):
                for position, text in self._lines(BytesIO(block)):
                    if not self._is_comment(text, position):
                        self.row(text, position, len(names))
        if self.blank:
            self.notes.append(f"{self.blank} blank lines passed over")
        return self._table(names)

    def _as_utf8(self, stream: IO[bytes]) -> IO[bytes]:
        """Return a stream of UTF-8 where a byte-order mark says UTF-16."""
        start = stream.read(2)
        whole = io.BufferedReader(_Joined(start, stream))
        if start not in (b"\xff\xfe", b"\xfe\xff"):
            return whole
        self.notes.append("UTF-16 text")
        most = _BYTES_PER_VALUE * self.limits.values
        raw = whole.read(most + 1)
        if len(raw) > most:
            raise FormatError(f"{self.source}: UTF-16 text of more than {most} bytes")
        try:
            return BytesIO(raw.decode("utf-16").encode())
        except UnicodeDecodeError as error:
            raise FormatError(f"{self.source}: damaged UTF-16 text: {error}") from error

    def _is_comment(self, text: str, number: int) -> bool:
        if not text.startswith(("#", "%")):
            return False
        if len(self.notes) < _NOTED:
            self.notes.append(f"line {number} is a comment: {quoted(text[1:].strip())}")
        return True

    def _behind_preamble(
        self, ahead: list[tuple[int, str]], header: bool | None
    ) -> list[tuple[int, str]]:
        """Leave out the lines before the table, which are kept as notes; find the delimiter.

        The table begins with the first line of names, as many as the cells of each of the next
        rows of numbers (a row of units may stand between). Where no such line is found nothing is
        left out.
        """
        texts = [text for _, text in ahead]
        given = (
            [self.delimiter] if self.delimiter else [find_delimiter(texts[0]), ";", "\t", ",", " "]
        )
        for delimiter in given:
            begin = next((k for k in range(len(texts)) if begins_table(texts, k, delimiter)), None)
            if begin is None or (begin and header is False):
                continue
            self.delimiter = delimiter
            for number, text in ahead[:begin]:
                self._note(text, number)
            return ahead[begin:]
        return ahead

    def _note(self, text: str, number: int) -> None:
        """Keep a line of the preamble: a key and its value where it is one."""
        if len(self.stated) >= _NOTED:
            return
        line = text.strip().strip((self.delimiter or "") + '" ').strip()
        match = re.match(r"([^:=;\t,]{1,60}?)\s*[:=;\t,]\s*(.{1,200})$", line)
        key, value = (match[1].strip(), match[2].strip()) if match else (f"line {number}", line)
        self.stated.setdefault(key, value[:200])
        self.notes.append(f"line {number} stands before the table: {quoted(line)}")

    def _named(self, ahead: Sequence[tuple[int, str]], header: bool | None) -> bool | None:
        """Take the names from the last comment where the table has none and they are as many."""
        cells = self._split(ahead[0][1], ahead[0][0]) if self.delimiter else []
        if header is not None or not self.comments or not cells or not is_row(cells):
            return header
        names = split_cells(self.comments[-1], self.delimiter or ",")
        if len(names) != len(cells):
            names = self.comments[-1].split()
        if len(names) == len(cells) and not any(is_number(n, comma=True) for n in names):
            self.comments_header = names
        return header

    def _units_row(self, ahead: list[tuple[int, str]], names: list[str]) -> list[tuple[int, str]]:
        """Take a row of units below the names; return what is left."""
        if not ahead or self.delimiter is None:
            return ahead
        cells = [cell.strip().strip('[]()"') for cell in split_cells(ahead[0][1], self.delimiter)]
        rows = [split_cells(text, self.delimiter) for _, text in ahead[1 : 1 + ROWS]]
        if (
            len(cells) != len(names)
            or any(is_number(cell, comma=True) for cell in cells if cell)
            or not rows
            or not all(len(row) == len(names) and is_row(row) for row in rows)
            or not any(looks_like_unit(cell) for cell in cells)
        ):
            return ahead
        self.units_row = dict(zip(names, cells, strict=True))
        self.notes.append(f"line {ahead[0][0]} states units")
        return ahead[1:]

    def _look_at(self, ahead: Sequence[tuple[int, str]], columns: int) -> None:
        """See what the first rows hold: columns of words, stamps of a calendar, decimal commas."""
        rows = [
            cells
            for _, text in ahead
            if len(cells := split_cells(text, self.delimiter or ",")) >= columns
        ]
        for place in range(columns):
            cells = [
                row[place].strip() for row in rows if row[place].strip().lower() not in MISSING
            ]
            if (
                place in self.words
                or not cells
                or any(is_number(c, comma=True) or is_grouped(c) for c in cells)
            ):
                continue
            if all(STAMP.fullmatch(cell) for cell in cells):
                self.stamps.add(place)
            elif len(cells) > 1 or len(rows) == 1:
                self.text[place] = {}
        if len(self.text) + len(self.stamps) == columns:
            self.text, self.stamps = {}, set()
        numbers = [
            c.strip()
            for row in rows
            for k, c in enumerate(row)
            if k not in self.text and k not in self.stamps
        ]
        points = any("." in c and not WHOLE.fullmatch(c) and not is_grouped(c) for c in numbers)
        if self.delimiter != "," and not points and any(COMMA.fullmatch(c) for c in numbers):
            self.decimal_comma_line = ahead[0][0]
            self.notes.append("decimal comma")

    def _block(self, stream: IO[bytes]) -> bytes:
        """Return whole lines, about as many as a block holds; one that is too long is cut."""
        block = stream.read(_BLOCK)
        whole = not block or block.endswith(b"\n")
        return block if whole else block + stream.readline(self.limits.line_bytes + 1)

    def _plain(self, block: bytes, columns: int) -> bool:
        """Take a block whose every line is numbers between commas; whether it is one.

        Any other block is left to be read line by line, which takes twice the time.
        """
        if self.delimiter != "," or self.words or self.text or self.stamps:
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
        names = self.comments_header or names
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
        elif line.startswith(("#", "%")):
            text = line.lstrip("#% \t").rstrip()
            self.comments.append(text)
            if len(self.comments) <= _COMMENTS:
                self.notes.append(f"comment: {quoted(text)}")
                key, sign, value = text.partition(":" if ":" in text else "=")
                if sign and value.strip():
                    self.stated.setdefault(key.strip()[:60], value.strip()[:200])
        else:
            return False
        return True

    def _names(
        self, line: str, number: int, header: bool | None
    ) -> tuple[list[str], tuple[int, str] | None]:
        """Find the delimiter and the names; the line itself comes back when it holds numbers."""
        if self.delimiter is None:
            self.delimiter = find_delimiter(line)
        cells = self._split(line, number)
        numeric = all(is_number(cell, self.delimiter != ",") for cell in cells if cell.strip())
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
        for place, seen in self.text.items():
            if len(seen) < _WORDS:
                seen.setdefault(cells[place].strip()[:100], 0)
            cells[place] = ""
        for place in self.stamps:
            cells[place] = self._seconds(cells[place], number, place)
        if self.delimiter != "," or '"' in line:
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

    def _seconds(self, cell: str, number: int, place: int) -> str:
        """Return a stamp of calendar or clock as seconds; the day counts from year 1."""
        match = STAMP.fullmatch(cell.strip())
        if match is None:
            raise FormatError(
                f"{self.source}, line {number}, column {place + 1}: {quoted(cell.strip())} is no "
                "time of day as in the rows before"
            )
        year, month, day, day2, month2, year2, hours, minutes, seconds = match.groups()
        days = 0
        try:
            if year or year2:
                days = date(int(year or year2), int(month or month2), int(day or day2)).toordinal()
        except ValueError as error:
            raise FormatError(f"{self.source}, line {number}: {quoted(cell)}: {error}") from error
        whole = 86400 * (days - _EPOCH if days else 0) + 3600 * int(hours) + 60 * int(minutes)
        return repr(whole + float(seconds.replace(",", ".")))

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
        given, cells = cells, [ungrouped(c, comma=bool(self.decimal_comma_line)) for c in cells]
        if self.delimiter == ",":
            return [c if c == g else c.replace(",", ".") for c, g in zip(cells, given, strict=True)]
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
        if text.lower() in MISSING:
            return math.nan
        if not is_number(text, comma=False):
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
        numeric = [k for k in range(len(names)) if k not in self.text]
        for k, seen in self.text.items():
            listed = ", ".join(quoted(word) for word in list(seen)[:5])
            more = ", ..." if len(seen) > 5 else ""
            self.notes.append(
                f"column {quoted(names[k])} holds text and is kept as a note: {listed}{more}"
            )
        columns, units = named_columns([names[k] for k in numeric], data[:, numeric])
        labels = dict(zip((names[k] for k in numeric), columns, strict=True))
        for name, unit in self.units_row.items():
            if unit and name in labels:
                units.setdefault(labels[name], unit)
        for k in self.stamps:
            units[labels[names[k]]] = "s"
        words = {names[k]: "\n".join(values) for k, values in (self.words | self.text).items()}
        return RawTable(self.source, columns, units, tuple(self.notes), "csv", self.stated | words)


class _Joined(io.RawIOBase):
    """Bytes that were read already, and the rest of their stream."""

    def __init__(self, start: bytes, stream: IO[bytes]) -> None:
        self._start, self._stream = start, stream

    def readable(self) -> bool:
        """Always."""
        return True

    def readinto(self, buffer: Any) -> int:  # the base class's type
        """Fill a buffer; return how many bytes it has."""
        data = self._start or self._stream.read(len(buffer))
        self._start = data[len(buffer) :] if self._start else b""
        data = data[: len(buffer)]
        buffer[: len(data)] = data
        return len(data)


def named_columns(names: list[str], data: Floats) -> tuple[dict[str, Floats], dict[str, str]]:
    """Return the columns of a table, shape (n, c), by name, and the units that the names state."""
    pairs = [split_unit(name) for name in names]
    short = [name for name, _ in pairs]
    labels = short if len(set(short)) == len(short) else names
    columns = {label: data[:, k].copy() for k, label in enumerate(labels)}
    return columns, {label: unit for label, (_, unit) in zip(labels, pairs, strict=True) if unit}
