"""What commands print: on stdout one JSON object, or an answer and its tables; else on stderr.

No name and no value of a table is ever cut, however narrow the terminal. What does not fit beside
the others goes, in this order: the columns named optional are left out (and said to be), prose is
wrapped between words, and a row is broken: what is left of it follows on lines of its own, indented
under its first cell.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from elevon.cli import interrupt
from elevon.plain import plain
from elevon.results import finite

if TYPE_CHECKING:
    from pathlib import Path

    from elevon.results import Result


def print_json(value: Mapping[str, Any]) -> None:
    """Write one JSON object, and nothing else, on stdout; with it the command has answered."""
    text = json.dumps(finite(plain(value)), allow_nan=False, indent=2) + "\n"
    interrupt.check()
    sys.stdout.write(text)
    sys.stdout.flush()
    interrupt.ignore()


def print_table(
    columns: Sequence[str],
    rows: Sequence[Sequence[object]],
    *,
    title: str | None = None,
    optional: Sequence[str] = (),
    fitted: bool = False,
) -> None:
    """Write a table on stdout: fitted to a terminal, one line a row for a pipe.

    Parameters
    ----------
    columns : sequence of str
        Headings.
    rows : sequence of sequences
        Cells; no name and no value is cut, see `table_lines`.
    title : str, optional
        Above it.
    optional : sequence of str
        Columns that may be left out where the terminal is too narrow, the first one first.
    fitted : bool
        Whether it is fitted without a terminal, too: to 80 columns, or those of COLUMNS.
    """
    terminal = sys.stdout.isatty()
    width = shutil.get_terminal_size().columns if terminal or fitted else None
    lines = table_lines(columns, rows, width, optional)
    if terminal and "NO_COLOR" not in os.environ:
        lines[0] = f"\033[1m{lines[0]}\033[0m"
    sys.stdout.write("\n".join([*([title] if title else []), *lines]) + "\n")


@dataclass
class _Lists:
    """Whether long lists are printed whole: ``--details``."""

    whole: bool = False


_lists = _Lists()
_FEW = 3  # lines of a list that are printed without --details


def show_details(value: bool) -> bool:
    """Take ``--details`` for the rest of this command."""
    _lists.whole = value
    return value


def answer(*lines: str) -> None:
    """Write the answer on stdout, its first line first; tables follow it."""
    sys.stdout.write("".join(f"{line}\n" for line in lines))


def listed(lines: Sequence[str]) -> None:
    """Write a list of an answer on stdout: whole with ``--details``, else its first lines."""
    few = lines if _lists.whole else lines[:_FEW]
    answer(*few)
    if len(few) < len(lines):
        answer(f"and {len(lines) - len(few)} more: --details")


def print_result(result: Result, *more: str, file: Path | None = None) -> None:
    """Write a result on stdout: its answer, further lines of it, its tables, its remarks."""
    answer(result.headline if file is None else f"{result.headline} -> {file}", *more)
    for table in result.text_tables():
        print_table(table.columns, table.rows, title=table.caption or None, optional=table.optional)
    listed(result.remarks)


def say(message: str) -> None:
    """Write a message on stderr."""
    sys.stderr.write(message + "\n")
    sys.stderr.flush()


class Advance(Protocol):
    """Told how far the work is; returns False when the work should stop."""

    def __call__(self, fraction: float, /) -> bool:
        """Take the done fraction, 0 to 1."""
        ...


@contextmanager
def progress_bar(title: str) -> Iterator[Advance]:
    """Show progress on stderr: a bar on a terminal, a line each tenth otherwise; it ends at 100 %.

    Yields
    ------
    callable
        Takes the done fraction (0 to 1); returns True ("carry on"). A Ctrl-C whose exception was
        lost comes out here.
    """
    if not sys.stderr.isatty():
        lines = _PlainProgress(title)
        yield lines
        lines.end()
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(title, total=1.0)

        def advance(fraction: float) -> bool:
            interrupt.check()
            bar.update(task, completed=fraction)
            return True

        yield advance
        bar.update(task, completed=1.0)  # what was left out on the way is done, too


@dataclass
class _PlainProgress:
    """Lines on stderr, one a tenth."""

    title: str
    tenths: int = 0

    def __call__(self, fraction: float, /) -> bool:
        interrupt.check()
        if int(fraction * 10) > self.tenths:
            self.tenths = int(fraction * 10)
            say(f"{self.title}: {self.tenths * 10} %")
        return True

    def end(self) -> None:
        """Say that all is done, where something was said before."""
        if 0 < self.tenths < 10:
            say(f"{self.title}: 100 %")


_GAP = "  "
_INDENT = "    "
_LEAST_PROSE = 24
"""Columns of prose are not made narrower than this."""
_VALUE_WORDS = 3
"""Most spaces within a value with its unit, which is not wrapped; what has more is prose."""
_HARD = "\u00a0"


def table_lines(
    columns: Sequence[str],
    rows: Sequence[Sequence[object]],
    width: int | None = None,
    optional: Sequence[str] = (),
) -> list[str]:
    """Return a table as lines.

    Parameters
    ----------
    columns : sequence of str
        Headings.
    rows : sequence of sequences
        Cells, as many a row as there are columns.
    width : int, optional
        Of the terminal; None: one line a row, however long.
    optional : sequence of str
        Columns that may be left out, the first one first.

    Returns
    -------
    list of str
        Longer than `width` only where one name or value alone is.
    """
    heads = list(columns)
    cells = [[" ".join(str(cell).split()) for cell in row] for row in rows]
    if width is None:
        return _lines(heads, cells)
    dropped = _drop(heads, cells, width, optional)
    lines = _fitted(heads, cells, width)
    if dropped:
        lines += textwrap.wrap(f"not shown at this width: {', '.join(dropped)}", width)
    return lines


def _widths(heads: Sequence[str], cells: Sequence[Sequence[str]]) -> list[int]:
    return [max(len(row[k]) for row in (heads, *cells)) for k in range(len(heads))]


def _needed(widths: Sequence[int]) -> int:
    return sum(widths) + len(_GAP) * (len(widths) - 1)


def _least(heads: Sequence[str], cells: Sequence[Sequence[str]]) -> list[int]:
    """Return the widths to which columns can be wrapped: whole words, and whole values."""
    return [
        max(len(heads[k]), _longest_word(cells, k), min(_LEAST_PROSE, full)) if prose else full
        for k, (full, prose) in enumerate(
            zip(_widths(heads, cells), _prose(heads, cells), strict=True)
        )
    ]


def _prose(heads: Sequence[str], cells: Sequence[Sequence[str]]) -> list[bool]:
    """Tell which columns are text: some cell has more words than a value with its unit."""
    return [any(row[k].count(" ") > _VALUE_WORDS for row in cells) for k in range(len(heads))]


def _longest_word(cells: Sequence[Sequence[str]], k: int) -> int:
    return max((len(word) for row in cells for word in row[k].split()), default=0)


def _drop(
    heads: list[str], cells: list[list[str]], width: int, optional: Sequence[str]
) -> list[str]:
    """Leave out optional columns while the table is too wide; return their names."""
    dropped: list[str] = []
    for name in optional:
        if name in heads and _needed(_least(heads, cells)) > width:
            k = heads.index(name)
            for row in (heads, *cells):
                del row[k]
            dropped.append(name)
    return dropped


def _fitted(heads: list[str], cells: list[list[str]], width: int) -> list[str]:
    full, least = _widths(heads, cells), _least(heads, cells)
    if _needed(full) <= width:
        return _lines(heads, cells)
    if _needed(least) <= width:
        return _wrapped(heads, cells, _shared(full, least, width))
    return _broken(heads, cells, width)


def _shared(full: Sequence[int], least: Sequence[int], width: int) -> list[int]:
    """Share the width left among the columns that want it, the narrowest first."""
    widths, spare = list(least), width - _needed(least)
    wanting = sorted((k for k in range(len(full)) if full[k] > least[k]), key=lambda k: full[k])
    for place, k in enumerate(wanting):
        more = min(full[k] - least[k], spare // (len(wanting) - place))
        widths[k] += more
        spare -= more
    return widths


def _lines(heads: Sequence[str], cells: Sequence[Sequence[str]]) -> list[str]:
    widths = _widths(heads, cells)
    return [_line(row, widths) for row in (heads, *cells)]


def _line(row: Sequence[str], widths: Sequence[int]) -> str:
    return _GAP.join(cell.ljust(size) for cell, size in zip(row, widths, strict=True)).rstrip()


def _wrapped(heads: Sequence[str], cells: Sequence[Sequence[str]], widths: list[int]) -> list[str]:
    lines = [_line(heads, widths)]
    for row in cells:
        parts = [_words(cell, size) for cell, size in zip(row, widths, strict=True)]
        height = max(len(part) for part in parts)
        for k in range(height):
            lines.append(_line([part[k] if k < len(part) else "" for part in parts], widths))
    return lines


def _words(text: str, width: int) -> list[str]:
    wrapped = textwrap.wrap(text, width, break_long_words=False, break_on_hyphens=False)
    return wrapped or [""]


def _broken(heads: list[str], cells: list[list[str]], width: int) -> list[str]:
    """Return rows of several lines: as many columns in line as fit, the others underneath."""
    widths = _least(heads, cells)
    first = 1
    while first < len(heads) and _needed(widths[: first + 1]) <= width:
        first += 1
    lines = [_line(heads[:first], widths[:first])]
    for row in cells:
        lines += _wrapped(heads[:first], [row[:first]], widths[:first])[1:]
        lines += _under(heads[first:], row[first:], width)
    return lines


def _under(heads: Sequence[str], row: Sequence[str], width: int) -> list[str]:
    """Return the rest of a row, each cell with its heading, as many on a line as fit."""
    lines: list[str] = []
    line = ""
    for head, cell in zip(heads, row, strict=True):
        if not cell:
            continue
        whole = cell if cell.count(" ") > _VALUE_WORDS else cell.replace(" ", _HARD)
        text = f"{head.replace(' ', _HARD)}:{_HARD}{whole}" if head else whole
        if line and len(_INDENT) + len(line) + 2 + len(text) <= width:
            line = f"{line}; {text}"
            continue
        lines += _indented(line, width)
        line = text
    return lines + _indented(line, width)


def _indented(text: str, width: int) -> list[str]:
    wrapped = textwrap.wrap(
        text,
        width,
        initial_indent=_INDENT,
        subsequent_indent=_INDENT + _GAP,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace(_HARD, " ") for line in wrapped]
