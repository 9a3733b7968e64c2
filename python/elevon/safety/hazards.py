"""Hazards: properties watched in a run, by its recording and what was commanded alone.

Nothing here reads what the control unit knows; it shares no code with it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.recording import Recording
from elevon.safety.rows import Row

RECORD = (
    "state,fault_code,warning_code,command_refused,locked,released,output_position,nut_position,"
    "motor_speed,current_mean,brake_released@100 Hz"
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


@dataclass(frozen=True)
class Watched:
    """What a hazard is judged by: signals by name, their time, and the row."""

    time: Floats
    signals: Mapping[str, Floats]
    row: Row
    status: str

    def __getitem__(self, name: str) -> Floats:
        """Return the values of a signal."""
        return self.signals[name]


Judge = Callable[[Watched], float | None]


@dataclass(frozen=True)
class Hazard:
    """A property that no run may have.

    Attributes
    ----------
    name : str
        Short name.
    text : str
        What it is, in words.
    judge : callable
        Time in s at which a run shows it; None: never.
    severe : bool
        No single failure may lead to it.
    """

    name: str
    text: str
    judge: Judge
    severe: bool = False


def observe(recording: Recording, row: Row) -> dict[str, float]:
    """Return the hazards of a run and when each begins, in s.

    Parameters
    ----------
    recording : Recording
        With the signals of `RECORD`.
    row : Row
        What was commanded, and when there was weight on wheels.
    """
    names = RECORD.partition("@")[0].split(",")
    signals = {name: recording[name].values for name in names}
    run = Watched(recording[names[0]].time, signals, row, recording.status)
    times = {hazard.name: hazard.judge(run) for hazard in HAZARDS}
    return {name: time for name, time in times.items() if time is not None}


def _lasting(run: Watched, flags: np.ndarray, least: float) -> float | None:
    """Return when a condition that lasts longer than `least` begins."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(int), [0]))))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if run.time[last - 1] - run.time[first] > least:
            return float(run.time[first])
    return None


def _false_locked(run: Watched) -> float | None:
    return _lasting(run, (run["state"] == LOCKED) & (run["locked"] < 0.5), RESPONSE)


def _false_retracted(run: Watched) -> float | None:
    return _lasting(run, (run["state"] == RETRACTED) & (run["nut_position"] > HOME), RESPONSE)


def _unlocked(run: Watched) -> float | None:
    """The lock lets go though the last command was no retraction."""
    freed = np.flatnonzero(np.diff((run["locked"] > 0.5).astype(int)) < 0)
    for time in run.time[freed + 1]:
        before = [action for at, action in run.row.steps if at <= time]
        if not before or before[-1] not in {"retract", "stop"} or "retract" not in before:
            return float(time)
    return None


def _pressing(run: Watched) -> np.ndarray:
    hard = np.abs(run["current_mean"]) > STOP_CURRENT
    return np.asarray(hard & (np.abs(run["motor_speed"]) < STOP_SPEED))


def _against_lock(run: Watched) -> float | None:
    upwards = run["current_mean"] < 0.0
    return _lasting(run, _pressing(run) & upwards & (run["locked"] > 0.5), STOP_TIME)


def _against_stop(run: Watched) -> float | None:
    return _lasting(run, _pressing(run), STOP_TIME)


def _on_wheels(run: Watched) -> float | None:
    """The motor lifts the leg while the aircraft stands on it."""
    for begin, end in run.row.wheels:
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
    if any(fault.kind == "release_cable_failed" for fault in run.row.faults):
        return None
    for time in run.row.times("free_fall"):
        if any(begin <= time < end for begin, end in run.row.wheels):
            continue
        index = int(np.searchsorted(run.time, time))
        after = int(np.searchsorted(run.time, time + RELEASE_TIME))
        if after < len(run.time) and run["locked"][index] < 0.5 and run["released"][after] < 0.5:
            return time
    return None


def _wrong_end(run: Watched) -> float | None:
    """The last command is long past, the leg is not where it leads, the run says `ok`."""
    time, action = run.row.steps[-1] if run.row.steps else (0.0, "stop")
    if run.status != "ok" or action == "stop" or run.time[-1] - time < SETTLED:
        return None
    moving = np.isin(run["state"][run.time > run.time[-1] - PAUSE], MOVING)
    if np.any(moving):
        return None
    home = run["nut_position"][-1] <= HOME
    arrived = home if action == "retract" else run["locked"][-1] > 0.5
    return None if arrived else float(run.time[-1])


HAZARDS = (
    Hazard("false locked", "locked is displayed, the lock is open", _false_locked, severe=True),
    Hazard("false retracted", "retracted is displayed, the leg is not up", _false_retracted),
    Hazard("unlocked by itself", "the lock lets go without a command", _unlocked, severe=True),
    Hazard("motion against the lock", "the motor lifts an engaged lock for more than a second",
           _against_lock),
    Hazard("retraction on wheels", "the motor lifts the leg under the aircraft's weight",
           _on_wheels),
    Hazard("free fall refused", "the release does not open though the leg is not locked",
           _fall_refused, severe=True),
    Hazard("current against a stop", "more than 30 A at standstill for more than a second",
           _against_stop),
    Hazard("wrong end with status ok", "the leg is not where it was sent, and nothing says so",
           _wrong_end),
)  # fmt: skip
"""Every hazard, the severe ones marked."""
