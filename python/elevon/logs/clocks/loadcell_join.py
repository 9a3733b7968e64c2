"""The load cell's file joined to a drive trace, on the drive's clock."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.logs.clocks.clock_fit import RESONATOR_STD, RESONATOR_TOLERANCE, clock_quality
from elevon.logs.clocks.sync import ClockFit, align_clocks, find_trigger
from elevon.logs.command.note import CommandNote
from elevon.logs.formats.loadcell import LoadCellLog, read_loadcell
from elevon.logs.formats.table import Limits
from elevon.logs.report import ImportReport
from elevon.recording import Recording


def join_loadcell(
    recording: Recording,
    path: str | Path,
    note: CommandNote | None,
    report: ImportReport,
    limits: Limits,
    *,
    gear_ratio: float | None,
) -> Recording:
    """Add the load cell's channels on a clock of their own, moved to the drive's time.

    Parameters
    ----------
    recording : Recording
        The drive's trace on the clock ``drive``.
    path : path
        The load cell's file.
    note : CommandNote or None
        Gives the arm, and the chain's ratio.
    report : ImportReport
        Findings and the synchronisation are added to it.
    limits : Limits
        Bounds on size.
    gear_ratio : float or None
        Motor over output, where it is known.

    Returns
    -------
    Recording
        With ``load_cell_force`` and, where the arm is known, ``load_cell_torque``.
    """
    log = read_loadcell(path, limits=limits)
    for text in log.notes:
        report.say("load_cell", "format", text)
    quality = clock_quality(str(path), log.time)
    if quality.duplicates:
        report.say("load_cell", "duplicates-cell", quality.duplicates)
    for gap in quality.gaps[:20]:
        report.say("load_cell", "gap-cell", *gap)
    time, value = log.time[quality.keep], log.value[quality.keep]
    choices = _shared(recording, gear_ratio, note)
    fit = _synchronise(recording, choices, time, value, report)
    moved = time if fit is None else fit.to_first(time)
    facts = quality.to_dict()
    report.clocks["load_cell"] = {
        name: facts[name] for name in facts if name not in {"period_s", "jitter_max_s"}
    }
    _check_overlap(recording, moved, report)
    values, units = _channels(log, value, note, report)
    cell = Recording.build(moved, values, units, clock="load_cell", rate=quality.rate)
    both = recording.joined(cell)
    measured = "load_cell_torque" if "load_cell_torque" in cell else "load_cell_force"
    return both.with_meta(roles={**recording.roles, "load_cell": measured})


def _synchronise(
    recording: Recording,
    choices: list[Floats],
    time: Floats,
    value: Floats,
    report: ImportReport,
) -> ClockFit | None:
    drive = recording.clocks["drive"].time
    edge = None
    if "trigger" in recording.roles:
        edge = find_trigger(drive, recording.role("trigger").values)
        if edge is not None and edge.later:
            report.say("trigger", "more-edges", edge.later)
    try:
        if not choices:
            raise InputError("synchronisation: the log holds no current, no speed, no positions")
        fit = align_clocks(drive, choices[0], time, value, edge=edge, alternatives=choices[1:])
    except InputError as error:
        if edge is None:
            report.say("load_cell", "not-synchronised", error)
            report.synchronisation = {"method": "none"}
            return None
        report.say("load_cell", "trigger-alone", error)
        fit = ClockFit(edge.time, edge.std, 0.0, math.inf, "trigger", math.nan)
    _fit_findings(fit, report)
    report.synchronisation = {
        "method": fit.method,
        "offset_s": fit.offset,
        "offset_std_s": fit.offset_std,
        "drift": fit.drift,
        "drift_std": _finite(fit.drift_std),
        "explained": _finite(fit.explained),
        "residual_s": _finite(fit.residual) if edge is not None else None,
        "residual_std_s": _finite(fit.residual_std) if edge is not None else None,
    }
    return fit


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _fit_findings(fit: ClockFit, report: ImportReport) -> None:
    """Say what the two logs could not settle."""
    if fit.refused is not None:
        report.say("load_cell", "drift-unknown", *fit.refused, RESONATOR_STD)
    elif not math.isfinite(fit.drift_std):
        report.say("load_cell", "drift-undetermined")
    if abs(fit.drift) - 2.0 * fit.drift_std > RESONATOR_TOLERANCE:
        report.say("load_cell", "drift-large", fit, RESONATOR_TOLERANCE)
    if fit.set_aside is not None:
        report.say("load_cell", "offset-assumed", fit)


def _shared(
    recording: Recording, gear_ratio: float | None, note: CommandNote | None
) -> list[Floats]:
    """Return the sets of signals that may show what the load cell saw.

    A brake acts on the motor shaft, weights and springs on the output: these show in what they
    wind up between the two positions. Where the operator says whether the brake was on, only one
    of them is meant.
    """
    brake = _braked(recording)
    wound = []
    if gear_ratio and {"motor_position", "output_position"} <= recording.roles.keys():
        motor, output = (recording.role(f"{name}_position").values for name in ("motor", "output"))
        wound.append((motor / gear_ratio - output)[:, None])
    if brake and wound and note is not None and note.brake is not None:
        return brake if note.brake else wound
    return [*brake, *wound]


def _braked(recording: Recording) -> list[Floats]:
    """Return the sets of signals that show a brake's torque on the motor shaft.

    What is left of the motor's torque when friction and inertia took their share: torque current,
    direction of motion, speed and acceleration. Without the last two a brake that turns its sign
    with the motion would seem early by the angle by which the accelerating current leads. A load
    cell that shows a size alone follows the same four times the direction of motion; where the
    shaft hardly moves, the current's size.
    """
    names = [name for name in ("torque_current", "current_ref") if name in recording.roles]
    current = [recording.role(name).values for name in names[:1]]
    sets = [np.column_stack((i, np.abs(i))) for i in current]
    speed = _speed(recording)
    size = 0.0 if speed is None else float(np.nanstd(speed))
    if speed is None or not size > 0.0:
        return sets
    direction = np.tanh(speed / (0.1 * size))
    rate = np.gradient(speed, recording.clocks["drive"].time)
    signed = np.column_stack((*current, direction, speed, rate))
    return [signed, signed * direction[:, None], *sets]


def _speed(recording: Recording) -> Floats | None:
    if "motor_speed" in recording.roles:
        return recording.role("motor_speed").values
    if "motor_position" not in recording.roles:
        return None
    position = recording.role("motor_position").values
    return np.asarray(np.gradient(position, recording.clocks["drive"].time), dtype=np.float64)


def _check_overlap(recording: Recording, time: Floats, report: ImportReport) -> None:
    drive = recording.clocks["drive"].time
    outside = float(np.mean((time < drive[0]) | (time > drive[-1])))
    if outside == 1.0:
        report.say("load_cell", "no-overlap")
    elif outside > 0.0:
        report.say("load_cell", "overlap", 100 * outside)


def _channels(
    log: LoadCellLog, value: Floats, note: CommandNote | None, report: ImportReport
) -> tuple[dict[str, Floats], dict[str, str]]:
    if log.unit == "N m":
        return {"load_cell_torque": value}, {"load_cell_torque": "N m"}
    values, units = {"load_cell_force": value}, {"load_cell_force": "N"}
    if note is None or note.load_cell_arm is None:
        report.say("load_cell", "no-arm")
        return values, units
    factor = note.load_cell_arm / (note.chain_ratio or 1.0)
    values["load_cell_torque"], units["load_cell_torque"] = value * factor, "N m"
    shaft = "the motor shaft" if note.chain_ratio else "the shaft the arm belongs to"
    report.say("load_cell_torque", "torque", factor, shaft)
    return values, units
