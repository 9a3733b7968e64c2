"""What one log of a motion that repeats shows, without a model of the actuator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.roles.log import aligned
from elevon.diagnose.roles.numbers import numbers_of
from elevon.diagnose.roles.reading import INPUTS
from elevon.errors import InputError
from elevon.logs.drive import group_means
from elevon.logs.maps.column_map import known_roles

if TYPE_CHECKING:
    from elevon.logs.log import Log

_POINTS = 200  # of the command that a motion is recognised by
_ALIKE = (
    0.07  # of its range, RMS, up to which two commands are one motion. ASSUMED: part of a period
)
_PACE = 0.2  # by which their paces may differ
_SLOW = 0.02  # s of the means that the pace is read from
_SET_POINT = "speed_ref"
_OF_COMMAND = ("position error", "tracking")
_ROOM = 1.1  # over the largest difference among runs of a plan that varies the motion. ASSUMED
_SOONER = 0.3  # of its length that a log may be shorter or longer: benches are started by hand


@dataclass(frozen=True)
class LoggedMotion:
    """One log of it.

    Attributes
    ----------
    name : str
        The log.
    values : dict of str to float
        Numbers by name (`elevon.diagnose.roles.numbers`).
    command : ndarray, shape (200,)
        Its quantiles about its mean, whenever the log begins in a period.
    pace : float
        RMS of its rate over that of itself [1/s].
    seconds : float
        From the onset.
    """

    name: str
    values: dict[str, float]
    command: Floats
    pace: float
    seconds: float


@dataclass(frozen=True)
class KnownMotion:
    """The motion that was learnt, and how far a log may be from it.

    Attributes
    ----------
    command : ndarray, shape (200,)
        As `LoggedMotion` has it.
    pace, seconds : float
        Of it [1/s, s].
    off : float
        RMS difference of two commands, over the range of the learnt one.
    faster, longer : float
        Relative difference of pace and length.
    """

    command: Floats
    pace: float
    seconds: float
    off: float = _ALIKE
    faster: float = _PACE
    longer: float = _SOONER

    @classmethod
    def spanning(cls, items: Sequence[LoggedMotion]) -> KnownMotion:
        """Return the middle of motions that a plan varies, with as much room as they need."""
        command = np.median([item.command for item in items], axis=0)
        pace, seconds = (
            float(np.median([getattr(item, name) for item in items]))
            for name in ("pace", "seconds")
        )
        middle = cls(command, pace, seconds)
        rows = np.array([middle.differences(item) for item in items])
        least = (_ALIKE, _PACE, _SOONER)
        return cls(command, pace, seconds, *np.maximum(_ROOM * rows.max(axis=0), least).tolist())

    def differences(self, item: LoggedMotion) -> tuple[float, float, float]:
        """Return what `off`, `faster` and `longer` bound."""
        off = float(np.sqrt(np.mean((item.command - self.command) ** 2)) / np.ptp(self.command))
        return off, abs(item.pace / self.pace - 1.0), abs(item.seconds / self.seconds - 1.0)

    def refusal(self, item: LoggedMotion) -> str:
        """Return how a log differs from the motion; empty where it is of the motion."""
        off, faster, longer = self.differences(item)
        if longer > self.longer:
            return f"lasts {item.seconds:.3g} s after its onset, not {self.seconds:.3g} s"
        if off > self.off:
            return f"its command is off by {off:.0%} of the range (RMS)"
        if faster > self.faster:
            return f"it moves at {item.pace / self.pace:.2g} times the pace"
        return ""


def motion_of(log: Log, pole_pairs: float | None = None) -> LoggedMotion:
    """Compute the numbers of a log from the onset of its command.

    Parameters
    ----------
    log : Log
        By roles, one of them ``command``, else a set point of the speed serves.
    pole_pairs : float, optional
        Of the motor, for what turns with the electrical angle.

    Raises
    ------
    InputError
        No command, nothing commanded or recorded, too short, or nothing moves.
    """
    stated = log.has("command")
    units = {role: log.units.get(role) or known_roles()[role].units[0] for role in log}
    log = replace(log, units=units)
    if not stated and log.has(_SET_POINT):
        log = log.on(_SET_POINT)
        log = replace(
            log, channels={**log.channels, "command": log[_SET_POINT]},
            units={**units, "command": units[_SET_POINT]}, recording=None,
        )  # fmt: skip
    ready, seconds, _ = aligned(log, sequence=log.units.get("command") == "1")
    channels = {r: v for r, v in ready.channels.items() if r not in INPUTS}
    numbers = numbers_of(channels, ready["command"], ready.time, ready.units, pole_pairs)
    # Without a command there is no error of the position to speak of.
    values = {n: v for n, v in numbers.values.items() if stated or not n.startswith(_OF_COMMAND)}
    command = ready["command"]
    slow = group_means(command, max(1, round(_SLOW / (ready.time[1] - ready.time[0]))))
    pace = float(np.std(np.diff(slow)) / _SLOW / np.std(command))
    quantiles = np.quantile(command, np.linspace(0.0, 1.0, _POINTS)) - command.mean()
    return LoggedMotion(log.name, values, quantiles, pace, seconds)


def motions(
    logs: Sequence[Log], pole_pairs: float | None = None
) -> tuple[tuple[LoggedMotion, ...], KnownMotion]:
    """Return the numbers of logs that must be of one motion, and that motion: the first log's.

    Raises
    ------
    InputError
        As `motion_of`; a log of another motion than the first.
    """
    out = tuple(motion_of(log, pole_pairs) for log in logs)
    known = KnownMotion(out[0].command, out[0].pace, out[0].seconds)
    for item in out[1:]:
        if text := known.refusal(item):
            raise InputError(f"{item.name} is of another motion than {out[0].name}: {text}")
    return out, known
