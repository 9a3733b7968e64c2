"""The doors `elevon.calibrate` and `elevon.validate`: logs and records choose the way.

Each subsystem is identified from what was measured at its input and at its output
(`subsystems.flow`). An actuator with a control unit of its own, a servo with a preloaded screw that
its logs weigh, a turning output with set point and both positions logged have further balances.
Logs that show a command but not the law that follows it are fitted in closed loop.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from elevon.actuator import Actuator
from elevon.calibrate.drops import is_drop_table, run_drops
from elevon.calibrate.outcome import Calibration
from elevon.calibrate.validation import Validation
from elevon.calibrate.ways import (
    CalibrationRequest,
    ValidationRequest,
    calibrate_any,
    validate_any,
)
from elevon.logs.read import LogsLike, as_logs
from elevon.option import Option
from elevon.progress import Progress
from elevon.simulate.prepare import ActuatorLike, as_actuator


def calibrate(
    logs: LogsLike,
    actuator: ActuatorLike,
    free: Sequence[str] | None = None,
    *,
    per_log: Annotated[Sequence[str], Option(metavar="PATH")] = (),
    fidelity: str | None = None,
    transient: float | None = None,
    promise: bool = False,
    torque_constant: str | float | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """Estimate what logs determine of an actuator.

    Parameters
    ----------
    logs : Log, path, or sequence of them
        Of one unit; or the file of a table of hung weights. `elevon.read_log` reads a log whose
        columns need a map.
    actuator : Actuator, str or path
        Values before; those that are not estimated stay.
    free : sequence of str, optional
        Paths to estimate; default: all that the logs determine.
    per_log : sequence of str
        Estimated for each log too, such as ``backlash.total``; only where both positions were
        logged.
    fidelity : str, optional
        Of the model runs, ``low`` or ``high``; default: low, or what the logs bear.
    transient : float, optional
        Left out at the beginning of each log [s].
    promise : bool
        Whether logs are held out in turn: what an actuator file takes its thresholds from.
    torque_constant : str or float, optional
        Torque at the motor for one unit of the logs' effort (``0.11 N m/A``), or force at a linear
        output (``35.15 N/V``): the scale of inertia, friction and load. Default: the actuator's.
    progress : callable, optional
        Called with the done fraction; returns False to stop.

    Returns
    -------
    Calibration
        Its ``actuator`` has the values.

    Raises
    ------
    InputError
        A log that cannot be read, nothing determined, or not what was requested.
    Interrupted
        `progress` returned False.
    """
    model = as_actuator(actuator)
    table = logs[0] if isinstance(logs, (list, tuple)) and len(logs) == 1 else logs
    if isinstance(table, (str, os.PathLike)) and is_drop_table(Path(table)):
        return run_drops(Path(table), model)
    request = CalibrationRequest(
        model, free, per_log, fidelity, transient, promise, torque_constant, progress
    )
    return _refused(calibrate_any(as_logs(logs), request))


def _refused(result: Calibration) -> Calibration:
    """Say what a fidelity refuses of the values that were fitted: the fit runs one of them."""
    texts = []
    for fidelity in ("high", "low"):
        before = {str(f["path"]) for f in _errors(result.before, fidelity)}
        texts += [
            f"the {fidelity} fidelity refuses what was fitted: {finding['message']}"
            for finding in _errors(result.actuator, fidelity)
            if finding["path"] not in before
        ]
    return replace(result, findings=(*result.findings, *texts)) if texts else result


def _errors(actuator: Actuator, fidelity: str) -> list[Mapping[str, object]]:
    return [f for f in actuator.findings(fidelity) if f.get("severity", "error") == "error"]


def validate(
    logs: LogsLike,
    actuator: ActuatorLike,
    *,
    fidelity: str = "low",
    transient: float | None = None,
    progress: Progress | None = None,
) -> Validation:
    """Hold an actuator against logs that it was not fitted to, signal by signal.

    Parameters
    ----------
    logs : Log, path, or sequence of them
        As `calibrate`.
    actuator : Actuator, str or path
        The model; thresholds and the sensors' offsets from its ``[validation]`` table.
    fidelity : str
        ``low`` or ``high``.
    transient : float, optional
        Left out at the beginning of each log [s]; default: the actuator file's.
    progress : callable, optional
        Called with the done fraction; returns False to stop.

    Raises
    ------
    InputError
        A log that cannot be compared, a transient longer than a log.
    """
    model = as_actuator(actuator)
    return validate_any(as_logs(logs), ValidationRequest(model, fidelity, transient, progress))
