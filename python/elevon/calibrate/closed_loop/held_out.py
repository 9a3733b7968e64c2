"""How well values fitted without a log predict it: the source of thresholds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from elevon.calibrate.closed_loop.fit import Fitted
from elevon.calibrate.closed_loop.free import in_set
from elevon.calibrate.closed_loop.log import LoopLog
from elevon.calibrate.closed_loop.model import LoopModel
from elevon.calibrate.closed_loop.objective import Objective
from elevon.calibrate.closed_loop.predict import predict
from elevon.calibrate.closed_loop.solve import solve
from elevon.calibrate.validation import SignalError, Validation, ValidationTrace
from elevon.errors import InputError, unknown

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["held_out_errors", "validate_loop"]

_UNITS = {
    "position": "m", "motor_position": "rad", "speed": "m/s", "motor_speed": "rad/s",
    "current": "A", "voltage": "V",
}  # fmt: skip
_ROUNDS = 4
TRANSIENT = 1.0  # s: what the first state of a drive decides


def held_out_errors(fitted: Fitted, transient: float = TRANSIENT) -> Validation:
    """Refit without each log in turn (each half of a single one) and predict what was left out.

    The second half of a single log is predicted by its first, and the other way round.
    """
    objective = fitted.objective
    logs = objective.model.logs
    errors: list[SignalError] = []
    traces = []
    for inside, outside in _folds(logs, transient):
        model = LoopModel(
            objective.model.actuator, inside, objective.model.structure, objective.model.check
        )
        part = Objective(model, objective.free)
        part.refresh(fitted.x)
        x = solve(part, fitted.x[None, :], rounds=_ROUNDS)[0].x
        other = Objective(
            LoopModel(model.actuator, outside, model.structure, model.check), objective.free
        )
        for log, run in zip(outside, other.runs(x)[0], strict=True):
            if run is None:
                raise InputError(f"{log.name}: predicted from the others, the run diverges")
            trace = ValidationTrace(log.name, log.time, log.signals, run, log.used)
            traces.append(trace)
            errors += _errors(trace, {}, model.actuator.wiring)
    logger = {
        path.removeprefix("sensor."): value
        for path, value in fitted.values.items()
        if not in_set(path)
    }
    return Validation(
        objective.model.actuator.name, "low", transient, tuple(errors),
        {log.name: "as logged" for log in logs}, tuple(traces), logger,
    )  # fmt: skip


def _folds(logs: Sequence[LoopLog], transient: float) -> list[tuple[list[LoopLog], list[LoopLog]]]:
    late = [log.restricted(log.time >= transient) for log in logs]
    if len(logs) > 1:
        return [([b for j, b in enumerate(late) if j != k], [late[k]]) for k in range(len(late))]
    first = late[0].time < 0.5 * late[0].duration
    halves = late[0].restricted(first), late[0].restricted(~first)
    return [([halves[0]], [halves[1]]), ([halves[1]], [halves[0]])]


def validate_loop(
    logs: Sequence[LoopLog],
    actuator: Actuator,
    transient: float | None = None,
    logger: Mapping[str, float] | None = None,
) -> Validation:
    """Hold a servo against logs in its own closed loop on the recorded demand.

    Parameters
    ----------
    logs : sequence of LoopLog
        Not those of the calibration.
    actuator : Actuator
        Its ``[validation]`` table has the thresholds, and the logger's delays and offsets.
    transient : float, optional
        Seconds left out; default: the actuator file's, else one.
    logger : mapping of str to float, optional
        The logger's delays, lags and offsets (`Validation.offsets`); default: the actuator file's.

    Raises
    ------
    InputError
        A transient longer than a log, a threshold of a channel that is none.
    """
    promised = actuator.validation or {}
    limits = dict(promised.get("limits", {}))
    offsets = dict(promised.get("offsets", {}) if logger is None else logger)
    for name in limits:
        if name not in _UNITS:
            raise unknown("signal", name, _UNITS, f"{actuator.name}: validation.limits")
    given = float(promised.get("transient", TRANSIENT)) if transient is None else transient
    for log in logs:
        if not given < log.duration:
            raise InputError(f"transient of {given:g} s: {log.name} lasts {log.duration:g} s")
    late = [log.restricted(log.time >= given) for log in logs]
    _, runs = predict(late, actuator, {f"sensor.{name}": v for name, v in offsets.items()})
    traces = [
        ValidationTrace(log.name, log.time, log.signals, run, log.used)
        for log, run in zip(late, runs, strict=True)
    ]
    errors = [row for trace in traces for row in _errors(trace, limits, actuator.wiring)]
    return Validation(
        actuator.name, "low", given, tuple(errors), {log.name: "as logged" for log in logs},
        tuple(traces), offsets,
    )  # fmt: skip


def _errors(trace: ValidationTrace, limits: Mapping[str, float], wiring: str) -> list[SignalError]:
    """Error of every channel of one log, in percent as elsewhere."""
    errors = []
    for name, simulated in trace.simulated.items():
        mask = trace.used & np.isfinite(trace.measured[name])
        if not mask.any():
            continue  # a stretch shorter than what settles shows nothing
        data = trace.measured[name][mask]
        off = simulated[mask] - data
        rms, most = float(np.sqrt(np.mean(off**2))), float(np.abs(off).max())
        about, span = float(data.std()), float(np.ptp(data))
        unit = _UNITS[name] if wiring == "ballscrew" else _UNITS[name].replace("m", "rad", 1)
        unit = "rad" if name == "motor_position" else unit
        unit = "rad/s" if name == "motor_speed" else unit
        errors.append(
            SignalError(
                trace.log,
                name,
                unit,
                rms,
                most,
                100.0 * _over(rms, about),
                100.0 * _over(rms, span),
                100.0 * _over(most, span),
                limits.get(name),
            )
        )
    return errors


def _over(value: float, size: float) -> float:
    return value / size if size > 0.0 else float("inf")
