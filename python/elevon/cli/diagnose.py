"""`elevon diagnose`: what is wrong, where, how bad, how sure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from elevon.cli import common
from elevon.cli.output import answer, listed, print_table
from elevon.cli.shell import Answer, command
from elevon.errors import InputError
from elevon.number_text import severity_texts

if TYPE_CHECKING:
    from elevon.diagnose.engine.answer import Diagnosis

app = typer.Typer(rich_markup_mode=None)


@command(app, "strict", "details", "report", "force")
def diagnose(
    logs: common.LogsArgument,
    *,
    actuator: common.ActuatorOption,
    loadcell: common.LoadcellOption = None,
    command: common.CommandOption = None,
    column_map: common.MapOption = None,
    baseline: Annotated[
        list[Path] | None,
        typer.Option("--baseline", metavar="LOG", help="Log of the healthy unit; repeatable."),
    ] = None,
    method: Annotated[
        str, typer.Option(help="model, surrogate, or both (it proposes, the model refines).")
    ] = "model",
    surrogate: Annotated[
        Path | None,
        typer.Option(help="Surrogate by elevon diagnose-train; default: the package's own."),
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option("--fault", metavar="KIND@PLACE", help="Candidate; repeatable. Default: all."),
    ] = None,
    false_alarm: Annotated[
        float, typer.Option("--false-alarm", help="Rate of healthy logs called faulty.")
    ] = 0.05,
    settings: common.SetOption = None,
) -> Answer:
    """Diagnose the unit that wrote the logs, all in one condition."""
    from elevon.diagnose.door import diagnose as run

    if not 0.0 < false_alarm < 1.0:
        raise InputError(f"--false-alarm {false_alarm:g}: must be between 0 and 1")
    model = common.read_actuator(actuator, settings)
    result = run(
        common.read_logs(logs, column_map, loadcell, command), model,
        common.read_logs(baseline or [], column_map), method=method,
        surrogate=surrogate, faults=fault, false_alarm=false_alarm,
    )  # fmt: skip
    return Answer(result, lambda: _print(result), page=result.report)


def _print(result: Diagnosis) -> None:
    from elevon.diagnose.engine.words import by_reason, folded, sentence

    answer(result.headline)
    rows = [
        (
            f"{c.kind}@{c.place}",
            f"{c.probability:.3f}",
            *severity_texts(c.severity, c.interval, c.unit),
            ", ".join(folded(c)),
        )
        for c in result.faults
    ]
    print_table(("cause", "probability", "severity", "low", "high", "ambiguous with"), rows)
    unseen = [f"not observable: {n}: {reason}" for n, reason in by_reason(result.unobservable)]
    listed([*result.findings, sentence(result), *unseen])
