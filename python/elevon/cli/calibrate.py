"""`elevon calibrate`: an actuator's parameters from bench logs."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.by_parts import Way, calibrate_by_parts, way_by_parts
from elevon.cli.calibrate_drops import is_drop_table, run_drops
from elevon.cli.closed_loop import calibrate_closed_loop, check_loop_options, read_loop_logs
from elevon.cli.common import (
    ActuatorOption,
    ForceOption,
    JsonOption,
    SetOption,
    StrictOption,
    check_outputs,
    read_actuator,
    without_companions,
)
from elevon.cli.output import print_json, print_table, progress_bar, say
from elevon.errors import InputError
from elevon.number_text import estimate_row, estimate_texts, written_unit

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.calibrate.calibration import Calibration
    from elevon.calibrate.log import BenchLog
    from elevon.calibrate.validation import Validation

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
    logs: list[Path],
    loadcell: list[Path] | None,
    command: list[Path] | None,
    column_map: Path | None,
) -> list[BenchLog]:
    """Import logs with their companions; warnings of the import go to stderr."""
    from elevon.calibrate.log import read_logs

    logs = without_companions(logs)
    logs_read = read_logs(
        logs,
        loadcells=one_each("--loadcell", loadcell, len(logs)),
        commands=one_each("--command", command, len(logs), shared=True),
        column_map=column_map,
    )
    for log in logs_read:
        for text in log.warnings:
            say(f"{log.name}: {text}")
    return logs_read


def direct_logs(
    model: Actuator,
    logs: list[Path],
    loadcell: list[Path] | None,
    command: list[Path] | None,
    column_map: Path | None,
) -> list[BenchLog] | None:
    """Return logs whose signals allow direct estimates; None where the closed loop must serve."""
    if model.wiring != "rotary":
        return None
    try:
        return read(logs, loadcell, command, column_map)
    except InputError as error:
        try:
            read_loop_logs(logs, column_map)
        except InputError:
            raise error from None
        say(f"in closed loop, since {error}")
        return None


@dataclass(frozen=True)
class _Options:
    """What is to be estimated, and where it goes."""

    free: list[str] | None
    per_log: list[str]
    fidelity: str
    transient: float | None
    out: Path | None
    report: Path | None
    as_json: bool
    force: bool
    date: str | None


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
    json: JsonOption = False,
    force: ForceOption = False,
    date: DateOption = None,
) -> int:
    """Estimate what the logs determine, with intervals, and write it as a set."""
    check_outputs([out, report], force=force)
    if out is not None and out.suffix.lower() != ".toml":
        raise InputError(f"--out {out}: a set is a TOML file; end the name in .toml")
    model = read_actuator(actuator, settings)
    if len(logs) == 1 and is_drop_table(logs[0]):
        return _drops(logs[0], model, out, as_json=json, force=force)
    options = _Options(
        _paths(free), per_log or [], fidelity or "low", transient, out, report, json, force, date
    )
    way = way_by_parts(logs, model, column_map, fidelity or "auto")
    if way is not None:
        return _by_parts(way, model, options)
    data = direct_logs(model, logs, loadcell, command, column_map)
    if data is None:
        return _in_closed_loop(logs, model, column_map, options)
    return _directly(data, model, options)


def _by_parts(way: Way, model: Actuator, options: _Options) -> int:
    """Logs by roles: each number from its own balance."""
    if options.transient is not None or (options.fidelity != "low" and not way.runs):
        say("--transient, and --fidelity without model runs: not used for these logs")
    return calibrate_by_parts(
        way, model, free=options.free, out=options.out, report=options.report,
        as_json=options.as_json, force=options.force, date=options.date,
    )  # fmt: skip


def _in_closed_loop(
    logs: list[Path], model: Actuator, column_map: Path | None, options: _Options
) -> int:
    """Logs with few channels."""
    check_loop_options(options.fidelity, options.per_log)
    return calibrate_closed_loop(
        read_loop_logs(logs, column_map), model, options.out, free=options.free,
        transient=options.transient, report=options.report, as_json=options.as_json,
        force=options.force, date=options.date,
    )  # fmt: skip


def _directly(data: list[BenchLog], model: Actuator, options: _Options) -> int:
    """Logs whose signals allow direct estimates."""
    from elevon.calibrate.calibration import calibrate as run
    from elevon.calibrate.write import write_calibration

    with progress_bar("calibrating") as advance:
        result = run(
            data, model, free=options.free, per_log=options.per_log, fidelity=options.fidelity,
            transient=options.transient, progress=lambda f: advance(0.9 * f),
        )  # fmt: skip
        before, after = _agreement(data, result, options.transient)
        advance(0.95)
        promise = after
        if options.out is not None and after is not None:
            promise = _promise(data, model, options.free, after)
        advance(1.0)
    if options.out is not None:
        path = write_calibration(options.out, result, validation=promise, force=options.force)
        say(f"set: {path}")
    if options.report is not None:
        page = _page(result, before, after, options.date)
        say(f"report: {page.save(options.report, force=options.force)}")
    _print(result, before, after, options.out, as_json=options.as_json)
    return 0


def _drops(path: Path, model: Actuator, out: Path | None, *, as_json: bool, force: bool) -> int:
    """A table of hung weights: stiffness and dead zone."""
    from elevon.calibrate.write import write_values

    result, facts = run_drops(path, model)
    if out is not None:
        say(f"set: {write_values(out, model, result.estimates, path.name, force=force)}")
    if as_json:
        print_json(result.to_dict() | facts | {"out": None if out is None else str(out)})
        return 0
    rows = [
        (i.path, *estimate_texts(i.value, i.interval, i.unit, written_unit(model, i.path)))
        for i in result.estimates
    ]
    print_table(("parameter", "value", "low", "high", "unit"), rows)
    say(f"{len(facts['slips'])} slips mended; {facts['assumed']}")
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


def _agreement(
    data: list[BenchLog], result: Calibration, transient: float | None
) -> tuple[Validation | None, Validation | None]:
    """Old and new values in closed loop on the same logs, where positions were logged."""
    from elevon.calibrate.validation import validate

    if any(log.output is None or log.motor is None for log in data):
        say("a log lacks a position: the closed loop is not compared")
        return None, None
    try:
        after = validate(data, result.actuator, transient=transient)
        return validate(data, result.before, transient=after.transient), after
    except InputError as error:
        say(f"the closed loop is not compared: {error}")
        return None, None


def _promise(
    data: list[BenchLog], model: Actuator, free: list[str] | None, after: Validation
) -> Validation:
    """What the thresholds come from: logs held out, or where there is one log, that log."""
    from elevon.calibrate.promise import held_out_agreement, outliers

    agreement = held_out_agreement(data, model, free, after)
    if agreement is None:
        say("thresholds: from the fit itself, since no log could be held out")
        return after
    for name in outliers(agreement):
        say(f"{name}: predicted far worse than the other logs; the thresholds leave it out")
    return agreement


def _page(
    result: Calibration, before: Validation | None, after: Validation | None, date: str | None
) -> Any:
    from elevon.calibrate.report import calibration_report

    return calibration_report(result, before, after, provenance=_provenance(), date=date)


def _provenance() -> dict[str, object]:
    import elevon

    return {
        "Elevon": elevon.__version__,
        "Python": ".".join(str(part) for part in sys.version_info[:3]),
    }


def _print(
    result: Calibration,
    before: Validation | None,
    after: Validation | None,
    out: Path | None,
    *,
    as_json: bool,
) -> None:
    if as_json:
        values = result.to_dict() | {
            "out": None if out is None else str(out),
            "validation": {
                "before": None if before is None else before.to_dict(),
                "after": None if after is None else after.to_dict(),
            },
        }
        print_json(values)
        return
    rows = [estimate_row(i, result.before, i.register) for i in result.estimates]
    columns = ("parameter", "before", "after", "low", "high", "unit", "register", "holds for")
    print_table(columns, rows, optional=("register",))
    for text in result.findings:
        say(text)
