"""`elevon reproduce cranfield`: the real ball-screw actuator with seeded faults."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.output import Advance, print_table, say
from elevon.cli.reproduce.case import Options, PublishedCase, Values

if TYPE_CHECKING:
    from elevon.report import Report

__all__ = ["CASES"]

_DATA = Annotated[
    Path,
    typer.Option("--data", help="Folder with one CSV or CSV.gz a condition; not in this package."),
]


def _work(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.cranfield import reproduce_cranfield

    return reproduce_cranfield(options["data"], seed=options["seed"], progress=progress)


def _page(result: Any, options: Options) -> Report:
    from elevon.reproduce.cranfield.page import cranfield_report

    return cranfield_report(result, seed=options["seed"], date=options["date"])


def _show(values: Values, result: Any) -> None:
    for line in (*values["skipped"], *(f"{name}: not possible here" for name in values["missing"])):
        say(line)
    figures = [f for f in result.figures if f.load in {"mean", "worst"}]
    rows = [
        [f.figure, f.protocol, f.load, f"{f.value:.3f}", f"{f.low:.3f} to {f.high:.3f}"]
        for f in figures
    ]
    print_table(["figure", "protocol", "loads", "score", "95 % interval"], rows)
    rows = [
        [d["condition"], f"{d['rate']:.3f}", " to ".join(f"{x:.3f}" for x in d["interval"]),
         "-" if d["rate_between_sessions"] is None else f"{d['rate_between_sessions']:.3f}"]
        for d in values["detection"]
    ]  # fmt: skip
    print_table(["called faulty", "rate", "95 % interval", "sessions allowed for"], rows)


CASES = (
    PublishedCase(
        "cranfield",
        "Diagnose the Cranfield linear actuator from its recordings, loads and runs held out.",
        "reading and classifying",
        _work,
        _show,
        _page,
        {"data": (_DATA, ...)},
    ),
)
