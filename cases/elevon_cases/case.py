"""A published case on the command line: what it computes, writes and prints, as one record."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import typer

from elevon.cli.help import PlainCommand
from elevon.cli.options import SHARED, annotated, own_parameters
from elevon.cli.output import answer, print_json, print_table, progress_bar, say
from elevon.option import Option
from elevon_cases.catalogue import Published, published

if TYPE_CHECKING:
    from elevon.report import Report
    from elevon.report.checks import WithChecks

_OUT = Option(metavar="DIR", help="Folder for report.html and the rows as CSV.")
Options = Mapping[str, Any]
Values = dict[str, Any]

#: Types that an option without a default may state.
_TYPES: Mapping[str, Any] = {"path": Path, "texts": list[str], "count": int}


@dataclass(frozen=True)
class PublishedCase:
    """One published case, or one study.

    Functions are named ``MODULE:FUNCTION``, so that a list of cases imports none of them; each is
    given those options that it has an argument for.

    Attributes
    ----------
    name, text, title : str
        The command; what it does, in one sentence; command_class while it works.
    work : str or callable
        To a result, which has ``to_dict()`` with status, checks and rows. Of a function its
        signature and docstring state the options.
    columns : tuple of str
        Of the rows' table; empty: none.
    table : str or None
        Above that table.
    page : str
        Result to the report; empty: nothing is written.
    options : mapping of str to mapping
        Options beyond those that every case has: as in ``options.toml``, with ``default``, or with
        ``type`` (``path``, ``texts``, ``count``) and, where it must be given, ``required``.
    example : str
        Words that follow the name in the example of its help; empty: ``--out NAME``.
    names : mapping of str to str
        Arguments of the work that an option of another name gives.
    seeded : bool
        Whether it draws random numbers.
    prepare, show, finish : callable or None
        Before the work (refuse what cannot be written), after the table, and after the report;
        what `finish` takes beyond the result is an option, too.
    """

    name: str
    text: str
    title: str
    work: str | Callable[..., Any]
    columns: tuple[str, ...] = ()
    table: str | None = None
    page: str = ""
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    example: str = ""
    names: Mapping[str, str] = field(default_factory=lambda: {"folder": "out"})
    seeded: bool = True
    prepare: Callable[[Options], None] | None = None
    show: Callable[[Values, Any], None] | None = None
    finish: Callable[..., None] | None = None

    def signature(self) -> dict[str, tuple[object, object]]:
        """Return its options: name to annotation and default."""
        common: dict[str, tuple[Any, Any]] = {"as_json": (bool, False)}
        if self.page:
            common |= {
                "out": (Path | None, None),
                "force": (bool, False),
                "date": (str | None, None),
            }
        if self.seeded:
            common["seed"] = (int, 0)
        texts = {**SHARED, "out": _OUT}
        shared = {
            name: (annotated(name, kind, texts[name]), default)
            for name, (kind, default) in common.items()
        }
        stated = {name: _own_option(name, entry) for name, entry in self.options.items()}
        known = {"result", "progress", "seed", "out", "force", "date", *stated}
        for function in (self.work, self.finish):
            if callable(function):
                for item in own_parameters(function, without=[*known]):
                    stated[item.name] = (item.annotation, item.default)
                    known.add(item.name)
        return shared | stated

    @property
    def published(self) -> Published | None:
        """What it recomputes of the published works; None for what no work prints."""
        return published().get(self.name)

    def defaults(self) -> dict[str, Any]:
        """Return its options as they are when none is given."""
        return {name: default for name, (_, default) in self.signature().items()}

    def report(self, result: WithChecks, options: Options) -> Report:
        """Return the page of a result."""
        return cast("Report", self.call(self.page, result, **options))

    def call(self, function: str | Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        """Call a function, or one by its name, with the options that it has arguments for."""
        called = function
        if isinstance(function, str):
            module, _, name = function.partition(":")
            called = getattr(import_module(module), name)
        assert callable(called)
        known = options | {to: options[name] for to, name in self.names.items() if name in options}
        accepted = inspect.signature(called).parameters
        given = {k: v for k, v in known.items() if k in accepted and v is not None}
        return called(*arguments, **given)


def _own_option(name: str, entry: Mapping[str, Any]) -> tuple[object, object]:
    """Return annotation and default of an option that a case states itself."""
    known = {item.name for item in fields(Option)}
    option = Option(**{key: value for key, value in entry.items() if key in known})
    if "default" in entry:
        return annotated(name, type(entry["default"]), option), entry["default"]
    kind = _TYPES[entry["type"]]
    if entry.get("required"):
        return annotated(name, kind, option), ...
    return annotated(name, kind | None, option), None


def read_cases(
    table: Mapping[str, Mapping[str, Any]], steps: Mapping[str, Mapping[str, Callable[..., None]]]
) -> tuple[PublishedCase, ...]:
    """Return the cases of a table, each with its steps: ``prepare``, ``show``, ``finish``."""
    cases = []
    for name, entry in table.items():
        fields: dict[str, Any] = {**entry, **steps.get(name, {})}
        fields["columns"] = tuple(fields.get("columns", ()))
        cases.append(PublishedCase(name, **fields))
    return tuple(cases)


def add_command(app: typer.Typer, case: PublishedCase, example: str = "") -> None:
    """Add a case's command, its options made from its record; `example` ends its help."""

    def command(**options: Any) -> int:
        return _run(case, options)

    options = case.signature()
    annotations = {name: annotation for name, (annotation, _) in options.items()}
    kind = inspect.Parameter.KEYWORD_ONLY
    command.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [
            inspect.Parameter(name, kind, default=default, annotation=annotations[name])
            for name, (_, default) in options.items()
        ]
    )
    command.__annotations__ = annotations
    command.__doc__ = case.text
    command_class = (
        type("CaseCommand", (PlainCommand,), {"example": example}) if example else PlainCommand
    )
    app.command(case.name, cls=command_class)(command)


