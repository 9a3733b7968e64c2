"""A log by its roles, from the instant at which something was first commanded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Bools, Floats
from elevon.diagnose.engine.candidates import of_a_magnet
from elevon.diagnose.roles.numbers import lines
from elevon.diagnose.roles.reading import BEFORE, INPUTS, RoleReading, read_load
from elevon.errors import InputError
from elevon.logs.command.curve import CommandCurve, command_curve
from elevon.logs.log import Log, bridged, on_clock

if TYPE_CHECKING:
    from elevon.actuator import Actuator

_LEAST = 200  # samples
_MISSING = 0.2  # share of samples above which a channel is left out
_FASTEST = 1000.0  # Hz; faster logs are averaged down: the reduced-order model shows no more
_LONGEST = 60.0  # s after the onset that are read
_LADDER = 0.1  # of the log's length: the lengths after the onset that are read differ by it
_EXACT = 2e-4  # of the command's range: what straight lines may miss
_LONG_GAP = 0.02  # s: over a shorter one the command is as good as known
_SETTLES = 0.6  # s after a longer gap that do not count. ASSUMED: three lags of a slow loop
_QUIET = 1e-3  # of the command's range: below it nothing is commanded


def role_log(log: Log, actuator: Actuator, *, until: float | None = None) -> RoleReading:
    """Read a log by its roles, on one even clock counted from its onset.

    Parameters
    ----------
    log : Log
        As it was recorded.
    actuator : Actuator
        The healthy unit.
    until : float, optional
        Instant of the log up to which it is read [s]; default: in steps of a tenth of its length,
        so that logs of one test are read alike.

    Raises
    ------
    InputError
        No command, nothing commanded, nothing recorded, too short, or nothing moves.
    """
    ready, seconds, findings = aligned(log, sequence=bool(_actions(actuator.wiring)), until=until)
    return _reading(log, ready, actuator, seconds=seconds, findings=findings)


def aligned(
    log: Log, *, sequence: bool, until: float | None = None
) -> tuple[Log, float, list[str]]:
    """Return a log on an even clock counted from its onset, seconds after it, and findings.

    Parameters
    ----------
    log : Log
        By roles, one of them ``command``.
    sequence : bool
        Whether the command is a number of actions, not a position.
    until : float, optional
        Instant of the log up to which it is read [s].

    Raises
    ------
    InputError
        As `role_log`.
    """
    raw, (log, lost) = log, complete(log)
    time, name = log.time, log.name
    first = _onset(time, log["command"], sequence=sequence, name=name)
    rate = 1.0 / float(np.median(np.diff(time)))
    seconds = _length(float(time[-1] - time[0]), float(time[-1] - first))
    if until is not None:
        seconds = until - first
    clock = np.arange(-round(BEFORE * rate), round(seconds * rate) + 1) / rate
    at = np.clip(clock + first, time[0], time[-1])
    channels = {r: on_clock(time, v, at, log.units[r]) for r, v in log.channels.items()}
    begin = log.start + first
    if not sequence:
        channels["command"] = _from_onset(raw, begin).at(clock)
    _check_motion(channels, name)
    findings = [f"{name}: too many samples missing, left out: {', '.join(lost)}"] if lost else []
    if until is None and time[-1] - first > _LONGEST * (1.0 + _LADDER):
        findings.append(f"{name}: read up to {_LONGEST:g} s after the first command")
    good = _there(raw, clock + begin)
    channels = {
        r: v if r == "command" else bridged(clock, np.where(good, v, np.nan), log.units[r])
        for r, v in channels.items()
    }
    ready = replace(log, time=clock, channels=channels, good=good, recording=None, start=begin)
    return ready, seconds, findings


def _there(raw: Log, at: Floats) -> Bools:
    """Tell at which of the file's instants a log has samples, shape (n,).

    After a longer gap neither does what follows count until the motion has forgotten what was
    commanded in it.
    """
    log = raw.on("command")
    instants = log.time[log.good] + log.start
    good = np.ones(len(at), dtype=np.bool_)
    usual = float(np.median(np.diff(instants)))
    for k in np.flatnonzero(np.diff(instants) > 1.5 * usual):
        first, last = instants[k], instants[k + 1]
        settles = _SETTLES if last - first > _LONG_GAP else 0.0
        good &= (at <= first) | (at >= last + settles)
    return good


def _from_onset(raw: Log, begin: float) -> CommandCurve:
    """Return the command of a log with its corners, in instants counted from the file's `begin`."""
    log = raw.on("command")
    curve = command_curve(log)
    return replace(curve, time=curve.time + (log.start - begin))


