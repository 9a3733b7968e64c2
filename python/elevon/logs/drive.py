"""A drive's log as calibration and diagnosis read it: without gaps, no faster than they need."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from elevon.arrays import Bools, Floats
from elevon.errors import InputError
from elevon.logs.log import Log, bridged, per_log

_LEAST_SAMPLES = 200
_NEEDED = ("speed_ref", "motor_speed")
_CURRENTS = ("torque_current", "current_ref")  # the measured one first
_OPTIONAL = ("current_ref", "motor_position", "output_position")
#: Hz, the least that is left. ASSUMED: ten times the lag of the bench's current filter, more than
#: twice the bench's own rate; time and memory of calibration grow with the samples.
RATE = 1000.0


@per_log
def drive_log(log: Log) -> Log:
    """Return what calibration and diagnosis need of a drive's log, its gaps bridged, thinned.

    `good` marks the samples at which speed, its set point and the current are all present. The
    channel ``torque_voltage`` is the set point of the torque current's voltage; its gaps stay.

    Raises
    ------
    InputError
        Speed, its set point or a current is missing, or too few samples are complete.
    """
    name = log.name
    for needed in _NEEDED:
        if not log.has(needed):
            raise InputError(
                f"{name}: no channel has the role {needed}; calibration needs a speed set point, "
                f"the motor's speed and a torque current; roles: {', '.join(log) or 'none'}"
            )
    log = log.on("speed_ref")
    current = next((role for role in _CURRENTS if log.has(role)), None)
    if current is None:
        raise InputError(f"{name}: no torque current; friction cannot be determined")
    if len(log.time) < _LEAST_SAMPLES:
        raise InputError(f"{name}: {len(log.time)} samples; calibration needs {_LEAST_SAMPLES}")
    needed_roles = (*_NEEDED, current)
    good = log.good & np.isfinite(np.column_stack([log[r] for r in needed_roles])).all(axis=1)
    if good.sum() < _LEAST_SAMPLES:
        raise InputError(f"{name}: {int(good.sum())} samples are complete; {_LEAST_SAMPLES} needed")
    enough = [r for r in _OPTIONAL if log.has(r) and np.isfinite(log[r]).sum() >= _LEAST_SAMPLES]
    roles = dict.fromkeys((*needed_roles, *enough))
    channels = {role: bridged(log.time, log[role]) for role in roles}
    voltage = _voltage(log)
    if voltage is not None:
        channels["torque_voltage"] = voltage
    ready = thinned(replace(log, channels=channels, good=good, recording=None))
    ready.memory[drive_log.__wrapped__] = ready  # type: ignore[attr-defined]
    return ready


def drive_channels(log: Log) -> Log:
    """Return a drive's log as it was recorded, on its own clock: gaps stay, nothing is thinned.

    Raises
    ------
    InputError
        No channel is the set point of the speed.
    """
    log = log.on("speed_ref")
    voltage = _voltage(log)
    channels = {role: values for role, values in log.channels.items() if role != "torque_voltage"}
    if voltage is not None:
        channels["torque_voltage"] = voltage
    return replace(log, channels=channels, recording=None)


def _voltage(log: Log) -> Floats | None:
    """The set point of the voltage, which a recording may hold beside the measured one."""
    known = log.recording
    if known is not None and "voltage_q_ref" not in known:
        return None
    channel = None if known is None else known["voltage_q_ref"]
    there = None if channel is None else np.isin(log.time, channel.time - log.start)
    if channel is None or there is None or there.sum() != len(channel.values):
        values = log.get("torque_voltage")
    else:
        values = np.full(len(log.time), np.nan)
        values[there] = channel.values
    usable = values is not None and np.isfinite(values).sum() > len(values) // 2
    return values if usable else None


def groups_of(time: Floats, rate: float = RATE) -> int:
    """Return how many samples of a log of these instants [s] make one, to keep a rate [Hz]."""
    period = float(np.median(np.diff(time)))
    return max(1, int(1.0 / (period * rate) + 1e-6))


def group_means(values: Floats, count: int) -> Floats:
    """Means of groups of `count` samples, shape (n,) to (n // count,); NaN where one is missing."""
    whole = len(values) // count
    return np.asarray(values[: whole * count].reshape(whole, count).mean(axis=1))


def thinned(log: Log, rate: float = RATE) -> Log:
    """Return a log of at least a rate [Hz]: means of groups, all channels and the clock alike.

    A mean over a group acts on every channel in the same way, so no channel is late against
    another, and what is linear between them stays as it is.
    """
    count = groups_of(log.time, rate)
    if count == 1:
        return log
    time = group_means(log.time, count)
    brake = log.brake
    if len(brake.time):
        brake = replace(brake, time=brake.time - time[0])
    size = len(time)
    good: Bools = np.asarray(log.good[: size * count].reshape(size, count).all(1))
    return replace(
        log,
        start=log.start + float(time[0]),
        time=time - time[0],
        channels={role: group_means(values, count) for role, values in log.channels.items()},
        brake=brake,
        good=good,
        recording=None,
    )
