"""`elevon reproduce next-test`: tests chosen by information against a fixed order."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from elevon.cli.output import Advance, say
from elevon.cli.reproduce.case import Options, PublishedCase, Values, print_columns

__all__ = ["CASES"]

_UNITS = Annotated[int, typer.Option("--units", min=2, help="Units of every pair.")]


def _work(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.next_test import reproduce_next_test

    return reproduce_next_test(seed=options["seed"], units=options["units"], progress=progress)


def _show(values: Values, _result: Any) -> None:
    columns = ("pair", "strategy", "units", "tests", "tests_interval", "certain", "right")
    print_columns(values["rows"], columns, "tests until one condition has 95 %")
    for name, (mean, low, high) in values["saved"].items():
        against = "the mean of all fixed orders" if name == "orders" else f"{name} order"
        say(f"saved against {against}: {mean:.2f} tests ({low:.2f} to {high:.2f})")
    best = values["best_fixed_order"]
    say(f"the fixed order that proves best here: {best['tests']:.2f} tests: {best['order']}")


CASES = (
    PublishedCase(
        "next-test",
        "Choose tests by expected information on ambiguous pairs; count them and a fixed order's.",
        "testing units",
        _work,
        _show,
        options={"units": (_UNITS, 24)},
    ),
)
