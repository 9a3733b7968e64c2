"""How well values fitted without some data predict just these data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Bools, Floats
from elevon.calibrate.balance import torque_balance
from elevon.calibrate.law import controller_law
from elevon.calibrate.plant import controller_estimates, plant_estimates, torque_scale
from elevon.calibrate.speed_runs import SpeedRuns
from elevon.errors import InputError
from elevon.estimate.held_out import held_out as left_out
from elevon.logs.log import Log
from elevon.parameters.relations import static_following
from elevon.plain import Plain, in_unit, key
from elevon.progress import Progress

_OFFSETS = ("sensor.current_offset",)
_LAST = 0.25  # of a single log that is kept from the fit


@dataclass(frozen=True)
class HeldOut(Plain):
    """Error on data kept from the fit.

    Attributes
    ----------
    log : str
        The log.
    span : str
        ``all`` of it, or its ``last quarter``.
    speed, current : float
        RMS error of the model runs [rad/s, A].
    speed_all, current_all : float
        The same with the values fitted to everything.
    """

    log: str
    span: str
    speed: Annotated[float, key("speed_rms"), in_unit("rad/s")]
    current: Annotated[float, key("current_rms"), in_unit("A")]
    speed_all: Annotated[float, key("speed_rms_all_data"), in_unit("rad/s")]
    current_all: Annotated[float, key("current_rms_all_data"), in_unit("A")]


def held_out(
    logs: Sequence[Log], before: Actuator, fitted: Actuator, progress: Progress | None
) -> tuple[HeldOut, ...]:
    """Refit without each log in turn, or without the last quarter of a single one."""
    parts, spans = list(logs), ["all"] * len(logs)
    if len(logs) == 1:
        late = logs[0].time > (1.0 - _LAST) * logs[0].duration
        parts, spans = [logs[0].counting(late), logs[0].counting(~late)], ["last quarter"]

    def judge(log: Log, values: dict[str, float], _share: Progress | None) -> HeldOut | None:
        return _errors(log, values, fitted)

    rows = left_out(parts, lambda others: _refitted(others, before, fitted), judge, progress)
    pairs = zip(spans, rows, strict=False)
    return tuple(replace(row, span=span) for span, (_, row) in pairs if row is not None)


def _refitted(some: Sequence[Log], before: Actuator, fitted: Actuator) -> dict[str, float]:
    """Values of the regressions on some logs, and the sensors' offsets."""
    plant = torque_balance(some)
    law = controller_law(some, 0.0 if plant is None else plant["lag"])
    if plant is None or law is None:
        raise InputError("the logs move too little for both regressions")
    torque = torque_scale(fitted, plant)
    estimates, followed = plant_estimates(before, plant, torque)
    estimates += controller_estimates(before, law, torque, [log.name for log in some])
    values = dict(followed) | {
        item.path: item.value for item in estimates if item.in_set and item.value > 0.0
    }
    dynamic = values.get("friction.dynamic", fitted.parameters.value("friction.dynamic"))
    values["friction.static"] = static_following(fitted.parameters, dynamic)
    values["control.torque_constant"] = torque.believed
    offsets = {i.path: i.value for i in estimates if i.path in _OFFSETS}
    return values | offsets


def _errors(log: Log, values: dict[str, float], fitted: Actuator) -> HeldOut | None:
    """RMS errors of speed and current, by these values and by those fitted to everything."""
    known = (fitted.validation or {}).get("offsets", {})
    offsets = {path: values[path] for path in _OFFSETS if path in values}
    offsets["sensor.speed_offset"] = known.get("motor_speed", 0.0)
    errors = []
    for (run,) in SpeedRuns(fitted, [log], tied=False).simulate([values | offsets, offsets]):
        if run is None:
            return None
        errors += [_rms(run.speed - log.speed, log.good), _rms(run.current - log.current, log.good)]
    return HeldOut(log.name, "", *errors)


def _rms(error: Floats, mask: Bools) -> float:
    return float(np.sqrt(np.mean(error[mask] ** 2)))
