"""A servo on the demands of logs: errors of what it predicts, with values fitted without them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from elevon.actuator import Actuator
from elevon.calibrate.stages.closed_loop.fit import Fitted, parts_apart, refitted
from elevon.calibrate.stages.closed_loop.free import STICK, in_set
from elevon.calibrate.stages.closed_loop.log import CHANNELS, NAMES
from elevon.calibrate.stages.closed_loop.model import LoopModel
from elevon.calibrate.validation import (
    SignalError,
    Validation,
    ValidationTrace,
    promised,
    promised_transient,
)
from elevon.errors import InputError
from elevon.estimate.free import outer
from elevon.logs.log import Log

_ROUNDS = 4
TRANSIENT = 1.0  # s: what the first state of a drive decides


def units_of(wiring: str) -> dict[str, str]:
    """Return name to SI unit of what a log may show."""
    linear = wiring == "ballscrew"
    return {
        item.name: item.unit if linear else item.unit.replace("m", "rad", 1)
        for item in CHANNELS.values()
    }


def traces_of(model: LoopModel, values: Mapping[str, float]) -> list[ValidationTrace]:
    """Run one point on the logs of a model.

    Raises
    ------
    InputError
        A run leaves the finite numbers.
    """
    traces = []
    for log, run in zip(model.logs, model.simulate([values])[0], strict=True):
        if run is None:
            raise InputError(f"{log.name}: the model's run leaves the finite numbers")
        traces.append(ValidationTrace.of(log, run, NAMES))
    return traces


def predict(
    logs: Sequence[Log], actuator: Actuator, logger: Mapping[str, float] | None = None
) -> tuple[list[SignalError], list[ValidationTrace]]:
    """Run a servo on the demands of logs and compare.

    Parameters
    ----------
    logs : sequence of Log
        Held-out data.
    actuator : Actuator
        Calibrated; its own `control.structure` holds.
    logger : mapping of str to float, optional
        Delays and offsets of the logger, ``facts["logger"]`` of the calibration.

    Returns
    -------
    list of SignalError, list of ValidationTrace
        Errors by log and channel, and each log's channels as predicted.

    Raises
    ------
    InputError
        A run leaves the finite numbers.
    """
    model = LoopModel(actuator, logs, str(actuator.parameters["control.structure"].value))
    values = {path: value for path, value in (logger or {}).items() if path != STICK}
    traces = traces_of(model, values)
    units = units_of(actuator.wiring)
    return [row for trace in traces for row in trace.errors(units)], traces


def held_out_errors(fitted: Fitted, transient: float = TRANSIENT) -> Validation:
    """Refit without each log in turn (each half of a single one) and predict what was left out.

    The second half of a single log is predicted by its first, and the other way round.
    """
    model, free = fitted.model, fitted.lanes.free
    late = [log.counting(log.time >= transient) for log in model.logs]
    traces = []
    for others, left in parts_apart(late):
        x = refitted(model.on(others), free, fitted.x, _ROUNDS)
        traces += traces_of(model.on(left), outer(free, x))
    units = units_of(model.actuator.wiring)
    logger = {
        path.removeprefix("sensor."): value
        for path, value in fitted.values.items()
        if not in_set(path)
    }
    return Validation(
        model.actuator.name, "low", transient,
        tuple(row for trace in traces for row in trace.errors(units)),
        {log.name: "as logged" for log in model.logs}, tuple(traces), logger,
    )  # fmt: skip


def validate_loop(
    logs: Sequence[Log],
    actuator: Actuator,
    transient: float | None = None,
    logger: Mapping[str, float] | None = None,
) -> Validation:
    """Hold a servo against logs in its own closed loop on the recorded demand.

    Parameters
    ----------
    logs : sequence of Log
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
    units = units_of(actuator.wiring)
    limits = promised(actuator, "limits", units)
    offsets = promised(actuator, "offsets") if logger is None else dict(logger)
    given = promised_transient(actuator, transient, TRANSIENT)
    late = [log.after(given) for log in logs]
    _, traces = predict(late, actuator, {f"sensor.{name}": v for name, v in offsets.items()})
    return Validation(
        actuator.name, "low", given,
        tuple(row for trace in traces for row in trace.errors(units, limits)),
        {log.name: "as logged" for log in logs}, tuple(traces), offsets,
    )  # fmt: skip
