"""`elevon validate`: an actuator held against logs."""

from __future__ import annotations

import typer

from elevon.cli.calibrate import (
    CommandOption,
    DateOption,
    FidelityOption,
    LoadcellOption,
    LogsArgument,
    MapOption,
    ReportOption,
    TransientOption,
    read,
)
from elevon.cli.common import (
    ActuatorOption,
    DetailsOption,
    ForceOption,
    JsonOption,
    SetOption,
    StrictOption,
    check_outputs,
    read_actuator,
)
from elevon.cli.output import answer, listed, print_json, print_table, progress_bar, say
from elevon.number_text import quantity_text

app = typer.Typer(rich_markup_mode=None)


@app.command()
def validate(
    logs: LogsArgument,
    *,
    actuator: ActuatorOption,
    loadcell: LoadcellOption = None,
    command: CommandOption = None,
    column_map: MapOption = None,
    fidelity: FidelityOption = "low",
    transient: TransientOption = None,
    settings: SetOption = None,
    report: ReportOption = None,
    strict: StrictOption = False,  # noqa: ARG001 - its callback does the work
    details: DetailsOption = False,  # noqa: ARG001 - its callback does the work
    json: JsonOption = False,
    force: ForceOption = False,
    date: DateOption = None,
) -> int:
    """Compare the model with logs, signal by signal; exit 1 where a threshold fails."""
    from elevon.calibrate.door import validate as run

    check_outputs([report], force=force)
    model = read_actuator(actuator, settings)
    data = read(logs, column_map, loadcell, command)
    with progress_bar("validating") as advance:
        result = run(data, model, fidelity=fidelity, transient=transient, progress=advance)
        advance(1.0)
    if report is not None:
        say(f"report: {result.report(date=date).save(report, force=force)}")
    if json:
        print_json(result.to_dict(stored=False))
    else:
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
    return 1 if result.status == "fail" else 0


def _sensor_text(name: str, value: float) -> str:
    """Say in words what a log's sensor adds: an offset, a delay or a filter."""
    channel, _, kind = name.rpartition("_")
    if kind == "delay" and channel:
        return f"{channel}: the log shows it {1e3 * value:.3g} ms late"
    if kind == "lag" and channel:
        return f"{channel}: the log shows it behind a filter of {1e3 * value:.3g} ms"
    return f"{name}: the sensor's offset of {value:.4g} is taken off the logs"
