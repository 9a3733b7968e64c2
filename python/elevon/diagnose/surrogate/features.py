"""Numbers of one log that the surrogate is given, in a few milliseconds, and their changes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.positions.features import features_of, median
from elevon.diagnose.positions.log import RUN_IN
from elevon.errors import InputError
from elevon.logs.drive import drive_log

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log


#: Keys of `elevon.diagnose.positions.features.FEATURES`, in the surrogate's order.
NAMES = (
    "lost_motion",
    "position_scale",
    "dry_current",
    "viscous_current",
    "inertia_current",
    "brake_current",
    "current_order_1",
    "current_order_2",
    "voltage_per_speed",
    "voltage_per_current",
    "voltage_order_1",
    "voltage_order_2",
    "speed_gain",
    "following_gain",
)
#: Those that change by a share of what the healthy unit shows; the others by a difference.
SCALES = frozenset(
    [
        "dry_current", "viscous_current", "inertia_current", "brake_current", "voltage_per_speed",
        "voltage_per_current", "speed_gain", "following_gain",
    ]
)  # fmt: skip
#: Those that need the voltage.
VOLTAGE = frozenset(name for name in NAMES if name.startswith("voltage"))
_SETTLED = 3.0  # s of the log until the command has begun and is followed
_LEAST = 100  # samples of a fit
_FAR = 8.0  # median deviations


@dataclass(frozen=True, eq=False)
class SurrogateFeatures:
    """What one log shows.

    Attributes
    ----------
    name : str
        The log.
    values : ndarray, shape (k,)
        By `NAMES`, SI; NaN where the log does not give it.
    braked : bool
        Whether a brake of measured torque acted.
    travel, speed : float
        Deviation of the output's position [rad], RMS speed of the motor [rad/s].
    """

    name: str
    values: Floats
    braked: bool
    travel: float
    speed: float


def log_features(log: Log, actuator: Actuator) -> SurrogateFeatures:
    """Compute the features of a log.

    Parameters
    ----------
    log : Log
        Of a drive.
    actuator : Actuator
        Its gear ratio and pole pairs are used, nothing else.

    Raises
    ------
    InputError
        A position or the measured torque current is missing, or nothing moves.
    """
    log = drive_log(log)
    if not log.has("output_position", "motor_position"):
        raise InputError(f"{log.name}: the surrogate needs both positions (r4820, r4821)")
    if not log.has("torque_current"):
        raise InputError(f"{log.name}: the surrogate needs the measured torque current (r78)")
    good = log.good & (log.time >= RUN_IN) & np.isfinite(log.motor) & np.isfinite(log.output)
    top = float(np.abs(log.speed[good]).max()) if good.any() else 0.0
    if top < 1.0:
        raise InputError(f"{log.name}: nothing moves (motor up to {top:.3g} rad/s)")
    value = actuator.parameters.value
    ratio, pole_pairs = value("gear.ratio"), value("motor.pole_pairs")
    features = features_of(
        replace(log, good=good), ratio=ratio, pole_pairs=pole_pairs, emf=1.0, deviations=False,
        shaft=False,
    )  # fmt: skip
    rows = dict(zip(features.names, features.values.tolist(), strict=True))
    for name in ("voltage_order_1", "voltage_order_2"):  # of the log's own EMF, not the actuator's
        if name in rows:
            rows[name] /= abs(rows["voltage_per_speed"])
    rows["following_gain"] = _following(log, good)
    return SurrogateFeatures(
        log.name,
        np.array([rows.get(name, math.nan) for name in NAMES]),
        log.brake.measured,
        float(np.std(log.output)),
        float(np.sqrt(np.mean(log.speed**2))),
    )


def changes(values: Floats, healthy: Floats, floor: Floats) -> Floats:
    """Return what changed against a healthy unit: by a share for `SCALES`, else the difference.

    Parameters
    ----------
    values, healthy : ndarray, shape (..., k)
        By `NAMES`.
    floor : ndarray, shape (k,)
        Least size of what a share is taken of.
    """
    scale = np.array([name in SCALES for name in NAMES])
    size = np.where(scale, np.maximum(np.abs(healthy), floor), 1.0)
    return np.asarray((values - healthy) / size)


def _following(log: Log, good: npt.NDArray[np.bool_]) -> float:
    """Following error over speed set point [s], of a noted sine; NaN without one.

    The command is a sine of nearly the noted frequency: output + following x set point = a sin + b
    cos + c, the frequency by one step of Gauss-Newton. What lies far off (the command's start) is
    left out.
    """
    note = log.note
    frequency = note.parameters.get("frequency") if note and note.waveform == "sine" else None
    if not frequency or not log.has("output_position"):
        return math.nan
    reference = np.abs(log.speed_ref)
    keep = good & (reference < 0.999 * reference.max()) & (log.time > _SETTLED)
    if keep.sum() < _LEAST:
        return math.nan
    centre = log.time[keep] - 0.5 * log.duration
    return _gain(centre, log.output[keep], log.speed_ref[keep], 2.0 * math.pi * frequency)


def _gain(centre: Floats, output: Floats, set_point: Floats, rate: float) -> float:
    scale = float(np.std(set_point)) or 1.0
    rows = np.empty((6, len(centre)))
    rows[0] = set_point / -scale
    np.sin(rate * centre, out=rows[1])
    np.cos(rate * centre, out=rows[2])
    rows[3], rows[4], rows[5] = 1.0, 0.0, output
    gram = rows @ rows.T
    first = _solved(gram, 4)
    rows[4] = centre * (first[1] * rows[2] - first[2] * rows[1])  # by the rate
    gram[4] = gram[:, 4] = rows @ rows[4]
    residual = np.abs(output - _solved(gram, 5) @ rows[:5])
    far = rows[:, residual >= _FAR * median(residual) + 1e-12]
    return float(_solved(gram - far @ far.T, 5)[0]) / scale


def _solved(gram: Floats, count: int) -> Floats:
    """Weights of the first rows that explain the last one, of the products of all."""
    return np.asarray(np.linalg.lstsq(gram[:count, :count], gram[:count, -1], rcond=None)[0])
