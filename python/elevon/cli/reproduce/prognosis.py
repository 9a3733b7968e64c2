"""`elevon reproduce prognosis`: run-to-failure histories with mismatch, and their predictions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.output import Advance, print_table, say
from elevon.cli.reproduce.case import Options, PublishedCase, Values, cell

if TYPE_CHECKING:
    from elevon.report import Report

__all__ = ["CASES"]

_HISTORIES = Annotated[int, typer.Option("--histories", min=3, help="Lives, over three faults.")]
_PROCESSES = Annotated[
    int | None, typer.Option("--processes", min=1, help="Side by side; default: all processors.")
]
_MEASURED = Annotated[
    bool, typer.Option("--measured", help="Inspections measure the requirements, too.")
]


def _work(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.prognosis import reproduce_prognosis

    return reproduce_prognosis(
        histories=options["histories"],
        seed=options["seed"],
        processes=options["processes"],
        folder=options["out"],
        measured=options["measured"],
        progress=progress,
    )


def _page(result: Any, options: Options) -> Report:
    from elevon.reproduce.prognosis.page import prognosis_report

    return prognosis_report(result, seed=options["seed"], date=options["date"])


def _show(values: Values, result: Any) -> None:
    columns = ("law", "histories", "accuracy", "coverage", "horizon", "unscented_accuracy",
               "unaided_accuracy")  # fmt: skip
    rows = [[cell(row[name]) for name in columns] for row in values["summary"]]
    print_table([name.replace("_", " ") for name in columns], rows)
    for text in result.left_out:
        say(text)
    say(f"{result.seconds:.0f} s; one update with its prediction {values['longest_s']:.2g} s")


CASES = (
    PublishedCase(
        "prognosis",
        "Predict the ends of units on the switching model, under laws unlike the filter's.",
        "run-to-failure histories",
        _work,
        _show,
        _page,
        {
            "histories": (_HISTORIES, 60),
            "processes": (_PROCESSES, None),
            "measured": (_MEASURED, False),
        },
    ),
)
