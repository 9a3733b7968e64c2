"""What commands print: on stdout one JSON object, or an answer and its tables; else on stderr."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

from elevon.cli import interrupt
from elevon.plain import plain
from elevon.results import finite


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
    """
    from elevon.cli.table import table_lines

    terminal = sys.stdout.isatty()
    width = shutil.get_terminal_size().columns if terminal else None
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
