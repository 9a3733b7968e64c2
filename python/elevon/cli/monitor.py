"""`elevon monitor`: watch a unit's stream, and say soon when a fault begins."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from elevon.cli.calibrate import CommandOption, LoadcellOption, LogsArgument, MapOption, read
from elevon.cli.common import (
    ActuatorOption,
    DetailsOption,
    JsonOption,
    SetOption,
    StrictOption,
    read_actuator,
)
from elevon.cli.output import answer, listed, print_json
from elevon.number_text import severity_texts
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from elevon.diagnose.monitor import Monitoring

app = typer.Typer(rich_markup_mode=None)


@app.command()
def monitor(
    logs: LogsArgument,
    *,
    actuator: ActuatorOption,
    baseline: Annotated[
        list[Path],
        typer.Option("--baseline", metavar="LOG", help="Healthy log of that motion; repeatable."),
    ],
    window: Annotated[
        str | None,
        typer.Option(help="Width of a window, such as '5 s'; default: period of the noted sine."),
    ] = None,
    false_alarm_time: Annotated[
        str, typer.Option("--false-alarm-time", help="Mean time between false alarms.")
    ] = "1 h",
    fault: Annotated[
        list[str] | None,
        typer.Option("--fault", metavar="KIND@PLACE", help="Candidate; repeatable. Default: all."),
    ] = None,
    loadcell: LoadcellOption = None,
    command: CommandOption = None,
    column_map: MapOption = None,
    settings: SetOption = None,
    strict: StrictOption = False,  # noqa: ARG001 - its callback does the work
    details: DetailsOption = False,  # noqa: ARG001 - its callback does the work
    json: JsonOption = False,
) -> None:
    """Watch logs window by window, in the order given, each a day of the unit; alarm at a fault."""
    from elevon.diagnose.door import monitor as run

    result = run(
        read(logs, column_map, loadcell, command),
        read_actuator(actuator, settings),
        read(baseline, column_map),
        window=None if window is None else parse_quantity(window, "s", "--window"),
        false_alarm_time=parse_quantity(false_alarm_time, "s", "--false-alarm-time"),
        faults=fault,
    )
    if json:
        print_json(result.to_dict(stored=False))
    else:
        _print(result)


def _print(result: Monitoring) -> None:
    answer(result.headline)
    for cause in () if result.alarm is None else result.alarm.causes:
        middle, low, high = severity_texts(cause.severity, cause.interval, cause.unit)
        others = ", ".join(name.key for name in cause.ambiguous_with)
        answer(
            f"{cause.kind}@{cause.place}: {middle} ({low} to {high}), probability "
            f"{cause.probability:.2f}" + (f"; ambiguous with {others}" if others else "")
        )
    reasons = [step.skipped for step in result.steps if step.skipped]
    listed([f"{reasons.count(why)} windows left out: {why}" for why in sorted(set(reasons))])
    listed(result.findings)
