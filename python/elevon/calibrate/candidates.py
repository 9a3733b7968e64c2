"""What can be freed: parameters of the model, and sensor quantities that no actuator file holds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from elevon.calibrate.direct import DirectEstimate, direct_estimate
from elevon.calibrate.log import BenchLog
from elevon.errors import InputError
from elevon.parameters.records import record_of
from elevon.parameters.relations import emf_constant, motor_torque_constant, static_following

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["AUTO", "ParameterCandidate", "candidates", "start_values", "within_inertia"]

#: What `auto` tries to free in the dynamic fit, in the model's own parameters.
AUTO = (
    "friction.dynamic",
    "friction.viscous",
    "friction.static",
    "motor.inertia",
    "motor.emf_constant",
    "control.speed_gain",
    "control.integral_time",
    "control.derivative_time",
    "sensor.filter_cutoff",
)
_FILTER = (2.0, 5000.0)  # Hz
_DELAY = 0.02  # s
_WHOLE = 0.95  # of the inertia that speed gain times derivative time may reach
_FAR = 100.0  # a start further off than this factor is a misfit of the regression
_KNOTS = 4  # of an unknown brake's level over a log


@dataclass(frozen=True)
class ParameterCandidate:
    """One number that the dynamic fit may free.

    Attributes
    ----------
    path : str
        Parameter path, or ``sensor.current_offset``, ``sensor.speed_offset``,
        ``sensor.speed_delay``, ``sensor.load_cell_offset``, ``load.brake[LOG][KNOT]``.
    kind : str
        ``parameter``, ``output`` (acts on a simulated signal) or ``input`` (acts on the brake).
    register : str
        As the core's records, for the report.
    unit : str
        SI.
    log_scale : bool
        Fitted as a logarithm.
    low, high : float
        Bounds.
    size : float
        A meaningful change: of the logarithm, or in SI.
    index : tuple of int
        Log and knot of an input.
    """

    path: str
    kind: str
    register: str
    unit: str
    log_scale: bool
    low: float
    high: float
    size: float
    index: tuple[int, ...] = ()

    def inner(self, value: float) -> float:
        """Return the fitted variable of a value."""
        return math.log(value) if self.log_scale else value

    def outer(self, x: float) -> float:
        """Return the value of a fitted variable."""
        return math.exp(x) if self.log_scale else x


def candidates(
    actuator: Actuator, logs: Sequence[BenchLog], free: Sequence[str] | None
) -> list[ParameterCandidate]:
    """List what may be freed: the caller's paths, or those of `AUTO` that the logs could determine.

    Raises
    ------
    InputError
        An unknown path, a choice, or one the model fixes (gear ratio, solver).
    """
    from elevon.calibrate.kinematics import KINEMATIC

    if free is None:
        paths = [path for path in AUTO if _sensible(path, actuator, logs)]
    else:
        paths = [path for path in free if path not in KINEMATIC]
    items = [_parameter(path, actuator) for path in paths]
    current = max(float(abs(log.current).max()) for log in logs)
    speed = max(float(abs(log.speed).max()) for log in logs)
    if not current > 0.0 or not speed > 0.0:
        raise InputError("the logs hold no motion and no current: nothing can be calibrated")
    offsets = [
        ("sensor.speed_offset", "rad/s", speed, 0.01 * speed),
        ("sensor.speed_delay", "s", _DELAY, 1e-3),
    ]
    if all(log.current_signal == "current_q_meas" for log in logs):
        offsets.insert(0, ("sensor.current_offset", "A", current, 0.01 * current))
    items += [
        ParameterCandidate(path, "output", "sensor", unit, False, -reach, reach, size)
        for path, unit, reach, size in offsets
    ]
    return items + _brakes(logs)


def _brakes(logs: Sequence[BenchLog]) -> list[ParameterCandidate]:
    """Offset of the load cell where another log shows the friction alone; unknown brakes."""
    items = []
    measured = [log for log in logs if log.brake.measured]
    if measured and any(log.brake.known == "off" for log in logs):
        top = max(float(log.brake.level.max()) for log in measured)
        items.append(
            ParameterCandidate(
                "sensor.load_cell_offset", "input", "sensor", "N m", False, -top, top, 0.01 * top
            )
        )
    for k, log in enumerate(logs):
        if log.brake.known in {"on", "force"}:
            items += [
                ParameterCandidate(
                    f"load.brake[{log.name}][{j}]",
                    "input",
                    "load",
                    "N m",
                    False,
                    0.0,
                    100.0,
                    0.1,
                    (k, j),
                )
                for j in range(_KNOTS)
            ]
    return items


def _sensible(path: str, actuator: Actuator, logs: Sequence[BenchLog]) -> bool:
    if path == "motor.emf_constant":
        return any(log.brake.measured for log in logs)
    if path == "sensor.filter_cutoff":
        return all(log.current_signal == "current_q_meas" for log in logs)
    if path in {"control.integral_time", "control.derivative_time"}:
        return actuator.parameters.value(path) > 0.0
    return path in actuator.parameters


def _parameter(path: str, actuator: Actuator) -> ParameterCandidate:
    record = record_of(actuator.wiring, path, "--free")
    if record.choices is not None:
        raise InputError(f"--free {path}: is a choice, not a number")
    if record.register == "solver" or path == "gear.ratio":
        raise InputError(f"--free {path}: belongs to the model's making, not to a log")
    value = actuator.parameters.value(path)
    if path == "sensor.filter_cutoff":
        return ParameterCandidate(
            path, "parameter", record.register, record.unit, True, *_FILTER, 0.3
        )
    if value > 0.0 and record.minimum >= 0.0:
        low = max(record.minimum, 1e-3 * value)
        high = min(record.maximum, 1e3 * value)
        return ParameterCandidate(
            path, "parameter", record.register, record.unit, True, low, high, 0.1
        )
    span = max(1.0, 10.0 * abs(value))
    low, high = max(record.minimum, value - span), min(record.maximum, value + span)
    return ParameterCandidate(
        path, "parameter", record.register, record.unit, False, low, high, 0.01 * span
    )


def start_values(actuator: Actuator, logs: Sequence[BenchLog]) -> dict[str, float]:
    """Return first values in the model's parameters; those that make no sense are left out."""
    starts = direct_estimate(logs)
    kt = starts.torque_constant or motor_torque_constant(actuator.parameters)
    values: dict[str, float] = {}
    if starts.torque_constant is not None:
        flux = actuator.parameters.value("motor.flux_fraction")
        values["motor.emf_constant"] = emf_constant(kt, flux)
    if starts.dry > 0.0:
        values["friction.dynamic"] = kt * starts.dry
        values["friction.static"] = static_following(actuator.parameters, kt * starts.dry)
    if starts.viscous > 0.0:
        values["friction.viscous"] = kt * starts.viscous
    other = _other_inertia(actuator)
    if kt * starts.inertia > 1.05 * other:
        values["motor.inertia"] = kt * starts.inertia - other
    values |= _controller(actuator, starts, kt)
    old = actuator.parameters.value
    near = {p: v for p, v in values.items() if 1.0 / _FAR < v / max(old(p), 1e-12) < _FAR}
    return near | within_inertia(actuator, near)


