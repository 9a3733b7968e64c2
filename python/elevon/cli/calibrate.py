"""`elevon calibrate`: an actuator's parameters from logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from elevon.cli.common import (
    ActuatorOption,
    DetailsOption,
    ForceOption,
    JsonOption,
    SetOption,
    StrictOption,
    check_outputs,
    read_actuator,
    without_companions,
)
from elevon.cli.output import answer, listed, print_json, print_table, progress_bar, say
from elevon.errors import InputError
from elevon.number_text import estimate_row

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elevon.calibrate.outcome import Calibration
    from elevon.logs.log import Log

app = typer.Typer(rich_markup_mode=None)

LogsArgument = Annotated[list[Path], typer.Argument(metavar="LOG...", help="Drive logs.")]
LoadcellOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--loadcell",
        help="Load-cell file; one for each log in order. By default NAME_loadcell.csv beside it.",
    ),
]
CommandOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--command",
        help="Command note; one for each log, or one for all. By default NAME_command.json.",
    ),
]
MapOption = Annotated[Path | None, typer.Option("--map", help="Column map (TOML).")]
FreeOption = Annotated[
    list[str] | None,
    typer.Option(help="Parameter path to estimate, repeatable; or auto (the default)."),
]
PerLogOption = Annotated[
    list[str] | None,
    typer.Option(
        "--per-log", metavar="PATH", help="Estimated for each log too: backlash.total; repeatable."
    ),
]
FidelityOption = Annotated[str, typer.Option(help="Of the model runs: low or high.")]
RunsFidelityOption = Annotated[
    str | None,
    typer.Option(
        "--fidelity",
        help="Of the model runs: low or high. Default: low; landing gear: what its logs bear.",
    ),
]
TransientOption = Annotated[
    float | None, typer.Option(min=0.0, help="Left out at the beginning of each log [s].")
]
ReportOption = Annotated[Path | None, typer.Option("--report", help="HTML page to write.")]
DateOption = Annotated[str | None, typer.Option(help="Date printed in the report.")]


def one_each(
    option: str, given: list[Path] | None, count: int, *, shared: bool = False
) -> list[Path | None]:
    """Spread files over logs.

    A single load-cell file of several logs would be a guess, so it is refused; one command note
    for all is what a bench run repeated gives.
    """
    if not given:
        return [None] * count
    if shared and len(given) == 1:
        return [given[0]] * count
    if len(given) != count:
        raise InputError(f"{option}: {len(given)} given for {count} logs; one for each, in order")
    return list(given)


def read(
    logs: Sequence[Path],
    column_map: Path | None = None,
    loadcell: list[Path] | None = None,
    command: list[Path] | None = None,
) -> list[Log]:
    """Read logs with what stands beside them; warnings of the import go to stderr."""
    from elevon.logs.read import read_logs

    paths = without_companions(list(logs))
    if not paths:
        return []
    read = read_logs(
        paths,
        column_map,
        loadcells=one_each("--loadcell", loadcell, len(paths)),
        notes=one_each("--command", command, len(paths), shared=True),
    )
    for log in read:
        for text in log.warnings:
            say(f"{log.name}: {text}")
    return read


@app.command()
def calibrate(
    logs: LogsArgument,
    *,
    actuator: ActuatorOption,
    out: Annotated[Path | None, typer.Option(help="Set to write (TOML).")] = None,
    loadcell: LoadcellOption = None,
    command: CommandOption = None,
    column_map: MapOption = None,
    free: FreeOption = None,
    per_log: PerLogOption = None,
    fidelity: RunsFidelityOption = None,
    transient: TransientOption = None,
    settings: SetOption = None,
    report: ReportOption = None,
    strict: StrictOption = False,  # noqa: ARG001 - its callback does the work
    details: DetailsOption = False,  # noqa: ARG001 - its callback does the work
    json: JsonOption = False,
    force: ForceOption = False,
    date: DateOption = None,
) -> int:
    """Estimate what the logs determine, with intervals, and write it as a set."""
    from elevon.calibrate.door import calibrate as run
    from elevon.calibrate.drops import is_drop_table

    check_outputs([out, report], force=force)
    if out is not None and out.suffix.lower() != ".toml":
        raise InputError(f"--out {out}: a set is a TOML file; end the name in .toml")
    model, paths = read_actuator(actuator, settings), _paths(free)
    table = len(logs) == 1 and is_drop_table(logs[0])
    given = logs if table else read(logs, column_map, loadcell, command)
    with progress_bar("calibrating") as advance:
        result = run(
            given, model, paths, per_log=per_log or [], fidelity=fidelity, transient=transient,
            promise=out is not None, progress=advance,
        )  # fmt: skip
        advance(1.0)
    if out is not None:
        say(f"set: {result.write_actuator(out, force=force)}")
    if report is not None:
        say(f"report: {result.report(date=date).save(report, force=force)}")
    if json:
        print_json(result.to_dict(stored=False) | {"out": None if out is None else str(out)})
    else:
        _print(result)
    return 0


def _paths(free: list[str] | None) -> list[str] | None:
    """Split ``--free a,b``; auto or nothing: everything that the logs determine."""
    names = [name.strip() for text in free or () for name in text.split(",") if name.strip()]
    if not names or names == ["auto"]:
        return None
    if "auto" in names:
        raise InputError("--free auto stands alone: it frees what the logs can determine")
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"--free {name} is given twice")
    return names


def _print(result: Calibration) -> None:
    answer(result.headline)
    rows = [estimate_row(item, result.before, item.register) for item in result.estimates]
    columns = ("parameter", "before", "after", "low", "high", "unit", "register", "holds for")
    print_table(columns, rows, optional=("register",))
    listed(result.remarks)
