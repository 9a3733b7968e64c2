"""Parameters of an actuator from bench logs."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.calibrate.acceptance import accept, missing, shortened, undetermined, with_values
from elevon.calibrate.backlashes import PER_LOG
from elevon.calibrate.direct import saturated_speed
from elevon.calibrate.dynamic import Dynamic, dynamic_stage
from elevon.calibrate.estimate import Estimate
from elevon.calibrate.findings import amplitude_findings, plant_findings
from elevon.calibrate.heldout import HeldOut, held_out
from elevon.calibrate.kinematics import KINEMATIC, CommandFit
from elevon.calibrate.log import BenchLog
from elevon.calibrate.outcome import Outcome, log_facts
from elevon.calibrate.plant import Torque
from elevon.calibrate.regression import Regression
from elevon.calibrate.signals import CalibrationSignals, signal_stage
from elevon.errors import InputError, Interrupted, unknown
from elevon.parameters.records import record_of
from elevon.progress import Progress, part
from elevon.threads import one_blas_thread

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["Calibration", "calibrate"]

Bools = npt.NDArray[np.bool_]
_RUN_IN = 1.0  # s at least before a log counts
_SETTLED = 0.5  # s after the set point has left its limit for the first time


@dataclass(frozen=True, kw_only=True)
class Calibration(Outcome):
    """The answer; see `elevon.calibrate.outcome.Outcome` for what every answer has.

    What the logs do not determine stands among the findings.

    Attributes
    ----------
    logs : tuple of BenchLog
        The data.
    skipped : dict of str to float
        Seconds left out at the beginning of each log.
    estimates : tuple of Estimate
        Everything estimated; those with `in_set` went into `actuator`.
    followed : mapping of str to float
        Values that had to follow others.
    torque : Torque
        Where the scale of all torques comes from.
    plant, law : Regression or None
        The two regressions.
    commands : tuple of CommandFit
        Commands reconstructed.
    dynamic : Dynamic or None
        Identifiability and the fit of model runs.
    held_out : tuple of HeldOut
        Errors on data that were kept from the fit.
    findings : tuple of str
        What the caller should know, in words.
    """

    logs: tuple[BenchLog, ...]
    skipped: Mapping[str, float]
    followed: Mapping[str, float]
    torque: Torque
    plant: Regression | None
    law: Regression | None
    commands: tuple[CommandFit, ...]
    dynamic: Dynamic | None
    held_out: tuple[HeldOut, ...]
    findings: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        groups: dict[str, list[dict[str, Any]]] = {}
        for item in self.estimates:
            name = "derived" if item.path.startswith("derived.") else item.register
            groups.setdefault(name, []).append(item.to_dict())
        logs = [
            {
                **log_facts(log),
                "brake": log.brake.known,
                "skipped_s": self.skipped[log.name],
                "warnings": list(log.warnings),
            }
            for log in self.logs
        ]
        return {
            **self.head(logs),
            "registers": {name: [i["path"] for i in items] for name, items in groups.items()},
            "torque_constant": {
                "value": self.torque.constant,
                "from_load_cell": self.torque.measured,
                "determined": "torque constant and inertia apart"
                if self.torque.measured
                else "only ratios to the torque constant",
            },
            "followed": dict(self.followed),
            "explained": {
                "torque_balance": self.plant.explained if self.plant else None,
                "speed_controller": self.law.explained if self.law else None,
            },
            "commands": [item.to_dict() for item in self.commands],
            "identifiability": self.dynamic.ranking.to_dict() if self.dynamic else None,
            "simulation_fit": self.dynamic.to_dict() if self.dynamic else None,
            "held_out": [item.to_dict() for item in self.held_out],
            "findings": list(self.findings),
            "wall_s": self.wall_s,
        }


@one_blas_thread()
def calibrate(
    logs: Sequence[BenchLog],
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
    logs : sequence of BenchLog
        From `elevon.calibrate.read_logs`.
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
    _check(actuator, logs, free, per_log, fidelity)
    skipped = {log.name: _run_in(log, transient) for log in logs}
    keeps = [log.good & (log.time >= skipped[log.name]) for log in logs]
    _go(progress, 0.02)
    signals = signal_stage(logs, keeps, actuator, lambda f: _go(progress, 0.02 + 0.33 * f), per_log)
    runs = part(progress, 0.35, 0.8)
    task = _Task(logs, keeps, actuator, signals, free)
    estimates, dynamic = _estimates(task, fidelity if model_runs else None, runs)
    fitted = with_values(actuator, estimates, signals.followed, signals.torque, dynamic)
    errors = held_out(logs, keeps, actuator, fitted, part(progress, 0.8, 1.0)) if hold_out else ()
    findings = _findings(task, estimates, dynamic)
    _go(progress, 1.0)
    return Calibration(
        actuator=fitted,
        before=actuator,
        logs=tuple(logs),
        skipped=skipped,
        estimates=tuple(estimates),
        followed=signals.followed,
        torque=signals.torque,
        plant=signals.plant,
        law=signals.law,
        commands=signals.commands,
        dynamic=dynamic,
        held_out=tuple(errors),
        findings=findings,
        wall_s=clock.perf_counter() - begin,
    )


@dataclass(frozen=True)
class _Task:
    """What is calibrated from what, after the signals."""

    logs: Sequence[BenchLog]
    keeps: Sequence[Bools]
    actuator: Actuator
    signals: CalibrationSignals
    free: Sequence[str] | None


def _estimates(
    task: _Task, fidelity: str | None, progress: Progress | None
) -> tuple[list[Estimate], Dynamic | None]:
    """Estimates of the signals that are accepted, and those of model runs (a fidelity) beside."""
    signals, free = task.signals, task.free
    accepted = accept(signals.estimates, free, task.actuator)
    direct = [p for p in free or () if p in KINEMATIC or p == "motor.emf_constant"]
    missing(direct, accepted, signals.torque)
    dynamic = None
    if fidelity is not None or signals.plant is None or signals.law is None:
        dynamic = dynamic_stage(
            task.logs,
            task.keeps,
            _started(task.actuator, signals, accepted),
            accepted,
            free,
            fidelity=fidelity or "low",
            progress=progress,
        )
    if dynamic is not None:
        by_signals = [item.path for item in signals.estimates if item.path not in (free or ())]
        known = [*by_signals, *(item.path for item in accepted)]
        accepted += dynamic.estimates(task.actuator, known, free)
    missing(free, accepted, signals.torque)
    if not any(item.in_set for item in accepted):
        raise InputError("the logs determine no parameter: nothing in them moves enough")
    return accepted, dynamic


def _findings(
    task: _Task, estimates: Sequence[Estimate], dynamic: Dynamic | None
) -> tuple[str, ...]:
    """Everything the calibration has to say."""
    signals, actuator = task.signals, task.actuator
    return (
        *signals.findings,
        *shortened(actuator, estimates),
        *undetermined(signals.estimates, estimates, task.free),
        *plant_findings(
            task.logs, signals.plant, signals.torque, dynamic, actuator, estimates=estimates
        ),
        *amplitude_findings(signals.commands, estimates),
    )


def _started(
    actuator: Actuator, signals: CalibrationSignals, estimates: Sequence[Estimate]
) -> Actuator:
    """Return what model runs start from: what followed, and branches the signals do not show."""
    none = {item.path: 0.0 for item in estimates if item.in_set and item.value == 0.0}
    return actuator.with_values({**signals.followed, **none}, source="calibration")


def _check(
    actuator: Actuator,
    logs: Sequence[BenchLog],
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


def _run_in(log: BenchLog, transient: float | None) -> float:
    """Seconds left out: until the set point has left its limit for the first time, 1 s at least."""
    if transient is not None:
        if not 0.0 <= transient < log.duration:
            raise InputError(f"transient of {transient:g} s: {log.name} lasts {log.duration:g} s")
        return transient
    limit = 0.999 * saturated_speed(log)
    limited = np.abs(log.speed_ref) >= limit
    early = np.flatnonzero(limited[: len(limited) // 2])
    first = 0.0
    if early.size:
        after = np.flatnonzero(~limited[early[0] :])
        first = float(log.time[early[0] + after[0]]) + _SETTLED if after.size else 0.0
    return min(max(first, _RUN_IN), 0.5 * log.duration)


def _go(progress: Progress | None, fraction: float) -> None:
    if progress is not None and not progress(fraction):
        raise Interrupted("calibration stopped")
