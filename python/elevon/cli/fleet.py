"""`elevon fleet`: remaining life of several units, and when to do which together."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from elevon.cli import common
from elevon.cli.output import answer, listed, print_table, progress_bar
from elevon.cli.shell import Answer, command

if TYPE_CHECKING:
    from elevon.prognose.fleet import FleetPlan
    from elevon.report import Report

app = typer.Typer(rich_markup_mode=None)


@command(app, "strict", "details", "report", "force")
def fleet(
    histories: list[Path],
    *,
    actuator: str,
    mission: Path,
    early: float = 1.0,
    late: float = 10_000.0,
    visit: float = 500.0,
    settings: list[str] | None = None,
    seed: int = 0,
) -> Answer:
    """Predict several units of one type and group their maintenance."""
    from elevon.prognose.door import fleet as run

    model = common.read_actuator(actuator, settings)
    with progress_bar("model runs") as advance:
        plan = run(
            histories, model, mission, early=early, late=late, visit=visit, seed=seed,
            progress=advance,
        )  # fmt: skip
    return Answer(plan, lambda: _print(plan), page=lambda: _page(plan, visit))


_COLUMNS = ("unit", "remain", "90 %", "alone at", "visit at", "failed before")


def _rows(plan: FleetPlan) -> list[tuple[str, ...]]:
    return [
        (
            str(row["unit"]),
            _use(row["rul"]),
            " to ".join(_use(value) for value in row["interval"]),
            _use(row["alone"]),
            _use(row["visit"]),
            "-" if row["p_failed_before"] is None else f"{row['p_failed_before']:.3f}",
        )
        for row in plan.table
    ]


def _use(value: float | None) -> str:
    return "no end in sight" if value is None else f"{value:.0f}"


def _print(plan: FleetPlan) -> None:
    answer(plan.headline)
    print_table(_COLUMNS, _rows(plan), title=f"{plan.unit} from now")
    listed(plan.findings)


def _page(plan: FleetPlan, visit: float) -> Report:
    from elevon.prognose.fleet import fleet_figure
    from elevon.report import Report, ReportTable

    report = Report("Maintenance of a fleet", plan.headline)
    section = report.section(f"Remaining {plan.unit}")
    section.figure(
        fleet_figure(plan), "Remaining life: median and 90 %; blue: the visit at which it is done."
    )
    section.table(ReportTable(_COLUMNS, _rows(plan), f"A visit costs {visit:g}."))
    if plan.findings:
        section.points(plan.findings)
    return report
