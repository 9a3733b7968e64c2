"""Lines of text tables: their cells, what is a number, and where a table begins."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence

from elevon.errors import InputError
from elevon.units import parse_unit

MISSING = {"", "nan", "-", "--", "---", "n/a", "na", "null", "#n/a"}
ROWS = 3  # rows of numbers, or the whole rest, that show a table
#: Groups of three digits, by the sign between them, and the sign of the decimals.
_GROUPED = (
    (re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+,\d+"), ".", ","),
    (re.compile(r"[+-]?\d{1,3}(?:,\d{3})+\.\d+"), ",", "."),
    (
        re.compile(r"[+-]?\d{1,3}(?:[ '\u2019\u00a0\u202f]\d{3})+(?:[.,]\d+)?"),
        " '\u2019\u00a0\u202f",
        ",",
    ),
)
WHOLE = re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+")
COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
STAMP = re.compile(
    r"(?:(\d{4})-(\d\d)-(\d\d)[ T]|(\d\d?)[./](\d\d?)[./](\d{4})[ T,]+)?"
    r"(\d{1,2}):(\d\d):(\d\d(?:[.,]\d+)?)(?:Z|[+-]\d\d:?\d\d)?"
)
_NUMBER = set("0123456789+-.eE \t")


def split_cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line; of bad quotes the line as it is."""
    if '"' in line:
        try:
            cells = next(csv.reader([line], delimiter=delimiter, strict=True), [])
        except csv.Error:
            cells = [line]
    else:
        cells = line.split() if delimiter == " " else line.split(delimiter)
    return cells[:-1] if len(cells) > 1 and not cells[-1].strip() else cells


def is_row(cells: Sequence[str]) -> bool:
    """Whether at least half of what stands in the cells, and two of them, are numbers or stamps."""
    stated = [cell.strip() for cell in cells if cell.strip()]
    count = sum(
        is_number(c, comma=True) or is_grouped(c) or bool(STAMP.fullmatch(c)) for c in stated
    )
    return count >= 2 and 2 * count >= len(stated)


def begins_table(texts: Sequence[str], at: int, delimiter: str) -> bool:
    """Whether a line names the rows below it, or is the first of rows without names."""
    names = split_cells(texts[at], delimiter)
    rows = [
        split_cells(text, delimiter)
        for text in texts[at + 1 : at + 2 + ROWS]
        if text[:1] not in "#%"
    ]
    if len(names) < 2:
        return False
    if is_row(names):
        whole = len(rows) >= ROWS and all(len(row) == len(names) and is_row(row) for row in rows)
        return not at or (whole and all(":" in text or "=" in text for text in texts[:at]))
    if rows and len(rows[0]) == len(names) and not is_row(rows[0]):
        rows = rows[1:]  # units, it may be
    filled = sum(bool(name.strip()) for name in names)
    return (
        bool(rows)
        and filled == len(names)
        and all(len(row) == len(names) and is_row(row) for row in rows[:ROWS])
    )


def looks_like_unit(text: str) -> bool:
    """Whether a short text is a unit."""
    return 0 < len(text) <= 8 and bool(_known_unit(text))


def _known_unit(text: str) -> str:
    try:
        return parse_unit(text).text
    except InputError:
        return ""


def is_grouped(cell: str) -> bool:
    """Whether a number has signs between its thousands that can only be that."""
    return any(pattern.fullmatch(cell) for pattern, _, _ in _GROUPED)


def ungrouped(cell: str, *, comma: bool) -> str:
    """Return a number without the signs between its thousands, where they can only be that."""
    text = cell.strip()
    if len(text) < 5:
        return cell
    for pattern, groups, _ in _GROUPED:
        if pattern.fullmatch(text):
            return "".join(c for c in text if c not in groups)
    if comma and WHOLE.fullmatch(text):
        return text.replace(".", "")
    return cell


def find_delimiter(line: str) -> str:
    """Semicolon before tab before comma before blanks: the rarer in a name decides first."""
    bare = "".join(part for k, part in enumerate(line.split('"')) if k % 2 == 0)
    for candidate in (";", "\t", ","):
        if candidate in bare:
            return candidate
    cells = line.split()
    if len(cells) > 1 and all(is_number(cell, comma=True) for cell in cells):
        return " "
    return ","


def is_number(cell: str, comma: bool) -> bool:
    """Whether a cell is a number; `comma`: also one with a decimal comma."""
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
