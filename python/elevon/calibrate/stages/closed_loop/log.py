"""A log as the closed loop needs it, and what may be fitted to it: servo, delays, offsets."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.stages.context import LOAD_SHARE, motor_ratio
from elevon.data import packaged_toml
from elevon.errors import InputError, unknown
from elevon.estimate import Free
from elevon.logs.log import Log, bridged, per_log
from elevon.parameters.records import records
from elevon.recording import Recording


#: What a log may show, by role, and what the logger's delays and offsets are named by.
class LoopChannel(NamedTuple):
    """A channel of a servo's loop: short name, signal, first deviation over spread, linear unit."""

    name: str
    signal: str
    first: float
    unit: str


CHANNELS = {
    "output_position": LoopChannel("position", "output_position", 0.03, "m"),
    "motor_position": LoopChannel("motor_position", "motor_position", 0.03, "rad"),
    "output_speed": LoopChannel("speed", "motor_speed", 0.12, "m/s"),
    "motor_speed": LoopChannel("motor_speed", "motor_speed", 0.12, "rad/s"),
    "torque_current": LoopChannel("current", "current_q_meas", 0.4, "A"),
    "torque_voltage": LoopChannel("voltage", "voltage_q_meas", 0.4, "V"),
}
NAMES = {role: channel.name for role, channel in CHANNELS.items()}
_FEWEST = 50  # samples
_NO_SIGN = -0.02  # of the largest current: below it a current has a sign


def loop_log(log: Log | Recording, name: str | None = None) -> Log:
    """Return what the closed loop needs of a log: demand, channels of the motion, and the load.

    Parameters
    ----------
    log : Log or Recording
        With a position command and at least one channel of the motion.
    name : str, optional
        Of a recording's log.

    Raises
    ------
    InputError
        No command, nothing of the motion, too short, time that does not increase, a demand that
        never changes.
    """
    if not isinstance(log, Log):
        log = Log.of(log, str(name))
    if not log.has("command"):
        raise InputError(
            f"{log.name}: no channel has the role 'command': nothing to run the loop on"
        )
    log = log.on("command")
    if len(log.time) < _FEWEST:
        raise InputError(f"{log.name}: {len(log.time)} samples; at least {_FEWEST}")
    if not np.all(np.diff(log.time) > 0.0):
        raise InputError(f"{log.name}: time does not increase")
    if not recorded_roles(log):
        raise InputError(f"{log.name}: nothing of the motion was recorded")
    if not float(np.ptp(log["command"])) > 0.0:
        raise InputError(f"{log.name}: the demand never changes; nothing can be learned from it")
    if log.has("load"):
        log = log.with_channels(load=bridged(log.time, log["load"]))
    return log


def recorded_roles(log: Log) -> list[str]:
    """Return the roles of the motion that a log shows."""
    return [role for role in NAMES if log.has(role)]


def sigma(log: Log, role: str) -> float:
    """Return the spread of a channel about its mean over the samples that count."""
    return float(np.nanstd(log[role][log.good]))


def window(log: Log, begin: float, end: float, settle: float) -> Log:
    """Return a stretch as a log of its own, whose first `settle` seconds do not count."""
    keep = (log.time >= begin) & (log.time <= end)
    first = float(log.time[keep][0])
    part = log.part(keep, first, end)
    part = part.counting(part.time >= settle)
    # A stretch without a reversal does not show that the current has no sign.
    part.memory[unsigned.__wrapped__] = unsigned(log)  # type: ignore[attr-defined]
    return part


def motion(log: Log, per_output: float) -> tuple[Floats, Floats]:
    """Return motor speed and position error at the output, NaN where nothing shows them."""
    position = log.get("output_position")
    if position is None and log.has("motor_position"):
        position = log["motor_position"] / per_output
    if log.has("motor_speed"):
        speed = log["motor_speed"]
    elif log.has("output_speed"):
        speed = log["output_speed"] * per_output
    elif position is not None:
        speed = np.gradient(position, log.time) * per_output
    else:
        speed = np.full(len(log.time), np.nan)
    error = np.full(len(speed), np.nan) if position is None else log["command"] - position
    return np.asarray(speed, dtype=np.float64), np.asarray(error, dtype=np.float64)


@per_log
def unsigned(log: Log) -> bool:
    """A current that is never below zero though the motion reverses has lost its sign."""
    current, moves = log.get("torque_current"), motion(log, 1.0)[0]
    if current is None or not np.isfinite(moves).any():
        return False
    both = float(np.nanmin(moves)) < 0.0 < float(np.nanmax(moves))
    size = float(np.nanmax(np.abs(current)))
    return bool(both and size > 0.0 and float(np.nanmin(current)) > _NO_SIGN * size)


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
