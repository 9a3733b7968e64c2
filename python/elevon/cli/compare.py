"""`elevon compare`: the high and the low fidelity model on one scenario."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from elevon.cli import common
from elevon.cli.output import answer, print_table, progress_bar, say
from elevon.cli.shell import Answer, command
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.scenario import Scenario

app = typer.Typer(rich_markup_mode=None)


@command(app, "strict")
def compare(
    actuator: str,
    *,
    scenario: Path | None = None,
    settings: list[str] | None = None,
    fault: list[str] | None = None,
    after: float | None = None,
    cutoff: float = 10.0,
    loads: bool = False,
    load: str | None = None,
    faults_table: bool = False,
    seed: int = 0,
    out: Path | None = None,
    force: bool = False,
    date: str | None = None,
) -> Answer:
    """Run one scenario at high and at low fidelity; default: the one that the set says."""
    from elevon.cli.fault_options import read_faults
    from elevon.compare import default_scenario, default_start
    from elevon.doors import compare as run
    from elevon.scenario import Scenario

    if load is not None and not loads:
        raise InputError("--load needs --loads")
    page = None if out is None else out / "report.html"
    common.check_outputs([page], force=force)
    model = common.read_actuator(actuator, settings)
    run_scenario = default_scenario(model) if scenario is None else Scenario.load(scenario)
    run_scenario = run_scenario.with_faults(read_faults(fault, model.wiring))
    start = default_start(model, run_scenario, default=scenario is None) if after is None else after
    if faults_table:
        return _faults_table(model, run_scenario, start, seed)
    with progress_bar("comparing") as advance:
        result = run(
            model, run_scenario, loads=loads, load=load, seed=seed, start=start, cutoff=cutoff,
            progress=advance,
        )  # fmt: skip
    values = result.to_dict(stored=False)
    if page is not None:
        from elevon.compare import compare_report

        say(f"report: {compare_report(result, actuator, date=date).save(page, force=force)}")
    return Answer(values, lambda: _print(result.headline, values))


def _print(headline: str, values: dict[str, Any]) -> None:
    answer(headline)
    runs = values["loads"] or {"": values}
    lines = (
        ("output position", "position_nrmse", ".3%", "of the amplitude"),
        ("motor speed", "speed_nrmse", ".3%", "of its RMS"),
        ("torque current", "q_current_nrmse", ".3%", "of its RMS"),
        ("reduced-order model", "low_realtime_factor", ".0f", "times real time"),
        ("speed-up", "speed_up", ".0f", "times the switching model"),
    )
    rows = [
        [name, *(f"{run[key]:{form}} {what}".replace("%", " %") for run in runs.values())]
        for name, key, form, what in lines
    ]
    print_table(["RMS of low less high", *runs], rows)
    answer(f"after {values['start_s']:g} s; {values['filter']}")


def _faults_table(model: Actuator, run_scenario: Scenario, after: float, seed: int) -> Answer:
    from elevon.fault_sensitivity import fault_sensitivity

    with progress_bar("healthy and faulty runs") as advance:
        rows = fault_sensitivity(model, run_scenario, start=after, seed=seed, progress=advance)
    values = {"actuator": model.name, "rows": [row.to_dict() for row in rows]}

    def show() -> None:
        both = sum(row.verdict == "seen by both" for row in rows)
        answer(f"{model.name}: {both} of {len(rows)} faults are seen by both models")
        table = [
            [row.fault, row.feature, f"{row.high:+.4g}", f"{row.low:+.4g}", f"{row.floor:.2g}",
             f"{row.ratio:+.2f}", row.verdict]
            for row in rows
        ]  # fmt: skip
        print_table(["fault", "seen in", "high", "low", "floor", "low/high", ""], table)

    return Answer(values, show)
