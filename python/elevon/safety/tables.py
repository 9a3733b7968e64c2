"""What a campaign leaves beside its page: FMEA and cut sets as CSV, rows as scenario files."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from elevon.actuator import Actuator
from elevon.faults.catalogue import find_record
from elevon.files import write_text
from elevon.safety.hazards import TARGETS
from elevon.safety.outcomes import Detection
from elevon.safety.result import FailureResult, SafetyResult

FMEA = ("failure", "place", "rate", "phase", "local_effect", "end_effect", "detection",
        "latency_s", "message", "compensation", "class", "scenario")  # fmt: skip
CUT_SETS = ("hazard", "class", "order", "failures", "dormant", "last", "phase", "mean", "worst",
            "low", "high", "common_cause", "rows")  # fmt: skip
_COMPENSATION = {
    "fault": "the unit stops the motor and says so",
    "refused": "the unit refuses the command and says so",
    "warning": "the crew is warned, the unit goes on",
    "state": "the crew sees that the end is not reached",
    "monitor": "the monitor tells the crew",
    "drive tripped": "the drive opens its bridge",
    "winding hot": "the crew is warned, the drive goes on",
}
"""What is done about a failure, by the first word of its message."""


def fmea(result: SafetyResult, wiring: str) -> list[list[object]]:
    """Return the rows of the FMEA, a failure and a phase each, in the order of `FMEA`."""
    classes = {hazard.name: hazard.severity for hazard in result.hazards}
    rows: list[list[object]] = []
    for failure in result.failures:
        kind, _, place = failure.name.partition("=")[0].partition("@")
        effect = find_record(kind, place, wiring).effect
        for item in failure.detections:
            severity = [classes[name] for name in item.hazards]
            worst = next((name for name in TARGETS if name in severity), "no safety effect")
            rows.append([
                failure.name, place, f"{failure.rate:.3e}", item.phase, effect,
                ", ".join(item.hazards) or "none of the hazards", _detection(failure, item),
                "" if item.latency is None else f"{item.latency:.3g}", item.message,
                _compensation(failure, item), worst, f"rows/{item.scenario}.toml",
            ])  # fmt: skip
    return rows


def _detection(failure: FailureResult, item: Detection) -> str:
    if item.announced:
        return f"{item.audience}, in {item.announced} of {item.situations} situations"
    revealed = "" if failure.evident else f", until {failure.check} every {failure.interval:g} h"
    return f"dormant in {item.situations} situations{revealed}"


def _compensation(failure: FailureResult, item: Detection) -> str:
    word = item.message.partition(":")[0]
    if item.message:
        return _COMPENSATION.get(word, "the crew is told")
    return "another phase of the flight reveals it" if failure.evident else "none until the check"


def cut_sets(result: SafetyResult) -> Iterator[list[object]]:
    """Yield the cut sets of all hazards in the order of `CUT_SETS`."""
    for hazard in result.hazards:
        for cut in hazard.cut_sets:
            yield [
                hazard.name, hazard.severity, cut.order, " + ".join(cut.failures),
                " + ".join(cut.dormant), "any" if len(cut.last) == cut.order else cut.last[0],
                cut.phase, *(f"{x:.4e}" for x in (cut.mean, cut.worst, cut.low, cut.high,
                                                  cut.common)),
                " ".join(map(str, cut.rows)),
            ]  # fmt: skip


def written_rows(result: SafetyResult) -> list[int]:
    """Return the rows of which a file is written: those of hazards and of the FMEA."""
    unsafe = {finding.row for hazard in result.hazards for finding in hazard.findings}
    known = result.outcomes
    healthy = {
        place
        for place, row in enumerate(known.rows)
        if not row.faults and any(outcome.hazards for _, outcome in known.both(place))
    }
    listed = {item.scenario for failure in result.failures for item in failure.detections}
    return sorted(unsafe | listed | healthy | set(result.fidelity.changed))


def write_tables(result: SafetyResult, actuator: Actuator, folder: Path, *, force: bool) -> None:
    """Write fmea.csv, cutsets.csv and rows/N.toml.

    Parameters
    ----------
    result : SafetyResult
        What the campaign showed.
    actuator : Actuator
        What was run: the rows' files state the command that replays them.
    folder : path
        Where they go.
    force : bool
        Whether files that are there are replaced, rows of an older campaign removed.
    """
    failures = _csv(FMEA, fmea(result, actuator.wiring))
    write_text(folder / "fmea.csv", failures, force=force)
    write_text(folder / "cutsets.csv", _csv(CUT_SETS, cut_sets(result)), force=force)
    if force:
        for old in (folder / "rows").glob("*.toml"):
            if old.stem.isdigit():
                old.unlink()
    for place in written_rows(result):
        text = row_file(result, actuator, place)
        write_text(folder / "rows" / f"{place}.toml", text, force=force)


def row_file(result: SafetyResult, actuator: Actuator, place: int) -> str:
    """Return the scenario file of a row, with what it showed and how it is replayed."""
    row = result.outcomes.rows[place]
    lines = [row.combination, row.situation]
    for fidelity, outcome in result.outcomes.both(place):
        hazards = ", ".join(f"{name} at {time:g} s" for name, time in outcome.hazards.items())
        messages = ", ".join(f"{item.text} at {item.time:g} s" for item in outcome.messages)
        lines += [
            f"{fidelity}: {hazards or 'no hazard'}; {messages or 'no message'}; ends {outcome.end}",
            f"elevon simulate {actuator.name} --scenario rows/{place}.toml --fidelity {fidelity} "
            f"--record '{result.record}'",
        ]
    return row.toml(*lines)


def _csv(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(heads)
    writer.writerows(rows)
    return text.getvalue()
