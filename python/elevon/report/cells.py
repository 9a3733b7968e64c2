"""Texts of somebody else in CSV cells and in Markdown: written so that they stay texts."""

from __future__ import annotations

import re
from typing import Any

FORMULA = "=+-@\t\r"
"""A text that begins with one of these is read as a formula by spreadsheets."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(inf|nan)")


def _begins_formula(text: str) -> bool:
    """Whether it does, blanks before it or not: some readers strip them."""
    return text[:1] in ("\t", "\r") or text.lstrip().startswith(tuple(FORMULA))


def csv_cell(value: object) -> object:
    """Return a cell as it goes into a CSV file.

    The rule of every CSV file: a text that a spreadsheet would read as a formula gets an apostrophe
    before it. Numbers, and texts that are numbers, stay as they are.
    """
    if isinstance(value, str) and _begins_formula(value) and not _NUMBER.fullmatch(value):
        return f"'{value}"
    return value


def quoted_columns(table: Any) -> Any:
    """Return a pyarrow table whose names and texts follow the rule of `csv_cell`."""
    import pyarrow as pa

    for at, column in enumerate(table.columns):
        kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
        if pa.types.is_string(kind) or pa.types.is_large_string(kind):
            cells = [csv_cell(cell) for cell in column.to_pylist()]
            table = table.set_column(at, table.column_names[at], pa.array(cells, kind))
    return table.rename_columns([str(csv_cell(name)) for name in table.column_names])


_MARKS = re.compile(r"([\\`*\[\]|~])")
_OPENING = re.compile(r"^(\s*)([#>+=-]|\d+[.)])")


def markdown_text(text: object) -> str:
    """Return a text as Markdown that shows just it: on one line, no markup, no HTML."""
    words = " ".join(str(text).split())
    words = words.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return _OPENING.sub(r"\1\\\2", _MARKS.sub(r"\\\1", words))
