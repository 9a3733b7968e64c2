"""`elevon validate`: an actuator held against logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from elevon.cli import common
from elevon.cli.output import answer, listed, print_table, progress_bar
from elevon.cli.shell import Answer, command
from elevon.number_text import quantity_text

if TYPE_CHECKING:
    from elevon.calibrate.validation import Validation

app = typer.Typer(rich_markup_mode=None)


@command(app, "strict", "details", "report", "force", "date")
def validate(
    logs: list[Path],
    *,
    actuator: str,
    loadcell: list[Path] | None = None,
    command: list[Path] | None = None,
    column_map: Path | None = None,
    fidelity: str = "low",
    transient: float | None = None,
    settings: list[str] | None = None,
) -> Answer:
    """Compare the model with logs, signal by signal; exit 1 where a threshold fails."""
    from elevon.calibrate.door import validate as run

    model = common.read_actuator(actuator, settings)
    data = common.read_logs(logs, column_map, loadcell, command)
    with progress_bar("validating") as advance:
        result = run(data, model, fidelity=fidelity, transient=transient, progress=advance)
        advance(1.0)
    code = 1 if result.status == "fail" else 0
    return Answer(result, lambda: _print(result), code, page=result.report)


def _print(result: Validation) -> None:
    answer(result.headline)
    rows = [
        (
            e.log,
            e.signal,
            quantity_text(e.rms, e.unit, 4)[0],
            *quantity_text(e.largest, e.unit, 4),
            f"{e.of_rms:.3g}",
            f"{e.of_range:.3g}",
            "" if e.limit is None else f"{e.limit:.3g}",
            "" if e.passed is None else "pass" if e.passed else "FAIL",
        )
        for e in result.errors
    ]
    print_table(
        ("log", "signal", "RMS", "max", "unit", "% of RMS", "% of range", "limit %", ""), rows
    )
    listed([_sensor_text(name, offset) for name, offset in result.offsets.items()])
    answer(
        "% of RMS: RMS error over the logged signal's RMS about its mean; "
        f"% of range: over its range; after {result.transient:g} s"
    )
    listed([f"{name}: {text}" for name, text in result.notes.items()])


def _sensor_text(name: str, value: float) -> str:
    """Say in words what a log's sensor adds: an offset, a delay or a filter."""
    channel, _, kind = name.rpartition("_")
    if kind == "delay" and channel:
        return f"{channel}: the log shows it {1e3 * value:.3g} ms late"
    if kind == "lag" and channel:
        return f"{channel}: the log shows it behind a filter of {1e3 * value:.3g} ms"
    return f"{name}: the sensor's offset of {value:.4g} is taken off the logs"
