"""A log of an actuator with a control unit: its channels by role on one clock, and its stand."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from elevon.calibrate.role_log import CalibrationRoleLog, role_channels

if TYPE_CHECKING:
    from elevon.recording import Recording

__all__ = ["EXTENDING", "LOCKED", "RETRACTING", "GearLog", "Move", "gear_log"]

#: States of the control unit that mean a motion, and the state it ends in.
EXTENDING, LOCKED, RETRACTING = 1, 2, 3
_RIG_MOTION = 2e-3  # m at least that a rig has moved the ram
_FOLLOWS = 0.5  # of the ram's speed: a motor that turns with it
_RESTS = 0.02  # of the highest speed, below which a motor rests
_SHORTEST = 0.5  # s of a motion
_DRIVEN = 1.0  # A that drive a motor
_NEEDED = ("output_position", "motor_speed")


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


@dataclass(frozen=True)
class GearLog(CalibrationRoleLog):
    """A log on the clock of the output's position; the whole load is positive towards extension.

    Attributes
    ----------
    recording : Recording or None
        What it was read from: its inputs can be run again.
    """

    recording: Recording | None = field(default=None, compare=False, repr=False)

    @cached_property
    def moves(self) -> tuple[Move, ...]:
        """Motions under drive, by the unit's state if recorded, else by speed and current."""
        if "state" not in self.roles:
            return self._by_speed()
        state = np.rint(self["state"]).astype(int)
        edges = np.concatenate(([0], np.flatnonzero(np.diff(state)) + 1, [len(state)]))
        moves = []
        for first, last in itertools.pairwise(edges.tolist()):
            if state[first] not in (EXTENDING, RETRACTING):
                continue
            after = int(state[last]) if last < len(state) else None
            ends = float(self.time[min(last, len(state) - 1)])
            moves.append(Move(state[first] == EXTENDING, float(self.time[first]), ends, after))
        return tuple(moves)

    def _by_speed(self) -> tuple[Move, ...]:
        """Motions between two rests in which a current drove the motor: no rig moved it."""
        if "torque_current" not in self.roles:
            return ()
        speed, time = self["motor_speed"], self.time
        moving = np.abs(speed) > _RESTS * float(np.max(np.abs(speed)))
        edges = np.concatenate(([0], np.flatnonzero(np.diff(moving)) + 1, [len(moving)]))
        moves = []
        for first, last in itertools.pairwise(edges.tolist()):
            long = time[last - 1] - time[first] > _SHORTEST
            driven = np.median(np.abs(self["torque_current"][first:last])) > _DRIVEN
            if moving[first] and long and driven:
                direction = bool(np.mean(speed[first:last]) > 0.0)
                moves.append(Move(direction, float(time[first]), float(time[last - 1]), None))
        return tuple(moves)

    @cached_property
    def rig(self) -> bool:
        """Whether a rig moved the ram: a load cell, motion at one speed, and no drive."""
        if not self.has("load_cell") or self.moves:
            return False
        return float(np.ptp(self["output_position"])) > _RIG_MOTION

    def connected(self, per_travel: float) -> bool:
        """Whether the motor turned with the ram that a rig moved."""
        span = float(self.time[-1])
        ram = float(np.ptp(self["output_position"])) / span
        motor = abs(float(np.mean(self["motor_speed"]))) / per_travel
        return motor > _FOLLOWS * ram


def gear_log(recording: Recording, name: str) -> GearLog:
    """Return what the calibration needs of a recording, by the roles it states.

    Parameters
    ----------
    recording : Recording
        With the roles ``output_position`` and ``motor_speed`` at least.
    name : str
        Of the log.

    Raises
    ------
    InputError
        A role that is needed is missing, or the log is too short.
    """
    return GearLog(**role_channels(recording, name, _NEEDED), recording=recording)
