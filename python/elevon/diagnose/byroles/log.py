"""A log by its roles: what was asked, what loaded it, and numbers of what it shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.diagnose.bymodel.evidence import Evidence
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.recording import Recording

__all__ = ["RoleLog", "evidence_of", "role_log", "same_test"]

Floats = npt.NDArray[np.float64]
#: What is put in, not shown.
_INPUTS = frozenset(["command", "load", "load_cell"])
_LEAST = 200  # samples
_PARTS = 4  # of the log, each with a level of its own: when something happens counts, too
_FEW = 20  # levels of a command of steps
_MISSING = 0.2  # share of samples above which a channel is left out


@dataclass(frozen=True)
class RoleLog:
    """A log on one clock.

    Attributes
    ----------
    name : str
        Of the log.
    time, command : ndarray, shape (n,)
        s from zero, and what was asked.
    channels : mapping of str to ndarray, shape (n,)
        Role to values, SI; gaps bridged.
    units : mapping of str to str
        Role to unit.
    load : ndarray, shape (n,), or None
        Force or torque on the output, positive where it opposes positive motion.
    rate : float
        Hz.
    lost : tuple of str
        Roles left out since too many samples are missing.
    """

    name: str
    time: Floats
    command: Floats
    channels: Mapping[str, Floats]
    units: Mapping[str, str]
    load: Floats | None
    rate: float
    lost: tuple[str, ...] = ()


def role_log(recording: Recording, name: str) -> RoleLog:
    """Read a recording by its roles.

    Raises
    ------
    InputError
        No command, nothing shown, too short, or nothing moves.
    """
    roles = recording.roles
    if "command" not in roles:
        raise InputError(
            f"{name}: no channel plays the role 'command': the test cannot be run on the model; "
            f"roles: {', '.join(roles) or 'none'}"
        )
    clock = recording.role("command").clock
    time = np.asarray(clock.time, dtype=np.float64)
    if len(time) < _LEAST:
        raise InputError(f"{name}: {len(time)} samples; {_LEAST} are needed")
    shown, units, lost = {}, {}, []
    for role in roles:
        channel = recording.role(role)
        values = np.array(channel.values, dtype=np.float64)
        good = np.isfinite(values)
        if good.mean() < 1.0 - _MISSING:
            lost.append(role)
            continue
        at = np.asarray(channel.time, dtype=np.float64)
        shown[role] = np.interp(time, at[good], values[good])
        units[role] = channel.unit
    load = shown.get("load")
    seen = {role: v for role, v in shown.items() if role not in _INPUTS}
    if not any(np.ptp(values) > 0.0 for values in seen.values()):
        raise InputError(f"{name}: nothing moves")
    rate = 1.0 / float(np.median(np.diff(time)))
    return RoleLog(name, time - time[0], shown["command"], seen, units, load, rate, tuple(lost))


def evidence_of(channels: Mapping[str, Floats], item: RoleLog, actuator: Actuator) -> Evidence:
    """Numbers of a log or a model run of its test: features of the catalogue, levels of every role.

    Parameters
    ----------
    channels : mapping of str to ndarray, shape (n,)
        Role to values: the log's own, or a model's on its instants.
    item : RoleLog
        The log.
    actuator : Actuator
        For the motor's pole pairs.
    """
    rows = _levels(channels) | _features(channels, item, actuator)
    names = tuple(name for name, value in rows.items() if np.isfinite(value))
    values = np.array([rows[name] for name in names])
    return Evidence(names, values, np.zeros(len(names)))


def _levels(channels: Mapping[str, Floats]) -> dict[str, float]:
    rows = {}
    for role, values in channels.items():
        if role == "motor_position":  # no log says where its zero is
            continue
        for k, part in enumerate(np.array_split(values, _PARTS)):
            rows[f"{role}: mean of part {k + 1}"] = float(part.mean())
        rows[f"{role}: rms"] = float(np.sqrt(np.mean(values**2)))
        rows[f"{role}: last"] = float(values[-max(len(values) // 50, 1) :].mean())
    return rows


def _features(
    channels: Mapping[str, Floats], item: RoleLog, actuator: Actuator
) -> dict[str, float]:
    from elevon.features import recording_features
    from elevon.recording import Recording

    values = {"command": item.command, **channels}
    units = {role: item.units[role] for role in values}
    meta: dict[str, Any] = {"roles": {role: role for role in values}}
    even = np.arange(len(item.time)) / item.rate
    recording = Recording.build(even, values, units, rate=item.rate, meta=meta)
    known = actuator.parameters
    pairs = known.value("motor.pole_pairs") if "motor.pole_pairs" in known else None
    try:
        shown = recording_features(recording, pole_pairs=pairs)
    except InputError:
        return {}
    return dict(shown.values)


def same_test(a: RoleLog, b: RoleLog, share: float = 0.05) -> bool:
    """Whether two logs were asked for the same and loaded alike, whenever the command began."""
    if abs(a.time[-1] - b.time[-1]) > share * a.time[-1]:
        return False
    loads = _typical(a.load), _typical(b.load)
    if abs(loads[0] - loads[1]) > 2.0 * share * max(*map(abs, loads), 1.0):
        return False
    steps = _steps(a.command), _steps(b.command)
    if min(len(s) for s in steps) <= _FEW:
        return steps[0] == steps[1]
    size = float(np.abs(a.command).max())
    return all(
        abs(float(of(a.command)) - float(of(b.command))) <= share * size for of in (np.std, np.mean)
    )


def _steps(command: Floats) -> list[float]:
    """Levels of a command in their order."""
    turns = np.flatnonzero(np.diff(command)) + 1
    return [float(command[0]), *np.round(command[turns], 9).tolist()]


def _typical(load: Floats | None) -> float:
    return 0.0 if load is None else float(np.mean(load))
