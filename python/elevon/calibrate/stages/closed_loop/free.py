"""What the closed loop may free: parameters of the servo, and delays and offsets of the log."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from elevon.actuator import Actuator
from elevon.calibrate.stages.closed_loop.log import CHANNELS, NAMES, recorded_roles, sigma, unsigned
from elevon.calibrate.stages.log import LOAD_SHARE, motor_ratio
from elevon.data import packaged_toml
from elevon.errors import unknown
from elevon.estimate import Free
from elevon.logs.log import Log
from elevon.parameters.records import records

STRUCTURES = ("cascade", "pid")
_LATEST = 2e-2  # s, lag of a current loop
#: Static over dynamic friction: the fit's own variable, so that rest never holds less.
STICK = "friction.stick"
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
    unseen = () if "current" in channels else ("control.current_limit", "sensor.filter_cutoff")
    items = [*_plant(actuator), *_rows(actuator, structure), *_current_loop(actuator)]
    items += _rows(actuator, "limits", unseen)
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


def _row(actuator: Actuator, path: str, spread: float, low: float, high: float) -> Free:
    record = records(actuator.wiring).get(path)
    unit, register = ("1", "plant") if record is None else (record.unit, record.register)
    return Free(path, math.nan, spread, low, high, True, unit, register)


def _rows(actuator: Actuator, group: str, leave_out: Collection[str] = ()) -> list[Free]:
    """Return the free numbers of a group of ``free.toml``."""
    table = packaged_toml("elevon.calibrate.stages.closed_loop", "free.toml")[group]
    return [_row(actuator, p, *numbers) for p, numbers in table.items() if p not in leave_out]


def _plant(actuator: Actuator) -> list[Free]:
    """Return motor, friction and load."""
    by_load = str(actuator.parameters["friction.law"].value) == "load_dependent"
    weight = _torque_scale(actuator) * motor_ratio(actuator)
    unit = "N" if actuator.wiring == "ballscrew" else "N m"
    return [
        *_rows(actuator, "plant", () if by_load else (LOAD_SHARE,)),
        Free("load.constant", 0.0, weight, -50.0 * weight, 50.0 * weight, unit=unit,
             register="load"),
    ]  # fmt: skip


def _current_loop(actuator: Actuator) -> list[Free]:
    """Return the gain of the current's loop, where a carrier drives it."""
    nominal = actuator.parameters.value(CURRENT_GAIN)
    slowest = actuator.parameters.value("motor.winding_inductance") / _LATEST
    if str(actuator.parameters["drive.kind"].value) != "pwm" or not nominal > slowest:
        return []
    return [_row(actuator, CURRENT_GAIN, 1.0, slowest, nominal)]


def _logger_rows(logs: Sequence[Log], channels: set[str]) -> list[Free]:
    period = max(log.period for log in logs)
    late = max(1.5 * period, 2e-3)
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
                     unit="" if name in {"position", "speed"} else CHANNELS[role].unit,
                     register="sensor")
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
