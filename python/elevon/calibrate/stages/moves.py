"""Motions of an actuator with a control unit: under its own drive, or moved by a rig."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from elevon.logs.log import Log, per_log

#: States of the control unit that mean a motion, and the state it ends in.
EXTENDING, LOCKED, RETRACTING = 1, 2, 3
_RIG_MOTION = 2e-3  # m at least that a rig has moved the ram
_FOLLOWS = 0.5  # of the ram's speed: a motor that turns with it
_RESTS = 0.02  # of the highest speed, below which a motor rests
_SHORTEST = 0.5  # s of a motion
_DRIVEN = 1.0  # A that drive a motor


@dataclass(frozen=True)
class Move:
    """One motion under the unit's drive: direction, begin and end [s], and what it ended in."""

    extending: bool
    begin: float
    end: float
    after: int | None

    @property
    def direction(self) -> float:
        """1 extending, -1 retracting."""
        return 1.0 if self.extending else -1.0


@per_log
def moves_of(log: Log) -> tuple[Move, ...]:
    """Motions under drive, by the unit's state if recorded, else by speed and current."""
    if not log.has("state"):
        return _by_speed(log)
    state = np.rint(log["state"]).astype(int)
    edges = np.concatenate(([0], np.flatnonzero(np.diff(state)) + 1, [len(state)]))
    moves = []
    for first, last in itertools.pairwise(edges.tolist()):
        if state[first] not in (EXTENDING, RETRACTING):
            continue
        after = int(state[last]) if last < len(state) else None
        ends = float(log.time[min(last, len(state) - 1)])
        moves.append(Move(state[first] == EXTENDING, float(log.time[first]), ends, after))
    return tuple(moves)


def _by_speed(log: Log) -> tuple[Move, ...]:
    """Motions between two rests in which a current drove the motor: no rig moved it."""
    if not log.has("torque_current"):
        return ()
    speed, time = log["motor_speed"], log.time
    moving = np.abs(speed) > _RESTS * float(np.max(np.abs(speed)))
    edges = np.concatenate(([0], np.flatnonzero(np.diff(moving)) + 1, [len(moving)]))
    moves = []
    for first, last in itertools.pairwise(edges.tolist()):
        long = time[last - 1] - time[first] > _SHORTEST
        driven = np.median(np.abs(log["torque_current"][first:last])) > _DRIVEN
        if moving[first] and long and driven:
            direction = bool(np.mean(speed[first:last]) > 0.0)
            moves.append(Move(direction, float(time[first]), float(time[last - 1]), None))
    return tuple(moves)


@per_log
def rig_moves(log: Log) -> bool:
    """Whether a rig moved the ram: a load cell, motion at one speed, and no drive."""
    if not log.has("load_cell") or moves_of(log):
        return False
    return float(np.ptp(log["output_position"])) > _RIG_MOTION


def connected(log: Log, per_travel: float) -> bool:
    """Whether the motor turned with the ram that a rig moved."""
    span = float(log.time[-1])
    ram = float(np.ptp(log["output_position"])) / span
    motor = abs(float(np.mean(log["motor_speed"]))) / per_travel
    return motor > _FOLLOWS * ram
