"""`elevon calibrate` on logs of an actuator with a control unit of its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from elevon.cli.closed_loop import read_recording
from elevon.cli.output import print_json, print_table, progress_bar, say
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.calibrate.by_parts import PartsCalibration
    from elevon.calibrate.validation import Validation
    from elevon.recording import Recording

__all__ = ["calibrate_unit", "has_control_unit"]


def has_control_unit(model: Actuator) -> bool:
    """Whether the wiring closes no position loop of its own: a control unit moves it by states."""
    from elevon.parameters.records import wirings

    return "position" not in wirings()[model.wiring]["modes"]


def calibrate_unit(
    paths: Sequence[Path],
    model: Actuator,
    *,
    column_map: Path | None,
    free: Sequence[str] | None,
    out: Path | None,
    report: Path | None,
    as_json: bool,
    force: bool,
    date: str | None,
) -> int:
    """Calibrate, write the set with thresholds from held-out motions, print."""
    from elevon.calibrate.gear import calibrate_gear, gear_log
    from elevon.calibrate.write import write_calibration

    recordings = _read(paths, column_map)
    logs = [gear_log(recording, name) for name, recording in recordings.items()]
    with progress_bar("calibrating") as advance:
        result = calibrate_gear(logs, model, free=free, progress=lambda f: advance(0.3 * f))
        promise = None
        if out is not None:
            promise = _promise(recordings, model, result, free)
        advance(1.0)
    if out is not None:
        say(f"set: {write_calibration(out, result, validation=promise, force=force)}")
    if report is not None:
        say(f"report: {page(result, date, report, force=force)}")
    if as_json:
        print_json(result.to_dict() | {"out": None if out is None else str(out)})
    else:
        print_parts(result)
    return 0


def _read(paths: Sequence[Path], column_map: Path | None) -> dict[str, Recording]:
    recordings: dict[str, Recording] = {}
    for path in paths:
        if path.name in recordings:
            raise InputError(f"two logs are named {path.name}; give them different names")
        recordings[path.name] = read_recording(path, column_map)
    return recordings


def _promise(
    recordings: dict[str, Recording],
    model: Actuator,
    result: PartsCalibration,
    free: Sequence[str] | None,
) -> Validation | None:
    """Thresholds of the set, from motions held out where there are several."""
    from elevon.calibrate.gear.held_out import held_out_motions

    try:
        promise, apart = held_out_motions(recordings, model, result.actuator, free=free)
    except InputError as error:
        say(f"no thresholds: {error}")
        return None
    if not apart:
        say("thresholds: from the fit itself, since no motion could be held out")
    return promise


def page(result: PartsCalibration, date: str | None, path: Path, *, force: bool) -> Path:
    import elevon
    from elevon.calibrate.parts_page import parts_report

    shown = parts_report(result, provenance={"Elevon": elevon.__version__}, date=date)
    return shown.save(path, force=force)


def print_parts(result: PartsCalibration) -> None:
    print_table(
        ("parameter", "before", "after", "low", "high", "unit", "holds for"),
        [
            (
                item.path,
                "" if item.old is None else f"{item.old:.5g}",
                f"{item.value:.5g}",
                f"{item.interval[0]:.5g}",
                f"{item.interval[1]:.5g}",
                item.unit,
                ", ".join(item.given),
            )
            for item in result.estimates
        ],
    )
    for reason in dict.fromkeys(result.undetermined.values()):
        names = [path for path, why in result.undetermined.items() if why == reason]
        shown = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
        say(f"not determined: {shown}: {reason}")