def complete(log: Log) -> tuple[Log, list[str]]:
    """The log on its command's clock, gaps bridged; roles with too many gaps are named."""
    if not log.has("command"):
        raise InputError(
            f"{log.name}: no channel has the role 'command': the test cannot be run on the model; "
            f"roles: {', '.join(log) or 'none'}"
        )
    log = log.on("command")
    if len(log.time) < _LEAST:
        raise InputError(f"{log.name}: {len(log.time)} samples; {_LEAST} are needed")
    lost = [r for r, v in log.channels.items() if np.isfinite(v).mean() < 1.0 - _MISSING]
    if "command" in lost:
        raise InputError(f"{log.name}: too many samples of the command are missing")
    channels = {
        r: bridged(log.time, v, log.units[r]) for r, v in log.channels.items() if r not in lost
    }
    time, channels = _slower(log.time, channels, log.units)
    return replace(log, time=time, channels=channels, good=np.ones(len(time), dtype=bool)), lost


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


def _check_motion(used: Mapping[str, Floats], name: str) -> None:
    seen = [values for role, values in used.items() if role not in INPUTS]
    if not any(np.ptp(values) > 0.0 for values in seen):
        raise InputError(f"{name}: nothing moves")


def _actions(wiring: str) -> tuple[str, ...]:
    """Return the actions that command a wiring; none where a position is commanded."""
    from elevon import _core

    return tuple(next(w for w in _core.wirings() if w["name"] == wiring)["actions"])


def _reading(
    raw: Log,
    log: Log,
    actuator: Actuator,
    *,
    seconds: float,
    findings: Sequence[str],
) -> RoleReading:
    """Return the test of a log: as it was recorded, and on instants counted from the onset."""
    from elevon import _core

    stand, wiring = raw.stand, actuator.wiring
    shows_load = any(signal["role"] == "load" for signal in _core.signals(wiring, "low"))
    own_load = stand.whole_load and shows_load
    read = not own_load and log.has("load")
    load, stroke = read_load(actuator, log.time, log.channels) if read else (None, None)
    named = None if raw.recording is None else raw.recording.meta.get("log")
    settings = {p: v for p, v in stand.parameters.items() if p in actuator.parameters}
    ready = of_a_magnet(actuator).with_values(dict(settings), source="stand of the log")
    if stroke is not None:
        ready = ready.with_values(stroke.settings(ready), source="load of the log")
    actions, stated = _actions(wiring), _core.initial(wiring, "low")
    initial = {n: v for n, v in stand.initial.items() if n in stated}
    return RoleReading(
        log,
        ready,
        1.0 / float(log.time[1] - log.time[0]),
        seconds,
        _actions_of(log) if actions else _lines_of(_from_onset(raw, log.start), log.time),
        actions,
        load,
        stroke,
        own_load,
        {**_initial(actuator, log.channels, stated), **initial},
        settings,
        f"{stand.name}: {named}" if stand.name and named else "",
        tuple(findings),
    )


def _actions_of(log: Log) -> tuple[Floats, Floats]:
    """Return the instants at which actions are commanded, and their numbers."""
    level = np.rint(log["command"])
    turns = np.concatenate(([0], np.flatnonzero(np.diff(level)) + 1))
    return log.time[turns], level[turns]


def _lines_of(command: CommandCurve, clock: Floats) -> tuple[Floats, Floats]:
    """Return straight lines of a command over a clock, corners and steps among their ends."""
    inside = (command.time > clock[0]) & (command.time < clock[-1])
    time = np.concatenate(([clock[0]], command.time[inside], [clock[-1]]))
    values = command.at(time)
    return lines(time, values, _EXACT * float(np.ptp(values)))


def _initial(
    actuator: Actuator, channels: Mapping[str, Floats], names: Sequence[str]
) -> dict[str, float]:
    """Where the model starts, as far as the log shows it."""
    start = {role: float(np.mean(values[:3])) for role, values in channels.items()}
    if "output_position" not in start:
        return {}
    position = start["output_position"]
    if "nut_position" in names:
        return {"nut_position": position}
    known = actuator.parameters
    lead = known.value("screw.lead") if "screw.lead" in known else 1.0
    ratio = known.value("gear.ratio") / lead
    half = 0.45 * known.value("backlash.total") * ratio
    motor = start.get("motor_position", position * ratio)
    # Within the backlash: a log's zeros need not be the model's.
    motor = min(max(motor, position * ratio - half), position * ratio + half)
    return {
        "motor_position": motor,
        "output_position": position,
        "motor_speed": start.get("motor_speed", 0.0),
    }
