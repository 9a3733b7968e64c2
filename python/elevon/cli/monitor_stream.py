"""`elevon monitor -`: lines of samples in, a line a window out."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from elevon.cli import interrupt
from elevon.cli.output import say
from elevon.errors import InputError
from elevon.plain import fields_of, plain
from elevon.results import finite

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elevon.diagnose.monitor import Monitor, MonitorStep
    from elevon.logs.log import Log
    from elevon.logs.stream import StreamPart, StreamReader

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
