"""`elevon reproduce diagnosis-limits`, `monitor-delay` and `inspection-error`.

How small a fault is seen, how soon, and how far the severity errs.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.output import Advance, print_table, say
from elevon.cli.reproduce.case import Options, PublishedCase, Values, cell, print_columns

if TYPE_CHECKING:
    from elevon.report import Report

__all__ = ["CASES"]

_UNITS = Annotated[int, typer.Option("--units", min=1, help="Benches, 39 streams each.")]
_INSPECTED = Annotated[int, typer.Option("--units", min=2, help="Benches, 40 inspections each.")]
_FOLDER = Annotated[
    Path | None,
    typer.Option("--runs", metavar="DIR", help="Keeps what is finished, and goes on from there."),
]
_RUNS = Annotated[int, typer.Option("--runs", min=1, help="Units of the bench, 95 logs each.")]


def _work(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.diagnosis_limits.result import reproduce_diagnosis_limits

    return reproduce_diagnosis_limits(
        seed=options["seed"], units=options["runs"], folder=options["out"], progress=progress
    )


def _watch(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.monitor_delay import reproduce_monitor_delay

    return reproduce_monitor_delay(seed=options["seed"], units=options["units"], progress=progress)


def _inspect(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.inspection_error.result import reproduce_inspection_error

    return reproduce_inspection_error(
        seed=options["seed"], units=options["units"], folder=options["runs"], progress=progress
    )


def _show_inspect(values: Values, _result: Any) -> None:
    columns = ("fault", "severity", "inspections", "seen", "interval", "error_median", "others")
    print_columns(values["detection"], columns, "inspections that see a severity")
    deviations = ("fault", "relative", "absolute", "common_relative", "common_absolute",
                  "stated_relative", "stated_absolute", "stated_over_scatter",
                  "coverage")  # fmt: skip
    print_columns(values["rows"], deviations, "deviations, and what intervals state")
    for row in values["rows"]:
        text = ", ".join(f"{error:+.3g} at {severity:.3g}" for severity, error in row["offset"])
        say(f"{row['fault']}: mean error {text} {row['unit']}")


def _show_watch(values: Values, _result: Any) -> None:
    columns = ("fault", "severity", "streams", "alarms", "before_onset", "delay_median",
               "delay_largest", "named")  # fmt: skip
    print_columns(values["rows"], columns, "streams in which a fault begins")
    for row in values["false_alarms"]:
        low, high = row["interval"]
        say(
            f"healthy, {values['healthy_seconds']:g} s, one false alarm set in "
            f"{row['set_seconds']:g} s: {row['alarms']}, {row['per_hour']:.2g} in an hour "
            f"({low:.2g} to {high:.2g})"
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
    PublishedCase(
        "diagnosis-limits",
        "Diagnose logs of benches that are unlike the model: false alarms, isolation, severity.",
        "making and diagnosing logs",
        _work,
        _show,
        _page,
        {"runs": (_RUNS, 8)},
    ),
    PublishedCase(
        "monitor-delay",
        "Watch streams in which a fault begins: delay against severity, and false alarms.",
        "making and watching streams",
        _watch,
        _show_watch,
        options={"units": (_UNITS, 3)},
    ),
    PublishedCase(
        "inspection-error",
        "Inspect units by three logs each: the errors of backlash, friction and short.",
        "making and diagnosing inspections",
        _inspect,
        _show_inspect,
        options={"units": (_INSPECTED, 6), "runs": (_FOLDER, None)},
    ),
)
