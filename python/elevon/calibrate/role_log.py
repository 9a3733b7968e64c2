"""A log by roles: every channel on the clock of one of them, and what its stand set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.recording import Recording

__all__ = ["CalibrationRoleLog", "role_channels"]

_FEWEST = 100  # samples


@dataclass(frozen=True)
class CalibrationRoleLog:
    """A log, SI, on one clock.

    Attributes
    ----------
    name : str
        Of the file.
    time : ndarray, shape (n,)
        s, from zero.
    roles : mapping of str to ndarray, shape (n,)
        What was recorded.
    stand : mapping of str to object
        Parameters that the stand set (`brake.powered` and the like), as they were written.
    total_load : bool
        Whether the role ``load`` is the whole load, as a run records it; else the stand's force.
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

    @property
    def duration(self) -> float:
        """Length, s."""
        return float(self.time[-1])

    def has(self, *roles: str) -> bool:
        """Whether all of some roles were recorded."""
        return all(role in self.roles for role in roles)

    def __getitem__(self, role: str) -> Floats:
        return self.roles[role]

    def setting(self, path: str) -> Any:
        """Return what the stand set, None where it says nothing."""
        return self.stand.get(path)


def role_channels(recording: Recording, name: str, needed: Sequence[str]) -> dict[str, Any]:
    """Return the arguments of a `CalibrationRoleLog`, on the clock of the first role needed.

    Raises
    ------
    InputError
        A role that is needed is missing, or the log is too short.
    """
    roles = recording.roles
    for role in needed:
        if role not in roles:
            raise InputError(f"{name}: no channel has the role {role!r}; roles: {', '.join(roles)}")
    clock = np.asarray(recording.role(needed[0]).time, dtype=np.float64)
    if len(clock) < _FEWEST:
        raise InputError(f"{name}: {len(clock)} samples; at least {_FEWEST}")
    present = {}
    for role in roles:
        channel = recording.role(role)
        values = np.asarray(channel.values, dtype=np.float64)
        if channel.unit == "1":
            at = np.searchsorted(channel.time, clock + 1e-9, side="right") - 1
            present[role] = values[at.clip(0)]
        else:
            present[role] = np.interp(clock, channel.time, values)
    stand = recording.meta.get("stand")
    settings = stand.get("parameters", {}) if isinstance(stand, Mapping) else {}
    return {
        "name": name,
        "time": clock - clock[0],
        "roles": present,
        "stand": dict(settings),
        "total_load": not isinstance(stand, Mapping) and "scenario" in recording.meta,
    }
