"""Hazards of a landing gear, what its control unit displays, and how near a run is to a limit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.recording.plot import code_names
from elevon.safety.gear import GearRow
from elevon.safety.hazards import Hazard, Message, Watched, lasting

RECORD = (
    "state,fault_code,warning_code,command_refused,locked,released,output_position,nut_position,"
    "motor_speed,current_mean,brake_released,supply_voltage@100 Hz"
)
LOCKED, RETRACTED = 2, 0
MOVING = (1, 3)
"""States that are displayed: the last two say that no end is reached yet."""
HOME = 3e-3
"""Nut travel of a retracted leg: the switch, its hysteresis, the way of the brake [m]."""
RESPONSE = 0.05
"""A false indication that lasts no longer is the response of the switches [s]."""
STOP_CURRENT, STOP_SPEED, STOP_TIME = 30.0, 5.0, 1.0
"""Current against a stop: above this [A], below this [rad/s], for longer than this [s]."""
ON_WHEELS_TRAVEL = 5e-3
"""Travel upwards with weight on wheels that is a retraction [m]."""
RELEASE_TIME = 0.5
"""A commanded release is open after this time [s]."""
SETTLED, PAUSE = 13.0, 1.0
"""A healthy move has ended after the first time; a retry follows within the second [s]."""


def _row(run: Watched) -> GearRow:
    return cast("GearRow", run.row)


def _false_locked(run: Watched) -> float | None:
    return lasting(run, (run["state"] == LOCKED) & (run["locked"] < 0.5), RESPONSE)


def _false_retracted(run: Watched) -> float | None:
    return lasting(run, (run["state"] == RETRACTED) & (run["nut_position"] > HOME), RESPONSE)


def _unlocked(run: Watched) -> float | None:
    """The lock lets go though the last command was no retraction."""
    freed = np.flatnonzero(np.diff((run["locked"] > 0.5).astype(int)) < 0)
    for time in run.time[freed + 1]:
        before = [action for at, action in _row(run).steps if at <= time]
        if not before or before[-1] not in {"retract", "stop"} or "retract" not in before:
            return float(time)
    return None


def _pressing(run: Watched) -> npt.NDArray[np.bool_]:
    hard = np.abs(run["current_mean"]) > STOP_CURRENT
    return np.asarray(hard & (np.abs(run["motor_speed"]) < STOP_SPEED))


def _against_lock(run: Watched) -> float | None:
    upwards = run["current_mean"] < 0.0
    return lasting(run, _pressing(run) & upwards & (run["locked"] > 0.5), STOP_TIME)


def _against_stop(run: Watched) -> float | None:
    return lasting(run, _pressing(run), STOP_TIME)


def _on_wheels(run: Watched) -> float | None:
    """The motor lifts the leg while the aircraft stands on it."""
    for begin, end in _row(run).wheels:
        inside = (run.time >= begin + 0.1) & (run.time < end)
        driven = inside & (run["brake_released"] > 0.5) & (run["released"] < 0.5)
        if np.any(driven):
            position = np.where(driven, run["output_position"], np.nan)
            risen = np.fmax.accumulate(np.nan_to_num(position, nan=-np.inf)) - position
            late = np.flatnonzero(risen > ON_WHEELS_TRAVEL)
            if late.size:
                return float(run.time[late[0]])
    return None


def _fall_refused(run: Watched) -> float | None:
    """The crew pulls the release, the leg is not locked, the aircraft does not stand on it."""
    if any(fault.kind == "release_cable_failed" for fault in _row(run).faults):
        return None
    for time in _row(run).times("free_fall"):
        if any(begin <= time < end for begin, end in _row(run).wheels):
            continue
        index = int(np.searchsorted(run.time, time))
        after = int(np.searchsorted(run.time, time + RELEASE_TIME))
        if after < len(run.time) and run["locked"][index] < 0.5 and run["released"][after] < 0.5:
            return time
    return None


def _wrong_end(run: Watched) -> float | None:
    """The last command is long past, the leg is not where it leads, the run says `ok`."""
    time, action = _row(run).steps[-1] if _row(run).steps else (0.0, "stop")
    if run.status != "ok" or action == "stop" or run.time[-1] - time < SETTLED:
        return None
    moving = np.isin(run["state"][run.time > run.time[-1] - PAUSE], MOVING)
    if np.any(moving):
        return None
    home = run["nut_position"][-1] <= HOME
    arrived = home if action == "retract" else run["locked"][-1] > 0.5
    return None if arrived else float(run.time[-1])


HAZARDS = (
    Hazard("false locked", "locked is displayed, the lock is open", _false_locked, "catastrophic"),
    Hazard("false retracted", "retracted is displayed, the leg is not up", _false_retracted),
    Hazard("unlocked by itself", "the lock lets go without a command", _unlocked, "catastrophic"),
    Hazard("motion against the lock", "the motor lifts an engaged lock for more than a second",
           _against_lock),
    Hazard("retraction on wheels", "the motor lifts the leg under the aircraft's weight",
           _on_wheels, "hazardous"),
    Hazard("free fall refused", "the release does not open though the leg is not locked",
           _fall_refused, "catastrophic"),
    Hazard("current against a stop", "more than 30 A at standstill for more than a second",
           _against_stop, "minor"),
    Hazard("wrong end with status ok", "the leg is not where it was sent, and nothing says so",
           _wrong_end),
)  # fmt: skip
"""Every hazard; the classes are ASSUMED: one leg of a transport, its collapse at touchdown."""

_SEEN = {"warning_code": "warning: ", "fault_code": "fault: ", "command_refused": "refused: "}
"""What is displayed to the crew beside the state, and how a line of it begins."""
RESTING = {0, 2, 7, 8}
"""States in which the crew sees nothing amiss: both ends, an end not confirmed yet, no power."""


def displayed(run: Watched) -> list[Message]:
    """Return what the crew sees beyond the state, in order, and where the leg has not arrived.

    Parameters
    ----------
    run : Watched
        The state counts where it lasts to the end of the run.
    """
    lines: list[Message] = []
    for signal, begin in _SEEN.items():
        names, values = code_names("landing_gear", signal), run[signal]
        edges = np.flatnonzero(np.diff(values)) + 1
        lines += [
            Message(float(run.time[index]), begin + names.get(int(values[index]), "?"))
            for index in (0, *edges)
            if values[index] > 0.0
        ]
    state = int(run["state"][-1])
    if state not in RESTING:
        last = np.flatnonzero(run["state"] != state)
        since = float(run.time[last[-1] + 1]) if last.size else 0.0
        lines.append(Message(since, f"state: {code_names('landing_gear', 'state')[state]}"))
    return sorted(lines, key=lambda line: line.time)


def end(run: Watched) -> str:
    """Return the state that is displayed at the end of a run."""
    return code_names("landing_gear", "state")[int(run["state"][-1])]


def limits(actuator: Actuator) -> dict[str, float]:
    """Return the unit's limits that decide an outcome, by the parameter's name."""
    names = (
        "drag_extension",
        "drag_retraction",
        "drag_time",
        "overcurrent",
        "undervoltage",
        "overvoltage",
        "logic_voltage",
        "motion_timeout",
        "fall_time",
        "stall_speed",
    )
    return {name: actuator.parameters.value(f"control.{name}") for name in names}


def distances(run: Watched) -> Iterator[tuple[str, float]]:
    """Yield how far a run stays from each limit that could change it, over the limit.

    Current, voltage and time against the unit's limits; force by the speed that it leaves against
    the one at which the motor counts as standing.
    """
    current, supply, state = run["current_mean"], run["supply_voltage"], run["state"]
    bounds = run.limits
    for name, motoring in (("drag_extension", current), ("drag_retraction", -current)):
        yield "current", abs(_level(run.time, motoring, bounds["drag_time"]) / bounds[name] - 1.0)
    yield "current", abs(float(np.abs(current).max()) / bounds["overcurrent"] - 1.0)
    lowest, highest = float(supply.min()), float(supply.max())
    yield "voltage", abs(lowest / bounds["undervoltage"] - 1.0)
    yield "voltage", abs(lowest / bounds["logic_voltage"] - 1.0)
    if highest > 1.001 * supply[0]:  # the motor or a surge has raised it
        yield "voltage", abs(highest / bounds["overvoltage"] - 1.0)
    yield "time", abs(_longest(run.time, np.isin(state, MOVING)) / bounds["motion_timeout"] - 1.0)
    yield "time", abs(_longest(run.time, state == FALLING) / bounds["fall_time"] - 1.0)
    driven = np.isin(state, MOVING) & (run["brake_released"] > 0.5)
    if np.count_nonzero(driven) > 50:  # half a second: without start and end of the move
        slowest = float(np.quantile(np.abs(run["motor_speed"][driven]), 0.05))
        yield "force", abs(slowest / bounds["stall_speed"] - 1.0)


FALLING = 5
"""The state `released`."""


def _level(time: Floats, values: Floats, least: float) -> float:
    """Value that is exceeded for a time in all, in s."""
    count = round(least / float(time[1] - time[0]))
    return float(np.partition(values, -count)[-count]) if count < len(values) else 0.0


def _longest(time: Floats, flags: npt.NDArray[np.bool_]) -> float:
    """Longest stretch of a condition, in s."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(int), [0]))))
    spans = time[edges[1::2] - 1] - time[edges[::2]]
    return float(spans.max()) if spans.size else 0.0
