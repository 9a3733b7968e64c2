"""`elevon compare`: the high and the low fidelity model on one scenario."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.common import (
    ActuatorArgument,
    FaultOption,
    ForceOption,
    JsonOption,
    ScenarioOption,
    SeedOption,
    SetOption,
    StrictOption,
    check_outputs,
    read_actuator,
)
from elevon.cli.output import print_json, print_table, progress_bar, say

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.scenario import Scenario

app = typer.Typer(rich_markup_mode=None)


@app.command()
def compare(
    actuator: ActuatorArgument,
    *,
    scenario: ScenarioOption = None,
    settings: SetOption = None,
    fault: FaultOption = None,
    after: Annotated[float, typer.Option(min=0.0, help="Left out before [s].")] = 10.0,
    cutoff: Annotated[float, typer.Option(help="Cut-off of the one filter [Hz].")] = 10.0,
    faults_table: Annotated[
        bool, typer.Option("--faults-table", help="What each fault changes in either model.")
    ] = False,
    seed: SeedOption = 0,
    strict: StrictOption = False,  # noqa: ARG001 - its callback does the work
    json: JsonOption = False,
    out: Annotated[Path | None, typer.Option(help="Folder for report.html.")] = None,
    force: ForceOption = False,
    date: Annotated[str | None, typer.Option(help="Date printed in the report.")] = None,
) -> int:
    """Run one scenario at high and at low fidelity; default: 45 deg, 0.05 Hz, 1 N m of brake."""
    from elevon.compare import compare as run
    from elevon.compare import default_scenario
    from elevon.scenario import Scenario

    page = None if out is None else out / "report.html"
    check_outputs([page], force=force)
    model = read_actuator(actuator, settings)
    asked = Scenario.load(scenario) if scenario is not None else default_scenario()
    asked = asked.with_faults(fault or [])
    if faults_table:
        return _faults_table(model, asked, after, seed, json)
    with progress_bar("comparing") as advance:
        found = run(model, asked, seed=seed, start=after, cutoff=cutoff, progress=advance)
    values = found.to_dict()
    if page is not None:
        from elevon.reproduce.compare_page import compare_report

        say(f"report: {compare_report(found, actuator, date=date).save(page, force=force)}")
    if json:
        print_json(values)
    else:
        _print(values)
    return 0


def _print(values: dict[str, Any]) -> None:
    rows = [
        ["user position", f"{100 * values['position_nrmse']:.3f} % of the amplitude"],
        ["motor speed", f"{100 * values['speed_nrmse']:.3f} % of its RMS"],
        ["q current", f"{100 * values['q_current_nrmse']:.3f} % of its RMS"],
        ["low model", f"{values['low_realtime_factor']:.0f} times real time"],
        ["speed-up", f"{values['speed_up']:.0f} times the high model"],
    ]
    print_table(["RMS of low less high", ""], rows)
    say(f"after {values['start_s']:g} s; {values['filter']}")


def _faults_table(model: Actuator, asked: Scenario, after: float, seed: int, as_json: bool) -> int:
    from elevon.reproduce.fault_sensitivity import fault_sensitivity

    with progress_bar("healthy and faulty runs") as advance:
        rows = fault_sensitivity(model, asked, start=after, seed=seed, progress=advance)
    values = {"actuator": model.name, "rows": [row.to_dict() for row in rows]}
    if as_json:
        print_json(values)
        return 0
    shown = [
        [row.fault, row.feature, f"{row.high:+.4g}", f"{row.low:+.4g}", f"{row.floor:.2g}",
         f"{row.ratio:+.2f}", row.verdict]
        for row in rows
    ]  # fmt: skip
    print_table(["fault", "seen in", "high", "low", "floor", "low/high", ""], shown)
    return 0
