"""A log by its roles, from the instant at which something was first commanded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.byroles.role_test import RoleTest, action_numbers, test_of
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.recording import Recording

__all__ = ["RoleLog", "role_log"]

#: What is put in, not measured.
_INPUTS = frozenset(["command", "load"])
_LEAST = 200  # samples
_MISSING = 0.2  # share of samples above which a channel is left out
_FASTEST = 1000.0  # Hz; faster logs are averaged down: the reduced-order model shows no more
_LONGEST = 60.0  # s after the onset that are read
BEFORE = 0.1  # s before the onset that are read
_LADDER = 0.1  # of the log's length: the lengths after the onset that are read differ by it
_QUIET = 1e-3  # of the command's range: below it nothing is commanded


@dataclass(frozen=True)
class RoleLog:
    """A log on one even clock, counted from its onset.

    Attributes
    ----------
    name : str
        Of the log.
    time : ndarray, shape (n,)
        s from the onset; the first is ``-BEFORE``.
    command : ndarray, shape (n,)
        What was commanded.
    channels : mapping of str to ndarray, shape (n,)
        Role to values, SI; gaps bridged.
    units : mapping of str to str
        Role to unit.
    rate : float
        Hz.
    test : RoleTest
        What was commanded and what loaded it, for the model.
    findings : tuple of str
        What the caller should know.
    """

    name: str
    time: Floats
    command: Floats
    channels: Mapping[str, Floats]
    units: Mapping[str, str]
    rate: float
    test: RoleTest
    findings: tuple[str, ...] = ()

    def within(self, seconds: float) -> RoleLog:
        """Return the log up to some seconds after its onset."""
        count = int(np.searchsorted(self.time, seconds * (1.0 + 1e-9)))
        return replace(
            self,
            time=self.time[:count],
            command=self.command[:count],
            channels={role: values[:count] for role, values in self.channels.items()},
            test=self.test.within(seconds),
        )


def role_log(recording: Recording, name: str, actuator: Actuator) -> RoleLog:
    """Read a recording by its roles.

    Raises
    ------
    InputError
        No command, nothing commanded, nothing recorded, too short, or nothing moves.
    """
    time, channels, units, lost = _channels(recording, name)
    command = channels["command"]
    actions = action_numbers(actuator.wiring)
    first = _onset(time, command, sequence=bool(actions), name=name)
    rate = 1.0 / float(np.median(np.diff(time)))
    seconds = _length(float(time[-1] - time[0]), float(time[-1] - first))
    clock = np.arange(-round(BEFORE * rate), round(seconds * rate) + 1) / rate
    at = np.clip(clock + first, time[0], time[-1])
    used = {r: _on(at, time, v, sample_hold=units[r] == "1") for r, v in channels.items()}
    _check_motion(used, name)
    test = test_of(recording, actuator, clock, used, seconds)
    seen = {r: v for r, v in used.items() if r not in _INPUTS or (r == "load" and test.own_load)}
    findings = [f"{name}: too many samples missing, left out: {', '.join(lost)}"] if lost else []
    if time[-1] - first > _LONGEST * (1.0 + _LADDER):
        findings.append(f"{name}: read up to {_LONGEST:g} s after the first command")
    return RoleLog(name, clock, used["command"], seen, units, rate, test, tuple(findings))


def _channels(
    recording: Recording, name: str
) -> tuple[Floats, dict[str, Floats], dict[str, str], list[str]]:
    """Every role on the command's clock; those with too many gaps are named."""
    roles = recording.roles
    if "command" not in roles:
        raise InputError(
            f"{name}: no channel has the role 'command': the test cannot be run on the model; "
            f"roles: {', '.join(roles) or 'none'}"
        )
    time = np.asarray(recording.role("command").clock.time, dtype=np.float64)
    if len(time) < _LEAST:
        raise InputError(f"{name}: {len(time)} samples; {_LEAST} are needed")
    channels, units, lost = {}, {}, []
    for role in roles:
        channel = recording.role(role)
        values = np.array(channel.values, dtype=np.float64)
        good = np.isfinite(values)
        if good.mean() < 1.0 - _MISSING:
            lost.append(role)
            continue
        at = np.asarray(channel.time, dtype=np.float64)[good]
        channels[role] = _on(time, at, values[good], sample_hold=channel.unit == "1")
        units[role] = channel.unit
    if "command" in lost:
        raise InputError(f"{name}: too many samples of the command are missing")
    return *_slower(time, channels, units), units, lost


def _on(time: Floats, at: Floats, values: Floats, *, sample_hold: bool) -> Floats:
    if len(at) == len(time) and at[0] == time[0] and at[-1] == time[-1]:
        return values
    if sample_hold:
        return np.asarray(values[(np.searchsorted(at, time + 1e-9, side="right") - 1).clip(0)])
    return np.asarray(np.interp(time, at, values), dtype=np.float64)


def _slower(
    time: Floats, channels: Mapping[str, Floats], units: Mapping[str, str]
) -> tuple[Floats, dict[str, Floats]]:
    """A fast log, averaged down; states and the command are read as they stand."""
    step = max(1, int(1.0 / (float(np.median(np.diff(time))) * _FASTEST) + 1e-6))
    count = len(time) // step * step
    if step == 1:
        return time, dict(channels)
    out = {
        role: v[:count:step]
        if role == "command" or units[role] == "1"
        else v[:count].reshape(-1, step).mean(axis=1)
        for role, v in channels.items()
    }
    return time[:count:step], out


def _onset(time: Floats, command: Floats, *, sequence: bool, name: str) -> float:
    """Instant at which something is first commanded; of a motion that goes on, its middle.

    Everything is counted from there, so logs may begin at any instant before it.
    """
    reach = float(np.ptp(command))
    if reach == 0.0:
        raise InputError(f"{name}: nothing is commanded: the command never changes")
    off = np.abs(command - command[0])
    away = int(np.flatnonzero(off > _QUIET * reach)[0])
    if sequence:
        return float(time[away])
    if away > 2:
        return _begin(time, off, away)
    level = command - 0.5 * (command.max() + command.min())
    rising = np.flatnonzero((level[1:] >= 0.0) & (level[:-1] < 0.0)) + 1
    if len(rising) and rising[0] < len(command) // 4:
        return _crossing(time, level, int(rising[0]))
    return float(time[0])


def _begin(time: Floats, off: Floats, first: int) -> float:
    """Instant from which a command goes away, by the line through its first two samples.

    Samples before them are too near to count, yet may be away already; a step has none.
    """
    here, step = float(off[first]), float(off[min(first + 1, len(off) - 1)] - off[first])
    back = here / step if step > 0.0 else 0.0
    before = int(np.count_nonzero(off[:first]))
    return float(time[first] - min(back, before + 1.0) * (time[first] - time[first - 1]))


def _crossing(time: Floats, level: Floats, after: int) -> float:
    """Instant between two samples at which a level passes zero."""
    low, high = float(level[after - 1]), float(level[after])
    part = -low / (high - low) if high > low else 1.0
    return float(time[after - 1] + part * (time[after] - time[after - 1]))


def _length(total: float, after: float) -> float:
    """Seconds after the onset that are read, in steps, so that logs of one test are read alike."""
    step = _LADDER * min(total, _LONGEST / (1.0 - _LADDER))
    return min(float(np.floor(after / step + 1e-6)) * step, _LONGEST) or after


def _check_motion(used: Mapping[str, Any], name: str) -> None:
    seen = [values for role, values in used.items() if role not in _INPUTS]
    if not any(np.ptp(values) > 0.0 for values in seen):
        raise InputError(f"{name}: nothing moves")
