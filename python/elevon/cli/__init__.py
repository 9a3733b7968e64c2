"""Command line: a table of command modules, each loaded only when its command is requested.

A command is one module with a `typer.Typer` named ``app``. To add one, add a line to
`elevon.cli.registry.COMMANDS`.
"""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["main"]


def main(
    argv: Sequence[str] | None = None,
    *,
    module: str = "elevon.cli.runner",
    program: str = "elevon",
) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments after the program's name; by default those of the process, which then is taken
        to end with the command.
    module, program : str
        Where the typer application ``app`` is, and how it is called; by default Elevon's own.

    Returns
    -------
    int
        0 success, 1 a run or a check failed, 2 bad usage or input, 130 interrupted, 143 terminated.
    """
    from elevon.cli import interrupt

    with interrupt.watched(owner=argv is None):
        try:
            from elevon.cli.runner import run

            code = run(argv, module, program)
        except KeyboardInterrupt:  # before the command began
            interrupt.ignore()
            import sys

            sys.stderr.write(
                "elevon: interrupted; nothing was written; give the command again to start over\n"
            )
            code = interrupt.code()
        if argv is None and code in (interrupt.INTERRUPTED, interrupt.TERMINATED):
            interrupt.leave(code)
        return code
