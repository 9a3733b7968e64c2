"""`elevon reproduce signatures`: the gallery of what each fault looks like."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.output import Advance
from elevon.cli.reproduce.case import Options, PublishedCase, Values, print_columns

if TYPE_CHECKING:
    from elevon.report import Report

__all__ = ["CASES"]

_ACTUATORS = Annotated[
    list[str] | None,
    typer.Option("--actuator", metavar="ACTUATOR", help="Only this one; repeatable."),
]


def _work(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.signatures import ACTUATORS, reproduce_signatures

    chosen = tuple(options["actuators"] or ACTUATORS)
    return reproduce_signatures(chosen, seed=options["seed"], progress=progress)


def _show(values: Values, _result: Any) -> None:
    columns = ("actuator", "kind", "place", "severity", "unit", "status", "signal")
    print_columns(values["rows"], columns)


def _page(result: Any, options: Options) -> Report:
    from elevon.reproduce.signatures_page import signatures_page

    return signatures_page(result, options["date"])


CASES = (
    PublishedCase(
        "signatures",
        "Show what each fault looks like: healthy beside faulty, in time and spectrum.",
        "running every fault",
        _work,
        _show,
        _page,
        options={"actuators": (_ACTUATORS, None)},
    ),
)
