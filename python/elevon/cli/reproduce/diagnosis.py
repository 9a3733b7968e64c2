"""`elevon reproduce diagnosis-limits`: how small a fault the diagnosis by the model sees."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.output import Advance, print_table
from elevon.cli.reproduce.case import Case, Options, Values, cell

if TYPE_CHECKING:
    from elevon.report import Report

__all__ = ["CASES"]

_RUNS = Annotated[int, typer.Option("--runs", min=1, help="Units of the bench, 95 logs each.")]


def _work(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.diagnosis_limits.result import reproduce_diagnosis_limits

    return reproduce_diagnosis_limits(
        seed=options["seed"], units=options["runs"], folder=options["out"], progress=progress
    )


def _page(result: Any, options: Options) -> Report:
    from elevon.reproduce.diagnosis_limits.page import limits_report

    return limits_report(result, date=options["date"])


def _show(values: Values, _result: Any) -> None:
    columns = ("group", "test", "fault", "severity", "logs", "detected", "isolated", "interval",
               "error_median", "coverage")  # fmt: skip
    rows = [[cell(row[name]) for name in columns] for row in values["rows"]]
    print_table([name.replace("_", " ") for name in columns], rows)


CASES = (
    Case(
        "diagnosis-limits",
        "Diagnose logs of benches that are unlike the model: false alarms, isolation, severity.",
        "making and diagnosing logs",
        _work,
        _show,
        _page,
        {"runs": (_RUNS, 8)},
    ),
)
