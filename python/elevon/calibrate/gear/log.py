"""A log of an actuator with a control unit: its channels by role on one clock, and its stand."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.recording import Recording

__all__ = ["EXTENDING", "LOCKED", "RETRACTING", "GearLog", "Move", "gear_log"]

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
#: States of the control unit that mean a motion, and the state it ends in.
EXTENDING, LOCKED, RETRACTING = 1, 2, 3
_FEWEST = 100  # samples
_RIG_MOTION = 2e-3  # m at least that a rig has moved the ram
_FOLLOWS = 0.5  # of the ram's speed: a motor that turns with it
_NEEDED = ("output_position", "motor_speed")


@dataclass(frozen=True)
class Move:
    """One motion under the unit's drive: direction, begin and end [s], and what it ended in."""

    extending: bool
    begin: float
    end: float
    after: int | None

    @property
    def way(self) -> float:
        """1 extending, -1 retracting."""
        return 1.0 if self.extending else -1.0


@dataclass(frozen=True)
class GearLog:
    """A log, SI, on the clock of the output's position.

    Attributes
    ----------
    name : str
        Of the file.
    time : ndarray, shape (n,)
        s, from zero.
    roles : mapping of str to ndarray, shape (n,)
        What was shown.
    stand : mapping of str to object
        Parameters that the stand set (`brake.powered` and the like), as they were written.
    total_load : bool
        Whether the role ``load`` is the whole load, positive towards extension, as a run records
        it; else it is the stand's force, positive against extension.
    """

    name: str
    time: Floats
    roles: Mapping[str, Floats]
    stand: Mapping[str, Any] = field(default_factory=dict)
    total_load: bool = False

    @cached_property
    def period(self) -> float:
        """Median step of the clock, s."""
        return float(np.median(np.diff(self.time)))

    def has(self, *roles: str) -> bool:
        """Whether all of some roles were recorded."""
        return all(role in self.roles for role in roles)

    def __getitem__(self, role: str) -> Floats:
        return self.roles[role]

    @cached_property
    def moves(self) -> tuple[Move, ...]:
        """Motions under drive, by the unit's state."""
        if "state" not in self.roles:
            return ()
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

    @cached_property
    def rig(self) -> bool:
        """Whether a rig moved the ram: a load cell, motion at one speed, and no drive."""
        if not self.has("load_cell") or self.moves:
            return False
        return float(np.ptp(self["output_position"])) > _RIG_MOTION

    def setting(self, path: str) -> Any:
        """Return what the stand set, None where it says nothing."""
        return self.stand.get(path)

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
    roles = recording.roles
    for role in _NEEDED:
        if role not in roles:
            raise InputError(f"{name}: no channel plays {role!r}; roles: {', '.join(roles)}")
    base = recording.role("output_position")
    clock = np.asarray(base.time, dtype=np.float64)
    if len(clock) < _FEWEST:
        raise InputError(f"{name}: {len(clock)} samples; at least {_FEWEST}")
    shown = {}
    for role in roles:
        channel = recording.role(role)
        values = np.asarray(channel.values, dtype=np.float64)
        if channel.unit == "1":
            at = np.searchsorted(channel.time, clock + 1e-9, side="right") - 1
            shown[role] = values[at.clip(0)]
        else:
            shown[role] = np.interp(clock, channel.time, values)
    stand = recording.meta.get("stand")
    settings = stand.get("parameters", {}) if isinstance(stand, Mapping) else {}
    own = not isinstance(stand, Mapping) and "scenario" in recording.meta
    return GearLog(name, clock - clock[0], shown, dict(settings), own)
