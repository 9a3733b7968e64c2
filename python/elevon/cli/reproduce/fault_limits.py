"""`elevon reproduce fault-limits`: how small a fault each standard test of each actuator shows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.output import Advance
from elevon.cli.reproduce.case import Case, Options, Values, print_columns

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
_COLUMNS = ("actuator", "test", "kind", "place", "limit", "unit", "injected", "alarm", "named")


def _work(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.fault_limits import Plan, reproduce_fault_limits

    plan = Plan(options["days"], options["injected"], options["fidelity"], options["seed"])
    return reproduce_fault_limits(plan, actuators=options["actuator"] or (), progress=progress)


def _page(result: Any, options: Options) -> Report:
    from elevon.report import Report, Table
    from elevon.reproduce.provenance import provenance

    report = Report(
        "Detection limits",
        "Least severity of each fault that each standard test shows, one healthy log as baseline.",
        date=options["date"],
    )
    report.section("Checks").checks(result.checks)
    rows = [[getattr(row, name) for name in (*_COLUMNS, "reason")] for row in result.limits]
    text = [["-" if cell is None else str(cell) for cell in row] for row in rows]
    report.section("Limits").table(Table((*_COLUMNS, "reason"), text))
    seed = options["seed"]
    report.provenance(provenance(f"elevon reproduce fault-limits --seed {seed}", Seed=seed))
    return report


def _show(values: Values, _result: Any) -> None:
    print_columns(values["rows"], _COLUMNS)


CASES = (
    Case(
        "fault-limits",
        "Detection limit of each fault in each standard test of each actuator.",
        "running and diagnosing the standard tests",
        _work,
        _show,
        _page,
        {
            "actuator": (_ACTUATORS, None),
            "days": (_DAYS, 8),
            "injected": (_INJECTED, 12),
            "fidelity": (_FIDELITY, "low"),
        },
    ),
)