def _run(case: PublishedCase, options: Options) -> int:
    """Compute, write, print; 0 when every check passed, else 1."""
    out: Path | None = options.get("out")
    if out is not None:  # before the work, not after it
        check_file(out / "report.html", options)
        check_file(out / "rows.csv", options)
    with progress_bar(case.title) as advance:
        result, values = compute(case, options, advance)
    if case.finish is not None:
        case.call(case.finish, result, **options)
    if options["as_json"]:
        print_json(values)
    else:
        _print_checks(values)
        if case.columns:
            print_columns(values["rows"], case.columns, case.table)
        if case.show is not None:
            case.show(values, result)
    return 0 if values["status"] == "pass" else 1


def compute(case: PublishedCase, options: Options, progress: Any) -> tuple[Any, Values]:
    """Return a case's result and its JSON object; the report and the rows are written."""
    if case.prepare is not None:
        case.prepare(options)
    result = case.call(case.work, **options, progress=progress)
    values: Values = result.to_dict()
    if case.published is not None:
        values["checks"] = [_with_kind(check, case.published) for check in values["checks"]]
    out: Path | None = options.get("out")
    if out is not None and case.page:
        report = case.report(result, options)
        _write(out, report, values["rows"], options["force"])
    return result, values


def _with_kind(check: Values, record: Published) -> Values:
    """Return a check with its kind and what it is held against."""
    judged = record.judgement(check["name"])
    return {**check, "kind": judged.kind, "basis": judged.basis}


def check_file(path: Path | None, options: Options) -> None:
    """Refuse an output that cannot be written."""
    from elevon.files import check_output

    if path is not None:
        check_output(path, force=options["force"])


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
    cells = [[_cell(row[name]) for name in columns] for row in rows]
    print_table([name.replace("_", " ") for name in columns], cells, title=title)


def _cell(value: object) -> str:
    """Return a value as a cell of a table."""
    if isinstance(value, bool):
        return "yes" if value else "NO"
    if isinstance(value, list):
        return " to ".join(_cell(item) for item in value)
    if isinstance(value, float):
        return f"{value:.5g}"
    return "-" if value is None else str(value)


def _print_checks(values: Values) -> None:
    kinds: dict[str, list[bool]] = {}
    for check in values["checks"]:
        kinds.setdefault(check.get("kind", "checks"), []).append(check["passed"])
    counts = "; ".join(f"{kind} {sum(passed)} of {len(passed)}" for kind, passed in kinds.items())
    answer(f"{values['status']}: {counts}")
    rows = [
        [
            check["name"],
            check.get("kind", ""),
            f"{check['value']:.5g}",
            f"{'>=' if check['at_least'] else '<='} {check['limit']:.5g} {check['unit']}",
            "pass" if check["passed"] else "FAIL",
        ]
        for check in values["checks"]
    ]
    print_table(["check", "kind", "value", "limit", ""], rows)
