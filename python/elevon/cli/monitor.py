"""`elevon monitor`: watch a unit's stream, and say soon when a fault begins."""

from __future__ import annotations

import time as clock
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from elevon.cli.calibrate import CommandOption, LoadcellOption, LogsArgument, MapOption
from elevon.cli.common import (
    ActuatorOption,
    JsonOption,
    SetOption,
    StrictOption,
    read_actuator,
    without_companions,
)
from elevon.cli.diagnose import read_with
from elevon.cli.output import print_json, say
from elevon.errors import InputError
from elevon.number_text import severity_texts
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from elevon.diagnose.bymodel import TestLog
    from elevon.diagnose.monitor import Alarm, Monitor

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
    json: JsonOption = False,
) -> None:
    """Watch logs window by window, in the order given, each a day of the unit; alarm at a fault."""
    from elevon.diagnose.bymodel import read_test_logs
    from elevon.diagnose.monitor import Monitor

    begin = clock.perf_counter()
    width = None if window is None else parse_quantity(window, "s", "--window")
    between = parse_quantity(false_alarm_time, "s", "--false-alarm-time")
    model = read_actuator(actuator, settings)
    stream = read_with(logs, loadcell, command, column_map)
    healthy = read_test_logs(without_companions(baseline), column_map=column_map)
    watch = Monitor(
        model, healthy, window=width, false_alarm_time=between, faults=fault, days=len(stream),
        longest=max(item.log.duration for item in stream),
    )  # fmt: skip
    _follow(watch, stream)
    if json:
        print_json({**watch.to_dict(), "seconds": clock.perf_counter() - begin})
        return
    _print(watch)


def _follow(watch: Monitor, stream: list[TestLog]) -> None:
    for item in stream:
        watch.feed_log(item)
    if all(step.skipped for step in watch.steps):
        raise InputError(
            f"no window of {watch.width:g} s could be used: "
            + (watch.steps[0].skipped if watch.steps else "the logs are shorter than one")
        )


def _print(watch: Monitor) -> None:
    used = [step for step in watch.steps if not step.skipped]
    if watch.alarm is None:
        top = max(used, key=lambda step: step.statistic)
        say(
            f"No alarm in {len(used)} windows of {watch.width:g} s: the statistic came to "
            f"{top.statistic:.2g} of its threshold."
        )
    else:
        _print_alarm(watch.alarm)
    reasons = [step.skipped for step in watch.steps if step.skipped]
    for reason in sorted(set(reasons)):
        say(f"{reasons.count(reason)} windows left out: {reason}")
    for text in watch.findings:
        say(text)


def _print_alarm(alarm: Alarm) -> None:
    say(
        f"Alarm at {alarm.time:g} s of {alarm.log}: statistic {alarm.statistic:.3g} of its "
        f"threshold; most likely since {alarm.since:g} s of {alarm.since_log} "
        f"({alarm.delay:g} s watched since)."
    )
    for cause in alarm.causes:
        middle, low, high = severity_texts(cause.severity, cause.interval, cause.unit)
        others = ", ".join(f"{kind}@{place}" for kind, place in cause.ambiguous_with)
        say(
            f"{cause.kind}@{cause.place}: {middle} ({low} to {high}), probability "
            f"{cause.probability:.2f}" + (f"; ambiguous with {others}" if others else "")
        )
