"""A log as calibration sees it: arrays on one clock, the brake's torque among them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.brake_level import Brake, brake_of
from elevon.calibrate.thin import thinned
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.logs.command.note import CommandNote
    from elevon.logs.importing import ImportedLog
    from elevon.recording import Recording

__all__ = ["BenchLog", "bench_log", "read_logs"]

_LEAST_SAMPLES = 200
_NEEDED = ("speed_ref", "motor_speed")
#: Roles of the torque current, the measured one first, and the signal a model shows for each.
_CURRENTS = {"torque_current": "current_q_meas", "current_ref": "current_ref"}


@dataclass(frozen=True)
class BenchLog:
    """One log, SI, on the drive's clock from zero.

    Attributes
    ----------
    name : str
        The file.
    start : float
        Drive time of the first sample [s].
    time : ndarray, shape (n,)
        Seconds from the first sample.
    speed_ref, speed : ndarray, shape (n,)
        Set point and actual speed of the motor [rad/s].
    current : ndarray, shape (n,)
        Torque current, peak [A].
    current_signal : str
        ``current_q_meas`` or, where no current is measured, ``current_ref``: its set point.
    motor, output : ndarray, shape (n,), or None
        Positions [rad]: motor at the motor shaft, encoder at the output.
    brake : Brake
        What is known of the brake.
    note : CommandNote or None
        What the operator knows.
    good : ndarray of bool, shape (n,)
        Samples at which every needed signal is present.
    warnings : tuple of str
        What the import warned of.
    """

    name: str
    start: float
    time: Floats
    speed_ref: Floats
    speed: Floats
    current: Floats
    current_signal: str
    current_target: Floats
    motor: Floats | None
    output: Floats | None
    brake: Brake
    note: CommandNote | None
    good: npt.NDArray[np.bool_]
    warnings: tuple[str, ...]

    @property
    def period(self) -> float:
        """Median spacing of the samples [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.time[-1])


def read_logs(
    paths: Sequence[str | Path],
    *,
    loadcells: Sequence[str | Path | None] = (),
    commands: Sequence[str | Path | None] = (),
    column_map: str | Path | None = None,
    gear_ratio: float | None = None,
    sidecars: bool = True,
) -> list[BenchLog]:
    """Import logs and make them ready for calibration.

    Parameters
    ----------
    paths : sequence of path
        Logs in any format that `elevon.logs.importing.import_log` reads.
    loadcells, commands : sequence of path or None
        One for each log, or none at all.
    column_map : path, optional
        For foreign columns.
    gear_ratio : float, optional
        Fast over slow.
    sidecars : bool
        Whether files beside a log are looked for.

    Returns
    -------
    list of BenchLog
        In the order given.

    Raises
    ------
    InputError
        No log, two rates, a log that cannot be read or lacks what is needed.
    """
    from elevon.logs.importing import import_log, same_rate

    if not paths:
        raise InputError("calibration needs at least one log")
    imported = []
    for k, path in enumerate(paths):
        cell = loadcells[k] if k < len(loadcells) else None
        note = commands[k] if k < len(commands) else None
        imported.append(
            import_log(
                path,
                column_map=column_map,
                loadcell=cell,
                command=note,
                gear_ratio=gear_ratio,
                sidecars=sidecars,
            )
        )
    same_rate(imported)
    return [bench_log(item) for item in imported]


def bench_log(imported: ImportedLog) -> BenchLog:
    """Take what calibration needs from an imported log, thinned; errors as `read_logs`."""
    recording, report = imported.recording, imported.report
    name = Path(report.source).name
    for needed in _NEEDED:
        if needed not in recording.roles:
            raise InputError(
                f"{name}: no channel has the role {needed}; calibration needs a speed set point, "
                f"the motor's speed and a torque current; roles: "
                f"{', '.join(recording.roles) or 'none'}"
            )
    current_role = next((r for r in _CURRENTS if r in recording.roles), None)
    if current_role is None:
        raise InputError(f"{name}: no torque current; friction cannot be determined")
    clock = recording.role("speed_ref").clock
    start = float(clock.time[0])
    time = np.asarray(clock.time, dtype=np.float64) - start
    if len(time) < _LEAST_SAMPLES:
        raise InputError(f"{name}: {len(time)} samples; calibration needs {_LEAST_SAMPLES}")
    needed_roles = ("speed_ref", "motor_speed", current_role)
    columns = [np.array(recording.role(r).values, dtype=np.float64) for r in needed_roles]
    good = np.asarray(np.isfinite(np.column_stack(columns)).all(axis=1), dtype=np.bool_)
    if good.sum() < _LEAST_SAMPLES:
        raise InputError(f"{name}: {int(good.sum())} samples are complete; {_LEAST_SAMPLES} needed")
    ref, speed, current = (_filled(time, column) for column in columns)
    target = _optional(recording, time, "current_ref")
    log = BenchLog(
        name=name,
        start=start,
        time=time,
        speed_ref=ref,
        speed=speed,
        current=current,
        current_signal=_CURRENTS[current_role],
        current_target=current if target is None else target,
        motor=_optional(recording, time, "motor_position"),
        output=_optional(recording, time, "output_position"),
        brake=brake_of(recording, imported.note, time, start, speed),
        note=imported.note,
        good=good,
        warnings=tuple(f"{f.place}: {f.text}" for f in report.findings if f.level == "warning"),
    )
    return thinned(log)


def _filled(time: Floats, values: Floats) -> Floats:
    """Bridge missing samples by straight lines: for the input only, never for a residual."""
    good = np.isfinite(values)
    return values if good.all() else np.interp(time, time[good], values[good])


def _optional(recording: Recording, time: Floats, role: str) -> Floats | None:
    """Return a role's channel where it stands on the drive's clock and is long enough."""
    if role not in recording.roles:
        return None
    channel = recording.role(role)
    if channel.clock is not recording.role("speed_ref").clock:
        return None
    values = np.array(channel.values, dtype=np.float64)
    return _filled(time, values) if np.isfinite(values).sum() >= _LEAST_SAMPLES else None
