"""`elevon diagnose`: what is wrong, where, how bad, how sure."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from elevon.cli import common
from elevon.cli.output import answer, listed, print_table, say
from elevon.cli.shell import Answer, command
from elevon.errors import InputError
from elevon.number_text import severity_texts

if TYPE_CHECKING:
    from elevon.diagnose.engine.answer import Cause, Diagnosis
    from elevon.prognose.history import NextEntry

app = typer.Typer(rich_markup_mode=None)


@command(app, "strict", "details", "report", "force")
def diagnose(
    logs: list[Path],
    *,
    actuator: str,
    loadcell: list[Path] | None = None,
    command: list[Path] | None = None,
    column_map: Path | None = None,
    baseline: list[Path] | None = None,
    model: Path | None = None,
    fault: list[str] | None = None,
    false_alarm: float = 0.05,
    append: Path | None = None,
    usage: str | None = None,
    settings: list[str] | None = None,
    force: bool = False,
) -> Answer:
    """Diagnose the unit that wrote the logs, all in one condition."""
    from elevon.diagnose.door import diagnose as run

    if not 0.0 < false_alarm < 1.0:
        raise InputError(f"--false-alarm {false_alarm:g}: must be between 0 and 1")
    unit = common.read_actuator(actuator, settings)
    inspection = _inspection(append, usage, unit.name, force=force)
    result = run(
        common.read_logs(logs, column_map, loadcell, command), unit,
        common.read_logs(baseline or [], column_map), faults=fault, false_alarm=false_alarm,
        model=model,
    )  # fmt: skip
    code = 0 if inspection is None else _append(inspection, result)
    return Answer(result, lambda: _print(result), code, page=result.report)


def _inspection(
    history: Path | None, usage: str | None, actuator: str, *, force: bool
) -> NextEntry | None:
    """Return where the answer is added; refused before the work where it cannot be."""
    from elevon.prognose.history import next_entry

    if history is None and usage is None:
        return None
    if history is None or usage is None:
        raise InputError("--append HISTORY and --usage N go together: a use is that of a history")
    return next_entry(history, usage, actuator, force=force)


def _append(inspection: NextEntry, result: Diagnosis) -> int:
    try:
        say(f"added: {inspection.write(result)}")
    except InputError as error:
        say(f"elevon: {error}")
        return 1
    return 0


def _print(result: Diagnosis) -> None:
    from elevon.diagnose.engine.words import by_reason, folded, sentence

    answer(result.headline)
    rows = [
        (
            f"{c.kind}@{c.place}",
            f"{c.probability:.3f}",
            *_severity(c),
            ", ".join(folded(c)),
        )
        for c in result.faults
    ]
    print_table(("cause", "probability", "severity", "low", "high", "ambiguous with"), rows)
    unseen = [f"not observable: {n}: {reason}" for n, reason in by_reason(result.unobservable)]
    listed([*result.findings, sentence(result), *unseen])


def _severity(cause: Cause) -> tuple[str, str, str]:
    """A severity with its interval; a class may have none."""
    if math.isnan(cause.severity):
        return "-", "-", "-"
    return severity_texts(cause.severity, cause.interval, cause.unit)
