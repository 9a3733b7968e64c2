"""How well values fitted without some data predict just these data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.calibrate.balance import torque_balance
from elevon.calibrate.law import controller_law
from elevon.calibrate.log import BenchLog
from elevon.calibrate.plant import controller_estimates, plant_estimates, torque_scale
from elevon.calibrate.problem import Problem
from elevon.errors import Interrupted
from elevon.parameters.relations import static_following
from elevon.progress import Progress

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["HeldOut", "held_out"]

Bools = npt.NDArray[np.bool_]
_LAST = 0.25  # of a single log that is kept from the fit


@dataclass(frozen=True)
class HeldOut:
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
    speed: float
    current: float
    speed_all: float
    current_all: float

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain types."""
        return {
            "log": self.log,
            "span": self.span,
            "speed_rms": self.speed,
            "current_rms": self.current,
            "speed_rms_all_data": self.speed_all,
            "current_rms_all_data": self.current_all,
        }


def held_out(
    logs: Sequence[BenchLog],
    keeps: Sequence[Bools],
    before: Actuator,
    fitted: Actuator,
    progress: Progress | None,
) -> tuple[HeldOut, ...]:
    """Refit without each log in turn, or without the last quarter of a single one."""
    errors = []
    for k, log in enumerate(logs):
        if progress is not None and not progress(k / len(logs)):
            raise Interrupted("calibration stopped")
        if len(logs) > 1:
            train = [keep & (j != k) for j, keep in enumerate(keeps)]
            test, span = keeps[k], "all"
        else:
            late = log.time > (1.0 - _LAST) * log.duration
            train, test, span = [keeps[0] & ~late], keeps[0] & late, "last quarter"
        row = _one(logs, train, k, test, span=span, before=before, fitted=fitted)
        if row is not None:
            errors.append(row)
    return tuple(errors)


def _one(
    logs: Sequence[BenchLog],
    train: Sequence[Bools],
    k: int,
    test: Bools,
    *,
    span: str,
    before: Actuator,
    fitted: Actuator,
) -> HeldOut | None:
    others = [j for j in range(len(logs)) if train[j].any()]
    some, masks = [logs[j] for j in others], [train[j] for j in others]
    plant = torque_balance(some, masks)
    law = controller_law(some, masks, 0.0 if plant is None else plant["lag"])
    if plant is None or law is None:
        return None
    torque = torque_scale(fitted, plant)
    estimates, followed = plant_estimates(before, plant, torque)
    estimates += controller_estimates(before, law, torque, [log.name for log in some])
    values = dict(followed) | {
        item.path: item.value for item in estimates if item.in_set and item.value > 0.0
    }
    dynamic = values.get("friction.dynamic", fitted.parameters.value("friction.dynamic"))
    values["friction.static"] = static_following(fitted.parameters, dynamic)
    values["control.torque_constant"] = torque.believed
    offsets = {i.path: i.value for i in estimates if i.path == "sensor.current_offset"}
    known = (fitted.validation or {}).get("offsets", {})
    offsets["sensor.speed_offset"] = known.get("motor_speed", 0.0)
    problem = Problem(fitted, [logs[k]], tied=False, masks=[test])
    runs = problem.simulate([values | offsets, offsets])
    pairs = []
    for (run,) in runs:
        if run is None:
            return None
        pairs.append(
            (_rms(run.speed - logs[k].speed, test), _rms(run.current - logs[k].current, test))
        )
    (speed, current), (speed_all, current_all) = pairs
    return HeldOut(logs[k].name, span, speed, current, speed_all, current_all)


def _rms(error: npt.NDArray[np.float64], mask: Bools) -> float:
    return float(np.sqrt(np.mean(error[mask] ** 2)))
