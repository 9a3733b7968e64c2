"""What can be freed: parameters of the model, and sensor quantities that no actuator file holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from elevon.actuator import Actuator
from elevon.calibrate.direct import DirectEstimate, direct_estimate
from elevon.errors import InputError
from elevon.estimate import Free
from elevon.logs.log import Log
from elevon.parameters.records import record_of
from elevon.parameters.relations import emf_constant, motor_torque_constant, static_following

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


def candidates(actuator: Actuator, logs: Sequence[Log], free: Sequence[str] | None) -> list[Free]:
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
    if all(log.has("torque_current") for log in logs):
        offsets.insert(0, ("sensor.current_offset", "A", current, 0.01 * current))
    items += [
        Free(path, 0.0, size, -reach, reach, unit=unit, register="sensor", kind="output")
        for path, unit, reach, size in offsets
    ]
    return items + _brakes(logs)


def _brakes(logs: Sequence[Log]) -> list[Free]:
    """Offset of the load cell where another log shows the friction alone; unknown brakes."""
    items = []
    measured = [log for log in logs if log.brake.measured]
    if measured and any(log.brake.known == "off" for log in logs):
        top = max(float(log.brake.level.max()) for log in measured)
        items.append(
            Free("sensor.load_cell_offset", 0.0, 0.01 * top, -top, top, unit="N m",
                 register="sensor", kind="input")
        )  # fmt: skip
    items += [
        Free(f"load.brake[{log.name}][{j}]", 0.0, 0.1, 0.0, 100.0, unit="N m", register="load",
             kind="input")
        for log in logs
        if log.brake.known in {"on", "force"}
        for j in range(_KNOTS)
    ]  # fmt: skip
    return items


def _sensible(path: str, actuator: Actuator, logs: Sequence[Log]) -> bool:
    if path == "motor.emf_constant":
        return any(log.brake.measured for log in logs)
    if path == "sensor.filter_cutoff":
        return all(log.has("torque_current") for log in logs)
    if path in {"control.integral_time", "control.derivative_time"}:
        return actuator.parameters.value(path) > 0.0
    return path in actuator.parameters


def _parameter(path: str, actuator: Actuator) -> Free:
    record = record_of(actuator.wiring, path, "--free")
    if record.choices is not None:
        raise InputError(f"--free {path}: is a choice, not a number")
    if record.register == "solver" or path == "gear.ratio":
        raise InputError(f"--free {path}: belongs to the model's making, not to a log")
    value = actuator.parameters.value(path)
    unit, register = record.unit, record.register
    if path == "sensor.filter_cutoff":
        return Free(path, value, 0.3, *_FILTER, True, unit, register)
    if value > 0.0 and record.minimum >= 0.0:
        ends = max(record.minimum, 1e-3 * value), min(record.maximum, 1e3 * value)
        return Free(path, value, 0.1, *ends, True, unit, register)
    span = max(1.0, 10.0 * abs(value))
    ends = max(record.minimum, value - span), min(record.maximum, value + span)
    return Free(path, value, 0.01 * span, *ends, False, unit, register)


def start_values(actuator: Actuator, logs: Sequence[Log]) -> dict[str, float]:
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