def _controller(actuator: Actuator, starts: DirectEstimate, kt: float) -> dict[str, float]:
    if not starts.proportional > 0.0:
        return {}
    values = {"control.speed_gain": kt * starts.proportional}
    if starts.integral > 0.0 and actuator.parameters.value("control.integral_time") > 0.0:
        values["control.integral_time"] = starts.proportional / starts.integral
    if starts.derivative > 0.0 and actuator.parameters.value("control.derivative_time") > 0.0:
        values["control.derivative_time"] = starts.derivative / starts.proportional
    return values


def within_inertia(actuator: Actuator, values: Mapping[str, str | float]) -> dict[str, float]:
    """Return a shorter derivative time where gain times it would exceed the inertia, else nothing.

    Such a pair acts like an inertia larger than the real one; a drive with a tick does not bear it.
    """

    def value(path: str) -> float:
        return float(values.get(path, actuator.parameters.value(path)))

    inertia = value("motor.inertia") + value("gear.inertia")
    gain = value("control.speed_gain") * value("control.speed_gain_scale")
    if gain * value("control.derivative_time") < _WHOLE * inertia:
        return {}
    return {"control.derivative_time": _WHOLE * inertia / gain}


def _other_inertia(actuator: Actuator) -> float:
    """Inertia on the motor shaft beside the motor's own."""
    value = actuator.parameters.value
    return value("gear.inertia") + value("load.inertia") / value("gear.ratio") ** 2
