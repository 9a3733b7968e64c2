"""A published case on the command line: what it computes, writes and prints, as one record."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.output import Advance, print_json, print_table, progress_bar, say

if TYPE_CHECKING:
    from elevon.report import Report

__all__ = ["Options", "PublishedCase", "Values", "add_command", "cell", "print_columns"]

Options = Mapping[str, Any]
Values = dict[str, Any]

_JSON = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
_OUT = Annotated[
    Path | None, typer.Option("--out", help="Folder for report.html and the rows as CSV.")
]
_FORCE = Annotated[bool, typer.Option("--force", help="Replace existing files.")]
_SEED = Annotated[int, typer.Option("--seed", min=0, help="Seed of every random number.")]
_DATE = Annotated[str | None, typer.Option("--date", help="Date printed in the report.")]


@dataclass(frozen=True)
class PublishedCase:
    """One published case.

    Attributes
    ----------
    name : str
        The command.
    text : str
        What it does, in one sentence.
    title : str
        Shown while it works.
    work : callable
        Options and progress to a result, which has ``to_dict()`` with status, checks and rows.
    show : callable
        Prints the result's values but for the checks; gets the result itself, too.
    page : callable or None
        Result, date and options to the report; None: nothing is written.
    options : mapping of str to (annotation, default)
        Options beyond those that every case has.
    seeded : bool
        Whether it draws random numbers.
    prepare, finish : callable or None
        Before the work (refuse what cannot be written), and after the report.
    """

    name: str
    text: str
    title: str
    work: Callable[[Options, Advance], Any]
    show: Callable[[Values, Any], None]
    page: Callable[[Any, Options], Report] | None = None
    options: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)
    seeded: bool = True
    prepare: Callable[[Options], None] | None = None
    finish: Callable[[Any, Options], None] | None = None

    def signature(self) -> dict[str, tuple[Any, Any]]:
        """Return its options: name to annotation and default."""
        common: dict[str, tuple[Any, Any]] = {"as_json": (_JSON, False)}
        if self.page is not None:
            common |= {"out": (_OUT, None), "force": (_FORCE, False), "date": (_DATE, None)}
        if self.seeded:
            common["seed"] = (_SEED, 0)
        return {**common, **self.options}


def add_command(app: typer.Typer, case: PublishedCase) -> None:
    """Add a case's command, its options made from its record."""

    def command(**options: Any) -> int:
        return _run(case, options)

    options = case.signature()
    kind = inspect.Parameter.KEYWORD_ONLY
    command.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [
            inspect.Parameter(name, kind, default=default, annotation=annotation)
            for name, (annotation, default) in options.items()
        ]
    )
    command.__annotations__ = {name: annotation for name, (annotation, _) in options.items()}
    command.__doc__ = case.text
    app.command(case.name)(command)


def _run(case: PublishedCase, options: Options) -> int:
    """Compute, write, print; 0 when every check passed, else 1."""
    out: Path | None = options.get("out")
    if out is not None:
        _check_folder(out, options["force"])
    if case.prepare is not None:
        case.prepare(options)
    with progress_bar(case.title) as advance:
        result = case.work(options, advance)
    values: Values = result.to_dict()
    if out is not None and case.page is not None:
        _write(out, case.page(result, options), values["rows"], options["force"])
    if case.finish is not None:
        case.finish(result, options)
    if options["as_json"]:
        print_json(values)
    else:
        case.show(values, result)
        _print_checks(values)
    return 0 if values["status"] == "pass" else 1


def _check_folder(out: Path, force: bool) -> None:
    """Refuse an output that cannot be written before the work, not after it."""
    from elevon.files import check_output

    for name in ("report.html", "rows.csv"):
        check_output(out / name, force=force)


def _write(out: Path, report: Report, rows: list[Values], force: bool) -> None:
    """Write the report and the rows."""
    import csv
    import io

    from elevon.files import write_text
    from elevon.report.cells import csv_cell

    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: csv_cell(cell) for name, cell in row.items()} for row in rows)
    write_text(out / "rows.csv", stream.getvalue(), force=force)
    say(f"report: {report.save(out / 'report.html', force=force)}")


def print_columns(rows: list[Values], columns: tuple[str, ...], title: str | None = None) -> None:
    """Print some columns of rows as a table."""
    cells = [[cell(row[name]) for name in columns] for row in rows]
    print_table([name.replace("_", " ") for name in columns], cells, title=title)


def cell(value: object) -> str:
    """Return a value as a cell of a table."""
    if isinstance(value, bool):
        return "yes" if value else "NO"
    if isinstance(value, list):
        return " to ".join(cell(item) for item in value)
    if isinstance(value, float):
        return f"{value:.5g}"
    return "-" if value is None else str(value)


def _print_checks(values: Values) -> None:
    rows = [
        [
            check["name"],
            f"{check['value']:.5g}",
            f"{'>=' if check['at_least'] else '<='} {check['limit']:.5g} {check['unit']}",
            "pass" if check["passed"] else "FAIL",
        ]
        for check in values["checks"]
    ]
    print_table(["check", "value", "limit", ""], rows)
