"""The load cell's file joined to a drive trace, on the drive's clock."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from elevon.bench.loadcell import LoadCellLog, read_loadcell
from elevon.bench.logs.limits import Limits
from elevon.bench.logs.quality import clock_quality
from elevon.bench.logs.report import ImportReport
from elevon.bench.logs.sidecar import CommandNote
from elevon.bench.logs.table import FloatArray
from elevon.bench.sync import ClockFit, align_clocks, find_trigger
from elevon.errors import InputError
from elevon.recording import Recording

__all__ = ["join_loadcell"]

_LEAST_DRIFT_STD = 2e-3  # a drift known worse than this is not applied


def join_loadcell(
    recording: Recording,
    path: str | Path,
    note: CommandNote | None,
    report: ImportReport,
    limits: Limits,
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

    Returns
    -------
    Recording
        With ``load_cell_force`` and, where the arm is known, ``load_cell_torque``.
    """
    log = read_loadcell(path, limits=limits)
    for text in log.notes:
        report.note("load_cell", "format", text)
    quality = clock_quality(str(path), log.time)
    if quality.duplicates:
        report.warn(
            "load_cell", "duplicates", f"{quality.duplicates} repeated time stamps left out"
        )
    for start, end, missing in quality.gaps[:20]:
        report.warn("load_cell", "gap", f"{missing} samples missing, {start:.3f} to {end:.3f} s")
    time, value = log.time[quality.keep], log.value[quality.keep]
    fit = _synchronise(recording, time, value, report)
    moved = time if fit is None else fit.to_first(time)
    report.clocks["load_cell"] = {
        "samples": quality.samples,
        "duration_s": quality.duration,
        "rate_hz": quality.rate,
        "jitter_rms_s": quality.jitter_rms,
        "gaps": [list(gap) for gap in quality.gaps],
        "duplicates": quality.duplicates,
    }
    _check_overlap(recording, moved, report)
    values, units = _channels(log, value, note, report)
    cell = Recording.build(moved, values, units, clock="load_cell", rate=quality.rate)
    return recording.joined(cell)


def _synchronise(
    recording: Recording, time: FloatArray, value: FloatArray, report: ImportReport
) -> ClockFit | None:
    drive = recording.clocks["drive"].time
    edge = None
    if "trigger" in recording:
        edge = find_trigger(drive, recording["trigger"].values)
        if edge is not None and edge.later:
            report.note(
                "trigger", "more-edges", f"{edge.later} changes after the first; the first is used"
            )
    signals = _shared(recording)
    try:
        if signals is None:
            raise InputError("synchronisation: the log holds no current and no speed")
        fit = align_clocks(drive, signals, time, value, edge=edge)
    except InputError as error:
        if edge is None:
            report.warn("load_cell", "not-synchronised", f"{error}; its clock stays its own")
            report.synchronisation = {"method": "none"}
            return None
        fit = ClockFit(edge.time, edge.std, 0.0, math.inf, "trigger", math.nan)
    if fit.drift_std > _LEAST_DRIFT_STD and fit.drift != 0.0:
        report.note(
            "load_cell",
            "drift-unknown",
            f"clock drift {fit.drift:.2e} is known only to {fit.drift_std:.1e}: not applied",
        )
        middle = float(time.mean())
        fit = ClockFit(
            fit.offset + fit.drift * middle if edge is None else fit.offset,
            fit.offset_std,
            0.0,
            fit.drift_std,
            fit.method,
            fit.explained,
        )
    report.synchronisation = {
        "method": fit.method,
        "offset_s": fit.offset,
        "offset_std_s": fit.offset_std,
        "drift": fit.drift,
        "drift_std": fit.drift_std if math.isfinite(fit.drift_std) else None,
        "explained": fit.explained if math.isfinite(fit.explained) else None,
    }
    return fit


def _shared(recording: Recording) -> FloatArray | None:
    """Return what the drive saw of the brake: torque current, its size, direction of motion."""
    columns = []
    for name in ("current_q_meas", "current_ref"):
        if name in recording:
            current = recording[name].values
            columns += [current, np.abs(current)]
            break
    if "motor_speed" in recording:
        speed = recording["motor_speed"].values
        size = float(np.nanstd(speed))
        if size > 0.0:
            columns.append(np.tanh(speed / (0.1 * size)))
    return np.column_stack(columns) if columns else None


def _check_overlap(recording: Recording, time: FloatArray, report: ImportReport) -> None:
    drive = recording.clocks["drive"].time
    outside = float(np.mean((time < drive[0]) | (time > drive[-1])))
    if outside == 1.0:
        report.warn("load_cell", "no-overlap", "no sample falls inside the drive's trace")
    elif outside > 0.0:
        report.note("load_cell", "overlap", f"{100 * outside:.1f} % lies outside the drive's trace")


def _channels(
    log: LoadCellLog, value: FloatArray, note: CommandNote | None, report: ImportReport
) -> tuple[dict[str, FloatArray], dict[str, str]]:
    if log.unit == "N m":
        return {"load_cell_torque": value}, {"load_cell_torque": "N m"}
    values, units = {"load_cell_force": value}, {"load_cell_force": "N"}
    if note is None or note.load_cell_arm is None:
        report.note("load_cell", "no-arm", "arm not stated: force only, no torque")
        return values, units
    factor = note.load_cell_arm / (note.chain_ratio or 1.0)
    values["load_cell_torque"], units["load_cell_torque"] = value * factor, "N m"
    shaft = "the fast shaft" if note.chain_ratio else "the shaft the arm belongs to"
    report.note("load_cell_torque", "torque", f"force x {factor:.6g} m, on {shaft}")
    return values, units
