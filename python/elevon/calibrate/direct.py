"""First values straight from the signals: torque balance and speed controller by regression.

These start the fit and rank what a log can determine; they carry no interval of their own (noise in
the derivatives biases them a little).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.estimate.regression import huber
from elevon.estimate.signals import integral
from elevon.logs.log import Log

_SLOW = 0.05  # of the highest speed: below it the direction of friction is not sure
_WINDOW = 0.03  # s of the local parabolas that give acceleration


@dataclass(frozen=True)
class DirectEstimate:
    """Regression results per ampere (or absolute where the brake's torque is known).

    Attributes
    ----------
    inertia, viscous, dry : float
        Over the torque constant [A s2/rad, A s/rad, A].
    torque_constant : float or None
        [N m/A], from logs with a load cell.
    proportional, integral, derivative : float
        Speed controller over its torque constant [A s/rad, A/rad, A s2/rad].
    """

    inertia: float
    viscous: float
    dry: float
    torque_constant: float | None
    proportional: float
    integral: float
    derivative: float


def direct_estimate(logs: Sequence[Log]) -> DirectEstimate:
    """Regress the current on motion, brake and control error over all logs."""
    plant = _plant(logs)
    control = _control(logs)
    cell = any(log.brake.measured for log in logs)
    brake = plant[3] if cell else 0.0  # without a cell the next column is the first log's offset
    return DirectEstimate(
        inertia=float(plant[0]),
        viscous=float(plant[1]),
        dry=float(plant[2]),
        torque_constant=1.0 / float(brake) if brake > 0.0 else None,
        proportional=float(control[0]),
        integral=float(control[1]),
        derivative=float(control[2]),
    )


def _smooth(log: Log, values: Floats, order: int) -> Floats:
    from scipy.signal import savgol_filter

    width = max(5, round(_WINDOW / log.period) | 1)
    delta = log.period
    return np.asarray(savgol_filter(values, width, 2, deriv=order, delta=delta), dtype=np.float64)


def _plant(logs: Sequence[Log]) -> Floats:
    rows, targets = [], []
    cell = any(log.brake.measured for log in logs)
    for k, log in enumerate(logs):
        if log.brake.known in {"on", "force"} and len(logs) > 1:
            continue  # an unknown resistive torque: its friction is not the actuator's
        speed = _smooth(log, log.speed, 0)
        keep = log.good & (np.abs(speed) > _SLOW * np.abs(speed).max())
        sign = np.sign(speed)
        columns = [_smooth(log, log.speed, 1), speed, sign]
        if cell:
            columns.append(sign * np.interp(log.time, log.brake.time, log.brake.level))
        columns += [np.full_like(speed, float(j == k)) for j in range(len(logs))]
        rows.append(np.column_stack(columns)[keep])
        targets.append(_smooth(log, log.current, 0)[keep])
    if not rows:
        return np.zeros(4)
    return huber(np.vstack(rows), np.concatenate(targets))[0]


def _control(logs: Sequence[Log]) -> Floats:
    rows, targets = [], []
    for k, log in enumerate(logs):
        error = log.speed_ref - log.speed
        inside = np.abs(log.speed_ref) < 0.999 * saturated_speed(log)
        columns = [_smooth(log, error, 0), integral(log.time, error), _smooth(log, error, 1)]
        columns += [np.full_like(error, float(j == k)) for j in range(len(logs))]
        keep = log.good & inside
        rows.append(np.column_stack(columns)[keep])
        targets.append(_smooth(log, log.current, 0)[keep])
    return huber(np.vstack(rows), np.concatenate(targets))[0]


def saturated_speed(log: Log) -> float:
    """Level at which the set point is held flat [rad/s]; infinite where it never is."""
    top = float(np.abs(log.speed_ref).max())
    flat = np.abs(log.speed_ref) > top * (1.0 - 1e-4)
    return top if top > 0.0 and int(flat.sum()) >= 20 else float("inf")
