"""`elevon calibrate` where each number comes from the signals that show it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from elevon.cli.closed_loop import read_recording
from elevon.cli.output import print_json, print_table, progress_bar, say
from elevon.errors import ElevonError, InputError
from elevon.number_text import estimate_row

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.calibrate.by_parts import PartsCalibration
    from elevon.calibrate.role_log import CalibrationRoleLog
    from elevon.calibrate.screw import ScrewLog
    from elevon.calibrate.validation import Validation
    from elevon.progress import Progress
    from elevon.recording import Recording

__all__ = ["Way", "calibrate_by_parts", "way_by_parts"]

_LONG = 120.0  # s: a log of temperatures is no log of a motion to be predicted


@dataclass(frozen=True)
class Way:
    """How logs are read, calibrated and predicted.

    Attributes
    ----------
    recordings : mapping of str to Recording
        By name.
    read : callable
        Recording and name to a log by roles.
    calibrate : callable
        As `elevon.calibrate.gear.calibrate_gear`.
    validate : callable
        Recordings by name, actuator and progress to their errors.
    predicted : callable
        Whether a log is one that the model can predict.
    runs : bool
        Whether model runs correct what is read.
    """

    recordings: Mapping[str, Recording]
    read: Callable[[Recording, str], Any]
    calibrate: Callable[..., PartsCalibration]
    validate: Callable[[Mapping[str, Recording], Actuator, Progress | None], Validation]
    predicted: Callable[[Any], bool]
    runs: bool = False


def way_by_parts(
    paths: Sequence[Path], model: Actuator, column_map: Path | None, fidelity: str = "auto"
) -> Way | None:
    """Return how these logs are calibrated by parts, None where another way must serve.

    An actuator with a control unit of its own always is, a servo with a preloaded screw where every
    log shows torque, motion and force on the ram.
    """
    from elevon.calibrate.screw import balanced, preloaded
    from elevon.parameters.records import wirings

    if "position" not in wirings()[model.wiring]["modes"]:
        return _unit_way(_read(paths, column_map), fidelity)
    if not preloaded(model):
        return None
    recordings = _read(paths, column_map)
    return _screw_way(recordings, model) if balanced(list(recordings.values())) else None


def _read(paths: Sequence[Path], column_map: Path | None) -> dict[str, Recording]:
    recordings: dict[str, Recording] = {}
    for path in paths:
        if path.name in recordings:
            raise InputError(f"two logs are named {path.name}; give them different names")
        recordings[path.name] = read_recording(path, column_map)
    return recordings


def _unit_way(recordings: Mapping[str, Recording], fidelity: str) -> Way:
    from functools import partial

    from elevon.calibrate.gear import calibrate_gear, gear_log
    from elevon.calibrate.replay import validate_replay

    def validate(
        some: Mapping[str, Recording], model: Actuator, progress: Progress | None
    ) -> Validation:
        return validate_replay(list(some.items()), model, progress=progress)

    run = partial(calibrate_gear, fidelity=fidelity)
    return Way(recordings, gear_log, run, validate, lambda log: bool(log.moves), runs=True)


def _screw_way(recordings: Mapping[str, Recording], model: Actuator) -> Way:
    from elevon.calibrate.closed_loop import loop_log
    from elevon.calibrate.closed_loop.held_out import validate_loop
    from elevon.calibrate.screw import calibrate_screw, motor_ratio, screw_log

    def validate(
        some: Mapping[str, Recording], model: Actuator, _progress: Progress | None
    ) -> Validation:
        return validate_loop([loop_log(item, name) for name, item in some.items()], model)

    def predicted(log: CalibrationRoleLog) -> bool:
        return log.has("command") and log.duration < _LONG

    def read(recording: Recording, name: str) -> ScrewLog:
        return screw_log(recording, name, motor_ratio(model))

    return Way(recordings, read, calibrate_screw, validate, predicted)


def calibrate_by_parts(
    way: Way,
    model: Actuator,
    *,
    free: Sequence[str] | None,
    out: Path | None,
    report: Path | None,
    as_json: bool,
    force: bool,
    date: str | None,
) -> int:
    """Calibrate, write the set with thresholds from logs held out, print."""
    from elevon.calibrate.write import write_calibration

    logs = {name: way.read(recording, name) for name, recording in way.recordings.items()}
    with progress_bar("calibrating") as advance:
        result = way.calibrate(
            list(logs.values()), model, free=free, progress=lambda f: advance(0.3 * f)
        )
        promise = None if out is None else _promise(way, logs, model, result, free)
        advance(1.0)
    if out is not None:
        say(f"set: {write_calibration(out, result, validation=promise, force=force)}")
    if report is not None:
        say(f"report: {_page(result, date, report, force=force)}")
    if as_json:
        print_json(result.to_dict() | {"out": None if out is None else str(out)})
    else:
        _print(result)
    return 0


def _promise(
    way: Way,
    logs: Mapping[str, Any],
    model: Actuator,
    result: PartsCalibration,
    free: Sequence[str] | None,
) -> Validation | None:
    """Thresholds of the actuator file, from motions held out where there are several."""
    from elevon.calibrate.parts_held_out import held_out_logs

    names = [name for name, log in logs.items() if way.predicted(log)]
    if not names:
        say("no thresholds: no log of a motion to be predicted")
        return None

    def without(name: str) -> Actuator:
        others = [log for other, log in logs.items() if other != name and log.duration < _LONG]
        return way.calibrate(others, model, free=free).actuator

    def validate(name: str, fitted: Actuator, progress: Progress | None) -> Validation:
        return way.validate({name: way.recordings[name]}, fitted, progress)

    try:
        promise, apart = held_out_logs(names, result.actuator, without, validate)
    except ElevonError as error:
        say(f"no thresholds: {error}")
        return None
    if not apart:
        say("thresholds: from the fit itself, since no motion could be held out")
    return promise


def _page(result: PartsCalibration, date: str | None, path: Path, *, force: bool) -> Path:
    import elevon
    from elevon.calibrate.parts_page import parts_report

    page = parts_report(result, provenance={"Elevon": elevon.__version__}, date=date)
    return page.save(path, force=force)


def _print(result: PartsCalibration) -> None:
    print_table(
        ("parameter", "before", "after", "low", "high", "unit", "holds for"),
        [estimate_row(item, result.actuator) for item in result.estimates],
    )
    if fidelity := result.facts.get("fidelity"):
        share = result.facts.get("ripple_share")
        why = "" if share is None else f" (the logs have {share:.2g} of the switching ripple)"
        say(f"balances corrected by runs at --fidelity {fidelity}{why}")
    for reason in dict.fromkeys(result.undetermined.values()):
        names = [path for path, why in result.undetermined.items() if why == reason]
        text = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
        say(f"not determined: {text}: {reason}")
