"""Parameters of an actuator from bench logs."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence

import numpy as np

from elevon.actuator import Actuator
from elevon.calibrate.acceptance import shortened, undetermined, with_values
from elevon.calibrate.backlashes import PER_LOG
from elevon.calibrate.direct import saturated_speed
from elevon.calibrate.dynamic import Dynamic
from elevon.calibrate.findings import amplitude_findings, plant_findings
from elevon.calibrate.heldout import held_out
from elevon.calibrate.outcome import Calibration, by_path, log_facts
from elevon.calibrate.stages.context import run_stages
from elevon.calibrate.stages.signals import DRIVE_STAGES, DriveContext
from elevon.errors import InputError, unknown
from elevon.logs.drive import drive_log
from elevon.logs.log import Log
from elevon.parameters.records import record_of
from elevon.progress import Progress, part
from elevon.threads import one_blas_thread

_RUN_IN = 1.0  # s at least before a log counts
_RUNS = 0.35  # of the work: where model runs begin
_SETTLED = 0.5  # s after the set point has left its limit for the first time


@one_blas_thread()
def calibrate(
    logs: Sequence[Log],
    actuator: Actuator,
    *,
    free: Sequence[str] | None = None,
    per_log: Sequence[str] = (),
    fidelity: str = "low",
    transient: float | None = None,
    hold_out: bool = True,
    model_runs: bool = True,
    progress: Progress | None = None,
) -> Calibration:
    """Estimate what the logs determine.

    Parameters
    ----------
    logs : sequence of Log
        Of a drive, as `elevon.read_log` reads them.
    actuator : Actuator
        Values before; those that are not estimated stay.
    free : sequence of str, optional
        Parameter paths to estimate; default: all that the logs determine.
    per_log : sequence of str
        Of `elevon.calibrate.backlashes.PER_LOG`: estimated for each log too, as ``PATH[LOG]``.
    fidelity : str
        Of the model runs: ``low`` or ``high``.
    transient : float, optional
        Seconds left out at the beginning of each log; default: until the set point has left its
        limit for the first time.
    hold_out : bool
        Whether to refit without each log in turn (without the end of a single log).
    model_runs : bool
        Whether to rank and fit on model runs too: for what the regressions cannot see, and to name
        what absorbs the model's misfit.
    progress : callable, optional
        Called with the done fraction; returns False to stop.

    Returns
    -------
    Calibration

    Raises
    ------
    InputError
        No log, an unknown path, or a path requested that the logs do not determine.
    Interrupted
        `progress` returned False.
    """
    begin = clock.perf_counter()
    if not logs:
        raise InputError("calibration needs at least one log")
    logs = [drive_log(log) for log in logs]
    _check(actuator, logs, free, per_log, fidelity)
    skipped = {log.name: _run_in(log, transient) for log in logs}
    used = [log.counting(log.time >= skipped[log.name]) for log in logs]
    runs = fidelity if model_runs else None
    context = DriveContext(
        logs, actuator, used=used, free=free, per_log=per_log, fidelity=runs, progress=progress
    )
    run_stages(DRIVE_STAGES, context, 0.02, _RUNS)
    estimates, dynamic = context.accepted, context.dynamic
    fitted = with_values(actuator, estimates, context.followed, context.torque, dynamic)
    errors = held_out(used, actuator, fitted, part(progress, 0.8, 1.0)) if hold_out else ()
    context.go(1.0)
    return Calibration(
        actuator=fitted,
        before=actuator,
        logs=log_facts(
            logs, brake={log.name: log.brake.known for log in logs}, skipped_s=skipped,
            warnings={log.name: log.warnings for log in logs},
        ),
        parameters=by_path(estimates),
        facts={**_facts(context), **_of_runs(dynamic), "held_out": errors},
        findings=_findings(context),
        wall_s=clock.perf_counter() - begin,
    )  # fmt: skip


def _facts(context: DriveContext) -> dict[str, object]:
    """What the signals say beside the estimates."""
    groups: dict[str, list[str]] = {}
    for item in context.accepted:
        name = "derived" if item.path.startswith("derived.") else item.register
        groups.setdefault(name, []).append(item.path)
    torque, plant, law = context.torque, context.plant, context.law
    return {
        "registers": groups,
        "torque_constant": {
            "value": torque.constant,
            "from_load_cell": torque.measured,
            "determined": "torque constant and inertia apart"
            if torque.measured
            else "only ratios to the torque constant",
        },
        "followed": context.followed,
        "explained": {
            "torque_balance": plant.explained if plant else None,
            "speed_controller": law.explained if law else None,
        },
        "commands": context.commands,
    }


def _of_runs(dynamic: Dynamic | None) -> dict[str, object]:
    """What the model runs say: which candidates the logs determine, and the fit."""
    ranking = None if dynamic is None else dynamic.ranking
    return {"identifiability": ranking, "simulation_fit": dynamic}


def _findings(context: DriveContext) -> tuple[str, ...]:
    """Everything the calibration has to say."""
    actuator, estimates = context.actuator, context.accepted
    return (
        *context.findings,
        *shortened(actuator, estimates),
        *undetermined(list(context.levels.values()), estimates, context.free),
        *plant_findings(
            context.used, context.plant, context.torque, context.dynamic, actuator,
            estimates=estimates,
        ),
        *amplitude_findings(context.commands, estimates),
    )  # fmt: skip


def _check(
    actuator: Actuator,
    logs: Sequence[Log],
    free: Sequence[str] | None,
    per_log: Sequence[str],
    fidelity: str,
) -> None:
    from elevon.simulate.prepare import check_fidelity

    if actuator.wiring != "rotary":
        raise InputError(
            f"{actuator.name}: drive logs calibrate the wiring 'rotary', not {actuator.wiring!r}"
        )
    check_fidelity(actuator.wiring, fidelity)
    names = [log.name for log in logs]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"two logs are named {name}; give them different names")
    for path in free or ():
        if record_of(actuator.wiring, path, "--free").choices is not None:
            raise InputError(f"--free {path}: is a choice, not a number")
    for path in per_log:
        if path not in PER_LOG:
            raise unknown("--per-log (what one bench changes between its logs)", path, PER_LOG)


def _run_in(log: Log, transient: float | None) -> float:
    """Seconds left out: until the set point has left its limit for the first time, 1 s at least."""
    if transient is not None:
        log.after(transient)
        return transient
    limit = 0.999 * saturated_speed(log)
    limited = np.abs(log.speed_ref) >= limit
    early = np.flatnonzero(limited[: len(limited) // 2])
    first = 0.0
    if early.size:
        after = np.flatnonzero(~limited[early[0] :])
        first = float(log.time[early[0] + after[0]]) + _SETTLED if after.size else 0.0
    return min(max(first, _RUN_IN), 0.5 * log.duration)
