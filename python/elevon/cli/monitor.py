"""`elevon monitor`: watch a unit's stream, and say soon when a fault begins.

Of `-` lines of samples come in, and a line a window goes out.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from elevon.cli import common, interrupt
from elevon.cli.output import answer, listed, print_json, say
from elevon.cli.shell import add_plain
from elevon.errors import InputError
from elevon.files import check_output
from elevon.number_text import severity_texts
from elevon.option import Option
from elevon.plain import fields_of, plain
from elevon.results import finite
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elevon.actuator import Actuator
    from elevon.diagnose.monitor import Monitor, Monitoring, MonitorStep
    from elevon.logs.log import Log
    from elevon.logs.stream import StreamPart, StreamReader

app = typer.Typer(rich_markup_mode=None)


@add_plain(app)
def monitor(
    logs: Annotated[list[Path], Option(metavar="LOG")],
    *,
    actuator: str,
    baseline: Annotated[list[Path], Option(metavar="LOG")],
    window: str | None = None,
    false_alarm_time: str = "1 h",
    fault: Annotated[list[str] | None, Option(metavar="KIND@PLACE")] = None,
    days: Annotated[int | None, Option(min=1)] = None,
    longest: str | None = None,
    state: Path | None = None,
    loadcell: list[Path] | None = None,
    command: list[Path] | None = None,
    column_map: Path | None = None,
    drive: str | None = None,
    role: list[str] | None = None,
    settings: list[str] | None = None,
    strict: bool = False,  # noqa: ARG001 - its callback does the work
    details: bool = False,  # noqa: ARG001 - its callback does the work
    json: bool = False,
) -> None:
    """Watch logs window by window, in the order given, each a day of the unit; alarm at a fault.

    Parameters
    ----------
    logs : list of path
        Drive logs; - reads lines from standard input as they come.
    baseline : list of path
        Healthy log of it; repeatable.
    window : str
        Width of a window, such as '5 s'; default: period of the noted sine.
    false_alarm_time : str
        Mean time between false alarms.
    fault : list of str
        Candidate; repeatable. Default: all.
    days : int
        Days on which the unit is watched. Default: the logs; -: one.
    longest : str
        Longest of those days. Default: the logs'; -: that of the baselines.
    state : path
        Of -: where the stream stands; goes on from there.
    """
    options = WatchOptions(
        window=None if window is None else parse_quantity(window, "s", "--window"),
        false_alarm_time=parse_quantity(false_alarm_time, "s", "--false-alarm-time"),
        days=days,
        longest=None if longest is None else parse_quantity(longest, "s", "--longest"),
        faults=fault,
    )
    healthy = common.read_logs(baseline, column_map, drive=drive, role=role)
    unit = common.read_actuator(actuator, settings)
    if Path("-") in logs:
        _check_stream(logs, loadcell, command, json=json)
        _watch_input(_monitor(unit, healthy, options, command), healthy, column_map, state)
    elif state is not None:
        raise InputError("--state: serves a stream; give - as the log")
    else:
        given = common.read_logs(logs, column_map, loadcell, command, drive=drive, role=role)
        _answer(given, unit, healthy, options, json=json)


def _answer(
    logs: list[Log], unit: Actuator, healthy: list[Log], options: WatchOptions, *, json: bool
) -> None:
    from elevon.diagnose.door import monitor as run

    result = run(logs, unit, healthy, **options._asdict())
    if json:
        print_json(result.to_dict(stored=False))
    else:
        _print(result)


class WatchOptions(NamedTuple):
    """What a monitor is given beside its unit."""

    window: float | None
    false_alarm_time: float
    days: int | None
    longest: float | None
    faults: list[str] | None


def _check_stream(
    logs: list[Path], loadcell: list[Path] | None, command: list[Path] | None, *, json: bool
) -> None:
    if len(logs) > 1:
        raise InputError("-: standard input is watched alone, not beside other logs")
    if loadcell:
        raise InputError("--loadcell: has a clock of its own, which a stream cannot settle")
    if command and len(command) > 1:
        raise InputError(f"--command: {len(command)} given for one stream")
    if json:
        raise InputError("--json: prints one object; a stream prints one a line without it")


def _monitor(
    unit: Actuator, healthy: list[Log], options: WatchOptions, command: list[Path] | None
) -> Monitor:
    from elevon.diagnose.monitor import Monitor
    from elevon.logs.command.note import read_command_note

    note = read_command_note(command[0]) if command else None
    given = options._replace(days=options.days or 1)._asdict()
    return Monitor(unit, healthy, note=note, **given)


def _watch_input(
    watch: Monitor, healthy: list[Log], column_map: Path | None, state: Path | None
) -> None:
    from elevon.logs.maps.column_map import find_map
    from elevon.logs.stream import StreamReader

    if state is not None:
        check_output(state, force=True)
    for text in watch.findings:
        say(text)
    layout = None if column_map is None else find_map(column_map)
    reader = StreamReader(layout, watch.note, known_factors(healthy))
    watch_stream(sys.stdin.buffer, reader, watch, state)


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


_PORTION = 65536  # bytes


def known_factors(baselines: Sequence[Log]) -> dict[str, float]:
    """Return the factors that the import of baselines settled, by column."""
    out: dict[str, float] = {}
    for log in baselines:
        report: Any = {} if log.recording is None else log.recording.meta.get("import") or {}
        for item in report.get("channels", ()):
            if item.get("factor") is not None:
                out[item["column"]] = item["factor"]
    return out


def watch_stream(
    source: IO[bytes], reader: StreamReader, watch: Monitor, state: Path | None
) -> None:
    """Watch a stream to its end; write a line for each window, flushed, and a last one.

    Raises
    ------
    InputError
        Lines that are no stream of samples; no window that could be used, without a state.
    """
    if state is not None and state.exists():
        watch.resume(state)
        reader.go_on(watch.heading)
        say(f"goes on from {state}, behind the sample of {watch.latest} s")
    story = "nothing was written" if state is None else f"{state} holds where the stream stands"
    with interrupt.telling(lambda: story):
        try:
            for part in _parts(source, reader):
                with interrupt.postpone():  # a state is of a whole number of lines
                    if _take(part, reader, watch):
                        _save(watch, state)
            _write(watch.finish(), watch)
        finally:
            _save(watch, state)
    if state is None and not watch.windows:
        raise InputError(f"no window of {watch.width:g} s could be used: {_why(watch, reader)}")
    _end(watch, reader)


def _parts(source: IO[bytes], reader: StreamReader) -> Iterator[StreamPart]:
    """Yield what comes, as it comes."""
    read = getattr(source, "read1", source.read)
    while data := read(_PORTION):
        yield from reader.read(data)


def _take(part: StreamPart, reader: StreamReader, watch: Monitor) -> bool:
    """Feed what some lines say; return whether a window became whole."""
    watch.heading = reader.heading
    for text in part.notes:
        say(text)
    if part.unreadable:
        watch.leave_out(part.unreadable)
        say(f"{part.why}; {part.unreadable} lines left out")
    steps = watch.feed(part.samples) if len(part.samples["time"]) else []
    _write(steps, watch)
    if part.new_day:
        last = watch.finish()
        _write(last, watch)
        watch.new_day()
        return True
    return bool(steps)


def _why(watch: Monitor, reader: StreamReader) -> str:
    """What came instead of a window."""
    reasons = list(watch.skipped)
    if watch.latest is not None:
        reasons.append(f"the day's samples span {watch.latest - (watch.origin or 0.0):g} s")
    counts = {n.replace("_", " "): k for n, k in watch.samples.to_dict().items() if k}
    reasons += [f"samples {name}: {count}" for name, count in counts.items()]
    if reader.cut_off:
        reasons.append(f"the stream ends in mid-line, {reader.cut_off} bytes behind its last one")
    return "; ".join(reasons) or "no sample came"


def _save(watch: Monitor, state: Path | None) -> None:
    if state is not None:
        watch.save(state)


def _write(steps: Sequence[MonitorStep], watch: Monitor) -> None:
    for step in steps:
        line = {"event": "window", "day_began": watch.origin} | step.to_dict()
        if watch.alarm is not None and (watch.alarm.log, watch.alarm.time) == (step.log, step.end):
            line["first_alarm"] = watch.alarm.to_dict()
        _line(line)


def _end(watch: Monitor, reader: StreamReader) -> None:
    result = watch.result()
    if reader.cut_off:
        say(f"the stream ends in mid-line: its last {reader.cut_off} bytes are left out")
    _line(
        {
            "event": "end",
            "ended": "in mid-line" if reader.cut_off else "whole",
            "bytes_left_out": reader.cut_off,
            **fields_of(result, "status", "findings"),
            **fields_of(watch, "windows", "skipped", "samples", "top", "alarm"),
        }
    )


def _line(data: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(finite(plain(data)), allow_nan=False) + "\n")
    sys.stdout.flush()
