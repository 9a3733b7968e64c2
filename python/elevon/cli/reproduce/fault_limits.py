"""`elevon reproduce fault-limits`: how small a fault each standard test of each actuator shows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.output import Advance
from elevon.cli.reproduce.case import Options, PublishedCase, Values, print_columns

if TYPE_CHECKING:
    from elevon.report import Report

__all__ = ["CASES"]

_ACTUATORS = Annotated[
    list[str] | None,
    typer.Option("--actuator", help="Set; repeatable. Default: one of each wiring."),
]
_DAYS = Annotated[int, typer.Option("--days", min=1, help="Healthy logs of each test.")]
_INJECTED = Annotated[
    int, typer.Option("--injected", min=0, help="Faults of each test that a log checks.")
]
_FIDELITY = Annotated[str, typer.Option("--fidelity", help="Of the logs: high or low.")]
_TABLE = Annotated[
    Path | None, typer.Option("--table", help="Markdown file for the limits of all tests.")
]
_COLUMNS = ("actuator", "test", "kind", "place", "limit", "unit", "injected", "alarm", "named")


def _work(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.fault_limits import LimitsPlan, reproduce_fault_limits

    plan = LimitsPlan(options["days"], options["injected"], options["fidelity"], options["seed"])
    return reproduce_fault_limits(
        plan, actuators=options["actuator"] or (), folder=options["out"], progress=progress
    )


def _prepare(options: Options) -> None:
    """Refuse a table that cannot be written before the work, not after it."""
    from elevon.files import check_output

    if options["table"] is not None:
        check_output(options["table"], force=options["force"])


def _finish(result: Any, options: Options) -> None:
    from elevon.cli.output import say
    from elevon.files import write_text
    from elevon.reproduce.fault_limits_table import limits_table

    if options["table"] is not None:
        text = limits_table(result, _command(options))
        write_text(options["table"], text, force=options["force"])
        say(f"table: {options['table']}")


def _command(options: Options) -> str:
    """What makes the same table again."""
    names = [f"--actuator {name}" for name in options["actuator"] or ()]
    options_text = f"--days {options['days']} --injected {options['injected']}"
    words = [*names, options_text, f"--fidelity {options['fidelity']} --seed {options['seed']}"]
    return f"elevon reproduce fault-limits {' '.join(words)}"


def _page(result: Any, options: Options) -> Report:
    from elevon.report import Report, ReportTable
    from elevon.reproduce.provenance import provenance

    report = Report(
        "Detection limits",
        "Least severity of each fault that each standard test shows, one healthy log as baseline.",
        date=options["date"],
    )
    report.section("Checks").checks(result.checks)
    rows = [[getattr(row, name) for name in (*_COLUMNS, "reason")] for row in result.limits]
    text = [["-" if cell is None else str(cell) for cell in row] for row in rows]
    report.section("Limits").table(ReportTable((*_COLUMNS, "reason"), text))
    report.provenance(provenance(_command(options), Seed=options["seed"]))
    return report


def _show(values: Values, _result: Any) -> None:
    print_columns(values["rows"], _COLUMNS)


CASES = (
    PublishedCase(
        "fault-limits",
        "Detection limit of each fault in each standard test of each actuator.",
        "running and diagnosing the standard tests",
        _work,
        _show,
        _page,
        {
            "actuator": (_ACTUATORS, None),
            "days": (_DAYS, 10),
            "injected": (_INJECTED, 12),
            "fidelity": (_FIDELITY, "low"),
            "table": (_TABLE, None),
        },
        prepare=_prepare,
        finish=_finish,
    ),
)
