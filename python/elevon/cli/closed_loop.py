"""`elevon calibrate` and `elevon validate` on logs with few channels: in closed loop."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from elevon.cli.output import print_json, print_table, progress_bar, say
from elevon.errors import FormatError, InputError
from elevon.number_text import estimate_row

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.calibrate.closed_loop import LoopCalibration, LoopLog
    from elevon.calibrate.validation import Validation
    from elevon.recording import Recording
    from elevon.report import Report

__all__ = [
    "calibrate_closed_loop",
    "check_loop_options",
    "read_loop_logs",
    "read_recording",
    "validate_closed_loop",
]


def read_loop_logs(paths: Sequence[Path], column_map: Path | None) -> list[LoopLog]:
    """Read recordings, or logs through a column map, by the roles of their channels."""
    from elevon.calibrate.closed_loop import loop_log

    return [loop_log(read_recording(path, column_map), path.name) for path in paths]


def read_recording(path: Path, column_map: Path | None) -> Recording:
    """Read one recording, or a log through a column map."""
    from elevon.logs.importing import import_log
    from elevon.recording import Recording

    if column_map is None:
        try:
            return Recording.load(path)
        except (FormatError, InputError):
            pass
    return import_log(path, column_map=column_map).recording


def calibrate_closed_loop(
    logs: Sequence[LoopLog],
    model: Actuator,
    out: Path | None,
    *,
    free: Sequence[str] | None,
    transient: float | None,
    report: Path | None,
    as_json: bool,
    force: bool,
    date: str | None,
) -> int:
    """Calibrate, write the set with thresholds from held-out data, print."""
    from elevon.calibrate.closed_loop import calibrate_loop
    from elevon.calibrate.closed_loop.held_out import validate_loop
    from elevon.calibrate.write import write_calibration

    with progress_bar("calibrating in closed loop") as advance:
        result = calibrate_loop(logs, model, free=free, transient=transient, progress=advance)
        advance(1.0)
    if out is not None:
        say(f"set: {write_calibration(out, result, validation=result.held_out, force=force)}")
    after = validate_loop(logs, result.actuator, transient, result.held_out.offsets)
    if report is not None:
        say(f"report: {_page(result, after, date).save(report, force=force)}")
    if as_json:
        document = result.to_dict()
        document["out"] = None if out is None else str(out)
        document["validation"] = {"before": None, "after": after.to_dict()}
        print_json(document)
        return 0
    _print(result, after)
    return 0


def check_loop_options(fidelity: str, per_log: Sequence[str] | None) -> None:
    """Refuse what the closed loop has no meaning for."""
    from elevon.simulate.prepare import check_fidelity

    check_fidelity("rotary", fidelity)
    if fidelity != "low":
        raise InputError(
            f"--fidelity {fidelity}: the closed loop is searched over some 10 000 runs, which are "
            "of the low fidelity; leave it out, and validate the set with elevon compare"
        )
    if per_log:
        raise InputError(
            "--per-log: these logs have no two positions and set points to estimate each log's "
            "backlash from; leave it out"
        )


def _page(result: LoopCalibration, after: Validation, date: str | None) -> Report:
    """The page: parameters, what is not determined, errors of each log."""
    import elevon
    from elevon.calibrate.parts_page import parts_report
    from elevon.report import ReportTable

    page = parts_report(result, date=date)
    page.fact("Controller", f"{result.structure} ({result.why})")
    rows: list[list[object]] = [
        [error.log, error.signal, error.rms, error.unit, error.of_rms, error.of_range]
        for error in after.errors
    ]
    columns = ["Log", "Signal", "RMS error", "Unit", "% of RMS", "% of range"]
    page.section("Logs against the model").table(ReportTable(columns, rows, digits=4))
    page.provenance({"Elevon": elevon.__version__})
    return page


def _print(result: LoopCalibration, after: Validation) -> None:
    say(f"controller: {result.structure} ({result.why})")
    print_table(
        ("parameter", "before", "after", "low", "high", "unit", "holds for"),
        [estimate_row(item, result.actuator) for item in result.estimates],
    )
    for path, reason in result.undetermined.items():
        say(f"{path} is not determined: {reason}")
    for error in after.errors:
        say(
            f"{error.log}: {error.signal} within {error.of_range:.2g} % of its range, "
            f"{error.of_rms:.3g} % of its RMS"
        )


def validate_closed_loop(
    logs: Sequence[LoopLog], model: Actuator, transient: float | None
) -> Validation:
    """Hold an actuator file against logs; its thresholds judge."""
    from elevon.calibrate.closed_loop.held_out import validate_loop

    return validate_loop(logs, model, transient)
