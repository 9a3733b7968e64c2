"""`elevon fleet`: remaining life of several units, and when to do which together."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from elevon.cli.common import (
    ActuatorOption,
    ForceOption,
    JsonOption,
    SeedOption,
    SetOption,
    StrictOption,
    check_outputs,
    read_actuator,
)
from elevon.cli.output import print_json, print_table, progress_bar, say
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.prognose.answer import Prognosis
    from elevon.prognose.fleet import FleetPlan
    from elevon.report import Report

app = typer.Typer(rich_markup_mode=None)


@app.command()
def fleet(
    histories: Annotated[
        list[Path], typer.Argument(metavar="HISTORY...", help="One folder a unit, of diagnoses.")
    ],
    *,
    actuator: ActuatorOption,
    mission: Annotated[Path, typer.Option("--mission", metavar="FILE", help="Mission (TOML).")],
    early: Annotated[float, typer.Option(help="Cost of one unit of use thrown away.")] = 1.0,
    late: Annotated[float, typer.Option(help="Cost of a failure in service.")] = 10_000.0,
    visit: Annotated[float, typer.Option(help="Cost of a visit, for all units at it.")] = 500.0,
    settings: SetOption = None,
    report: Annotated[Path | None, typer.Option("--report", help="HTML page to write.")] = None,
    seed: SeedOption = 0,
    strict: StrictOption = False,  # noqa: ARG001 - its callback does the work
    json: JsonOption = False,
    force: ForceOption = False,
) -> int:
    """Predict several units of one type and group their maintenance."""
    from elevon.prognose.fleet import Costs, plan_fleet
    from elevon.prognose.history import diagnosed, read_history
    from elevon.prognose.mission import Mission
    from elevon.prognose.predict import predict
    from elevon.prognose.respond import respond

    check_outputs([report], force=force)
    costs = Costs(early, late, visit)
    model, flown = read_actuator(actuator, settings), Mission.load(mission)
    read = [read_history(folder, unit=flown.unit) for folder in histories]
    names = [item.serial or path.name for item, path in zip(read, histories, strict=True)]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"two histories are of the unit {twice}")
    with progress_bar("model runs") as advance:
        tables = respond(model, flown, progress=advance)
    units: dict[str, Prognosis] = {}
    for name, item in zip(names, read, strict=True):
        seen = diagnosed(item, model).inspections(tables.laws, tables.units_by_name)
        units[name] = predict(seen, model, flown, response=tables, seed=seed, serial=name)
    plan = plan_fleet(units, costs)
    if report is not None:
        say(f"report: {_page(plan, costs.visit).save(report, force=force)}")
    if json:
        print_json(plan.to_dict())
    else:
        _print(plan)
    return 0


_COLUMNS = ("unit", "remain", "90 %", "alone at", "visit at", "failed before")


def _rows(plan: FleetPlan) -> list[tuple[str, ...]]:
    return [
        (
            row["unit"],
            f"{row['rul']:.0f}",
            f"{row['interval'][0]:.0f} to {row['interval'][1]:.0f}",
            f"{row['alone']:.0f}",
            f"{row['visit']:.0f}",
            f"{row['p_failed_before']:.3f}",
        )
        for row in plan.to_dict()["rows"]
    ]


def _print(plan: FleetPlan) -> None:
    print_table(_COLUMNS, _rows(plan), title=f"{plan.unit} from now")
    say(_sentence(plan))
    for text in plan.findings:
        say(text)


def _sentence(plan: FleetPlan) -> str:
    return (
        f"{len(plan.visits)} visit(s) for {len(plan.units)} units: expected cost {plan.cost:.4g}, "
        f"{plan.cost_alone:.4g} with each unit alone."
    )


def _page(plan: FleetPlan, visit: float) -> Report:
    from elevon.prognose.fleet import fleet_figure
    from elevon.report import Report, ReportTable

    report = Report("Maintenance of a fleet", _sentence(plan))
    section = report.section(f"Remaining {plan.unit}")
    section.figure(
        fleet_figure(plan), "Remaining life: median and 90 %; blue: the visit at which it is done."
    )
    section.table(ReportTable(_COLUMNS, _rows(plan), f"A visit costs {visit:g}."))
    if plan.findings:
        section.points(plan.findings)
    return report
