"""A log by its roles: what was asked, what loaded it, and numbers of what it shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.diagnose.bymodel.evidence import Evidence
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.recording import Recording

__all__ = ["RoleLog", "evidence_of", "role_log"]

Floats = npt.NDArray[np.float64]
#: What is put in, not shown.
_INPUTS = frozenset(["command", "load", "load_cell"])
_LEAST = 200  # samples
_PARTS = 4  # of the log, each with a level of its own: when something happens counts, too
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


def evidence_of(
    channels: Mapping[str, Floats], units: Mapping[str, str], time: Floats, actuator: Actuator
) -> Evidence:
    """Numbers of a log or a model run: features of the catalogue, and levels of every role."""
    rows = _levels(channels) | _features(channels, units, time, actuator)
    names = tuple(name for name, value in rows.items() if np.isfinite(value))
    values = np.array([rows[name] for name in names])
    return Evidence(names, values, np.zeros(len(names)))


def _levels(channels: Mapping[str, Floats]) -> dict[str, float]:
    rows = {}
    for role, values in channels.items():
        for k, part in enumerate(np.array_split(values, _PARTS)):
            rows[f"{role}: mean of part {k + 1}"] = float(part.mean())
        rows[f"{role}: rms"] = float(np.sqrt(np.mean(values**2)))
        rows[f"{role}: last"] = float(values[-max(len(values) // 50, 1) :].mean())
    return rows


def _features(
    channels: Mapping[str, Floats], units: Mapping[str, str], time: Floats, actuator: Actuator
) -> dict[str, float]:
    from elevon.features import recording_features
    from elevon.recording import Recording

    meta: dict[str, Any] = {"roles": {role: role for role in channels}}
    step = float(np.median(np.diff(time)))
    even = np.arange(len(time)) * step
    recording = Recording.build(
        even, channels, {role: units[role] for role in channels}, rate=1.0 / step, meta=meta
    )
    known = actuator.parameters
    pairs = known.value("motor.pole_pairs") if "motor.pole_pairs" in known else None
    try:
        found = recording_features(recording, pole_pairs=pairs)
    except InputError:
        return {}
    return dict(found.values)


def same_test(a: RoleLog, b: RoleLog, share: float = 0.05) -> bool:
    """Whether two logs were asked for the same and loaded alike."""
    if a.command[0] != b.command[0] and abs(a.time[-1] - b.time[-1]) > share * a.time[-1]:
        return False
    pairs: Sequence[tuple[float, float]] = [
        (float(np.std(a.command)), float(np.std(b.command))),
        (float(np.mean(a.command)), float(np.mean(b.command))),
        (_typical(a.load), _typical(b.load)),
    ]
    size = max(float(np.abs(a.command).max()), 1e-12)
    near = [abs(x - y) <= share * max(abs(x), abs(y)) + 1e-3 * size for x, y in pairs[:2]]
    x, y = pairs[2]
    return all(near) and abs(x - y) <= 2.0 * share * max(abs(x), abs(y), 1.0)


def _typical(load: Floats | None) -> float:
    return 0.0 if load is None else float(np.mean(load))
