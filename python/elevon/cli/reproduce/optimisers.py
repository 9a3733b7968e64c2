"""`elevon reproduce diagnosis-optimisers`: population searches against our diagnosis."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from elevon.cli.output import Advance
from elevon.cli.reproduce.case import Options, PublishedCase, Values, print_columns

__all__ = ["CASES"]

_SEEDS = Annotated[int, typer.Option("--seeds", min=2, help="Logs of every fault.")]
_BUDGET = Annotated[int, typer.Option("--budget", min=40, help="Model runs of a search.")]
_PROCESSES = Annotated[
    int | None, typer.Option("--processes", min=1, help="Side by side; default: all processors.")
]
_RUNS = Annotated[
    Path | None,
    typer.Option("--runs", metavar="DIR", help="Keeps finished logs, and goes on from there."),
]


def _work(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.diagnosis_optimisers import reproduce_optimisers

    return reproduce_optimisers(
        seed=options["seed"],
        seeds=options["seeds"],
        budget=options["budget"],
        processes=options["processes"],
        folder=options["runs"],
        progress=progress,
    )


def _show(values: Values, _result: Any) -> None:
    columns = ("method", "fault", "logs", "error_percent_of_range", "error_interval",
               "evaluations", "seconds", "reached_our_error")  # fmt: skip
    print_columns(values["rows"], columns, "severity error, model runs, processor time")


CASES = (
    PublishedCase(
        "diagnosis-optimisers",
        "Diagnose by genetic algorithm, differential evolution, swarm, grey wolves, and by ours.",
        "searching",
        _work,
        _show,
        options={
            "seeds": (_SEEDS, 4),
            "budget": (_BUDGET, 2000),
            "processes": (_PROCESSES, None),
            "runs": (_RUNS, None),
        },
    ),
)
