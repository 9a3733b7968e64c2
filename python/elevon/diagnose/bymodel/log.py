"""A log as diagnosis by the model sees it: what calibration reads, the voltage, the command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.kinematics import command_fit
from elevon.calibrate.log import BenchLog, bench_log
from elevon.calibrate.thin import group_means, groups_of
from elevon.diagnose.bymodel.command import noted_command
from elevon.diagnose.bymodel.features import regress
from elevon.diagnose.bymodel.lost_motion import carried
from elevon.errors import InputError
from elevon.logs.command.reconstruct import reconstruct

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["TestLog", "prepared", "read_test_logs"]

RUN_IN = 1.0  # s left out: the start of the motion
_RATIO = 0.05  # relative: a gear ratio seen in the log this far off is another actuator's
_LEAST_TIME = 4.0  # s of log
_LEAST_LEFT = _LEAST_TIME - RUN_IN  # s of it that can be used
_MOVING = 0.1  # of the highest speed


@dataclass(frozen=True)
class TestLog:
    """A log and what stands beside it.

    Attributes
    ----------
    log : BenchLog
        Positions, speeds, currents, brake.
    voltage : ndarray, shape (n,), or None
        Voltage of the torque axis, as logged [V]; NaN where it is missing.
    gain : (float, float) or None
        Position gain and its deviation [1/s], fitted with the command's waveform; None where no
        waveform explains the command.
    replay : ndarray, shape (n,)
        The command the model is given: the waveform, else rebuilt from set point and position.
    good : ndarray of bool, shape (n,)
        Samples that may be used.
    """

    __test__ = False  # not a test, whatever pytest thinks of the name

    log: BenchLog
    voltage: Floats | None
    gain: tuple[float, float] | None = None
    replay: Floats | None = None
    good: npt.NDArray[np.bool_] | None = None

    @property
    def name(self) -> str:
        """File name."""
        return self.log.name

    @property
    def braked(self) -> bool:
        """Whether a brake of known torque acted."""
        return self.log.brake.measured

    @property
    def brake_unknown(self) -> bool:
        """Whether a brake acted whose torque is not known."""
        return self.log.brake.known in ("force", "on")


def read_test_logs(
    paths: Sequence[str | Path],
    *,
    loadcells: Sequence[str | Path | None] = (),
    commands: Sequence[str | Path | None] = (),
    column_map: str | Path | None = None,
) -> list[TestLog]:
    """Read logs and what stands beside them; errors as `elevon.calibrate.read_logs`."""
    from elevon.logs.importing import import_log

    out, files = [], [Path(path).name for path in paths]
    for k, path in enumerate(paths):
        imported = import_log(
            path,
            column_map=column_map,
            loadcell=loadcells[k] if k < len(loadcells) else None,
            command=commands[k] if k < len(commands) else None,
        )
        log = bench_log(imported)
        if files.count(log.name) > 1:
            log = replace(log, name=f"{Path(path).resolve().parent.name}/{log.name}")
        voltage = None
        if "voltage_q_ref" in imported.recording:
            channel = imported.recording["voltage_q_ref"]
            count = groups_of(np.asarray(channel.time, dtype=np.float64))
            values = group_means(np.array(channel.values, dtype=np.float64), count)
            if len(values) == len(log.time) and np.isfinite(values).sum() > len(values) // 2:
                voltage = values
        out.append(TestLog(log, voltage))
    return out


def prepared(item: TestLog, actuator: Actuator) -> TestLog:
    """Check that a log can be diagnosed, and rebuild its command.

    Raises
    ------
    InputError
        Too short, no motion, motion one way only, no position, or of another actuator.
    """
    log = item.log
    if item.good is not None:
        return item
    if log.output is None or log.motor is None:
        raise InputError(f"{log.name}: diagnosis by the model needs both positions (r4820, r4821)")
    if log.duration < _LEAST_TIME:
        raise InputError(f"{log.name}: lasts {log.duration:.3g} s; {_LEAST_TIME:g} s are needed")
    good = log.good & (log.time >= RUN_IN) & np.isfinite(log.motor) & np.isfinite(log.output)
    left = float(good.mean()) * log.duration
    if left < _LEAST_LEFT:
        raise InputError(
            f"{log.name}: only {left:.2g} s of {log.duration:.3g} s can be used, the rest is "
            f"missing or run-in; {_LEAST_LEFT:g} s are needed"
        )
    _check_motion(log, good, actuator)
    value = actuator.parameters.value
    gain, limit = value("control.position_gain"), value("control.speed_limit")
    trace = reconstruct(log.time, log.speed_ref, log.output, gain=gain, limit=limit)
    if trace.coverage < 0.05:
        raise InputError(f"{log.name}: the speed set point is at its limit; no command is seen")
    rebuilt = np.interp(log.time, log.time[trace.valid], trace.position[trace.valid])
    noted = noted_command(log, limit)
    if noted is not None:
        wave = _joined(log, trace.valid, rebuilt, noted.wave, noted.window)
        return TestLog(log, item.voltage, (noted.gain, noted.gain_std), wave, good)
    fit = command_fit(log, gain, limit)
    if fit is None:
        return TestLog(log, item.voltage, None, rebuilt, good)
    wave = _joined(log, trace.valid, rebuilt, fit.values, fit.waveform.window)
    return TestLog(log, item.voltage, (fit.gain, fit.gain_std), wave, good)


def _joined(
    log: BenchLog,
    valid: npt.NDArray[np.bool_],
    rebuilt: Floats,
    wave: Floats,
    window: tuple[float, float],
) -> Floats:
    """Return the waveform where it explains the log or the set point is cut off; else rebuilt."""
    inside = (log.time >= window[0]) & (log.time <= window[1])
    return np.where(inside | (~valid & (log.time <= window[1])), wave, rebuilt)


def _check_motion(log: BenchLog, good: npt.NDArray[np.bool_], actuator: Actuator) -> None:
    assert log.motor is not None
    assert log.output is not None
    top = float(np.abs(log.speed[good]).max()) if good.any() else 0.0
    count = actuator.parameters.value("gear.ratio") * 1e-3
    if top < 1.0 or float(np.ptp(log.motor[good])) < count:
        raise InputError(
            f"{log.name}: nothing moves (motor up to {top:.3g} rad/s); a jam, an open phase or a "
            "supply that is gone would do that, and more cannot be found without motion"
        )
    for way, text in ((1.0, "forwards"), (-1.0, "backwards")):
        if (good & (way * log.speed > _MOVING * top)).sum() < 100:
            raise InputError(
                f"{log.name}: hardly any motion {text}; friction and backlash need both"
            )
    ratio = actuator.parameters.value("gear.ratio")
    moving = good & (np.abs(log.speed) > _MOVING * top)
    # Past the backlash only, and with the direction beside the position: backlash would tilt the
    # line of a short motion.
    gap = log.motor / ratio - log.output
    past = moving & carried(log.motor / ratio, float(np.ptp(gap[moving])))
    moving = past if past.sum() > 100 else moving
    columns = [log.output[moving], np.sign(log.speed[moving]), np.ones(int(moving.sum()))]
    slope = float(regress(columns, log.motor[moving])[0][0])
    if not abs(slope / ratio - 1.0) < _RATIO:
        raise InputError(
            f"{log.name}: the motor turns {slope:.4g} times as far as the output, {actuator.name} "
            f"has a gear ratio of {ratio:.4g}: a log of another actuator, or another shaft"
        )
