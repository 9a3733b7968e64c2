"""What the closed loop may free: parameters of the servo, and delays and offsets of the log."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from elevon.actuator import Actuator
from elevon.calibrate.stages.closed_loop.log import NAMES, recorded_roles, sigma, unsigned
from elevon.calibrate.stages.log import motor_ratio
from elevon.errors import unknown
from elevon.estimate import Free
from elevon.logs.log import Log

STRUCTURES = ("cascade", "pid")
_LATEST = 2e-2  # s, lag of a current loop
#: Static over dynamic friction: the fit's own variable, so that rest never holds less.
STICK = "friction.stick"
#: Friction per torque of the motor, where the law knows of it.
LOAD_SHARE = "friction.load_motor"
#: Of the current loop: its lag stands for all that the drive waits.
CURRENT_GAIN = "pwm.proportional_gain"
_SECONDS = (False, "s", "sensor")  # of a delay: no logarithm, unit, register


def in_set(path: str) -> bool:
    """Whether an actuator file has a place for it."""
    return not path.startswith("sensor.") or not path.endswith(("_delay", "_offset", "_lag"))


def free_list(
    actuator: Actuator, logs: Sequence[Log], structure: str, starts: Mapping[str, float]
) -> list[Free]:
    """List what the logs may determine of a servo under one structure of its controller.

    `starts` are first values from the signals; what is not there starts from the actuator file.
    """
    channels = {NAMES[role] for log in logs for role in recorded_roles(log)}
    items = [*_plant(actuator), *_controller(actuator, structure)]
    items += [*_current_loop(actuator), *_limits(channels)]
    return [_started(item, actuator, starts) for item in items] + _logger_rows(logs, channels)


def asked_for(free: Sequence[Free], names: Sequence[str]) -> list[Free]:
    """Return what was requested by name, with the logger's own delays and offsets.

    Static friction is fitted as its share of the dynamic one, which goes with it.

    Raises
    ------
    InputError
        A name that the closed loop does not free.
    """
    paths = ["friction.static" if item.path == STICK else item.path for item in free]
    for name in names:
        if name not in paths:
            raise unknown("--free, in closed loop", name, paths)
    chosen = set(names) | ({"friction.dynamic", STICK} if "friction.static" in names else set())
    return [item for item in free if item.path in chosen or not in_set(item.path)]


def _row(path: str, unit: str, register: str, spread: float, bounds: tuple[float, float]) -> Free:
    return Free(path, math.nan, spread, *bounds, True, unit, register)


def _plant(actuator: Actuator) -> list[Free]:
    linear = actuator.wiring == "ballscrew"
    rows = [
        _row("motor.inertia", "kg m2", "plant", 1.5, (1e-9, 1e3)),
        _row("friction.dynamic", "N m", "plant", 1.5, (1e-7, 1e4)),
        _row(STICK, "1", "plant", 0.3, (1.0, 5.0)),
        _row("friction.reverse_scale", "1", "plant", 0.2, (0.1, 10.0)),
        _row("friction.viscous", "N m s/rad", "plant", 2.0, (1e-9, 1e3)),
    ]
    if str(actuator.parameters["friction.law"].value) == "load_dependent":
        rows.append(_row(LOAD_SHARE, "1", "plant", 1.0, (1e-3, 0.9)))
    weight = _torque_scale(actuator) * motor_ratio(actuator)
    rows.append(
        Free("load.constant", 0.0, weight, -50.0 * weight, 50.0 * weight,
             unit="N" if linear else "N m", register="load")
    )  # fmt: skip
    return rows


def _controller(actuator: Actuator, structure: str) -> list[Free]:
    linear = actuator.wiring == "ballscrew"
    if structure == "pid":
        return [
            _row("control.pid_gain", "N" if linear else "N m/rad", "controller", 2.0, (1e-6, 1e9)),
            _row("control.pid_integral_time", "s", "controller", 1.5, (1e-3, 1e3)),
            _row("control.pid_derivative_time", "s", "controller", 1.5, (1e-5, 1e2)),
            _row("control.pid_derivative_filter", "1", "controller", 0.7, (1.0, 1e3)),
        ]
    gain = "rad/(m s)" if linear else "1/s"
    return [
        _row("control.position_gain", gain, "controller", 2.0, (1e-3, 1e8)),
        _row("control.speed_gain", "N m s/rad", "controller", 2.0, (1e-9, 1e4)),
        _row("control.integral_time", "s", "controller", 1.5, (1e-3, 1e3)),
        _row("control.speed_limit", "rad/s", "controller", 1.0, (1e-2, 1e5)),
    ]


def _current_loop(actuator: Actuator) -> list[Free]:
    """How late the drive acts (reads, waits, holds), as the lag of its current loop."""
    nominal = actuator.parameters.value(CURRENT_GAIN)
    slowest = actuator.parameters.value("motor.winding_inductance") / _LATEST
    if str(actuator.parameters["drive.kind"].value) != "pwm" or not nominal > slowest:
        return []
    # What waits only adds to the lag that the loop has of its own.
    return [_row(CURRENT_GAIN, "V/A", "controller", 1.0, (slowest, nominal))]


def _limits(channels: set[str]) -> list[Free]:
    rows = [_row("inverter.supply_voltage", "V", "plant", 0.2, (1e-1, 1e5))]
    if "current" in channels:
        rows.insert(0, _row("control.current_limit", "A", "controller", 0.7, (1e-3, 1e5)))
        rows.append(_row("sensor.filter_cutoff", "Hz", "sensor", 1.0, (0.5, 1e5)))
    return rows


def _logger_rows(logs: Sequence[Log], channels: set[str]) -> list[Free]:
    period = max(log.period for log in logs)
    late = max(1.5 * period, 2e-3)
    units = {"position": "", "motor_position": "rad", "speed": "", "motor_speed": "rad/s",
             "current": "A", "voltage": "V"}  # fmt: skip
    rows = []
    for name in sorted(channels):
        rows.append(Free(f"sensor.{name}_delay", 0.5 * period, late, -late, 20.0 * late, *_SECONDS))
        if name in {"speed", "motor_speed"}:
            # Not from zero: there a lag is a delay, to first order.
            rows.append(Free(f"sensor.{name}_lag", period, late, 0.0, 20.0 * late, *_SECONDS))
        role = next(role for role, short in NAMES.items() if short == name)
        size = max(sigma(log, role) for log in logs if log.has(role))
        if size > 0.0 and not any(unsigned(log) for log in logs if name == "current"):
            step = 0.1 * size
            rows.append(
                Free(f"sensor.{name}_offset", 0.0, step, -20.0 * step, 20.0 * step,
                     unit=units[name], register="sensor")
            )  # fmt: skip
    return rows


def _started(item: Free, actuator: Actuator, starts: Mapping[str, float]) -> Free:
    """Give a row its first value and bring it inside its bounds."""
    first = starts.get(item.path)
    if first is None:
        first = 1.1 if item.path == STICK else actuator.parameters.value(item.path)
    if item.log_scale and not first > 0.0:
        first = math.sqrt(item.low * item.high)
    return replace(item, start=min(max(float(first), item.low), item.high))


def _torque_scale(actuator: Actuator) -> float:
    """A torque that means something on the motor shaft: a tenth of what the drive can give."""
    value = actuator.parameters.value
    return max(0.1 * value("control.torque_constant") * value("control.current_limit"), 1e-9)
