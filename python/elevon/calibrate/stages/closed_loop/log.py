"""A log as the closed loop needs it: what was demanded, and whatever of the motion was recorded."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.logs.log import Log, bridged, per_log
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
