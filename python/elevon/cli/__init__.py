"""Command line: a table of command modules, each loaded only when its command is asked for.

A command is one module with a `typer.Typer` named ``app``. To add one, add a line to `COMMANDS`.
"""

from __future__ import annotations

from collections.abc import Sequence

from elevon.cli.registry import COMMANDS, Command
from elevon.cli.runner import run

__all__ = ["COMMANDS", "Command", "main"]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments after the program's name; by default those of the process.

    Returns
    -------
    int
        0 success, 1 a run or a check failed, 2 bad usage or input, 130 interrupted.
    """
    return run(argv)
