"""The test behind a log: what was commanded, what loaded it, and where it began, for the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.roles.load import OverStroke, load_alike, read_load
from elevon.diagnose.roles.series import lines

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

#: What is put in, not measured.
INPUTS = frozenset(["command", "load"])
BEFORE = 0.1  # s before the onset that are read
_EXACT = 2e-4  # of the command's range: what straight lines may miss
_ALIKE = 0.05  # of the command's range, RMS, up to which two commands are the same
_SOONER = 1.3  # times the length of a log's baseline that the log may have
_LATE = 0.1  # s between two logs' actions


@dataclass(frozen=True, eq=False)
class RoleTest:
    """The test of a log, counted from its onset.

    Attributes
    ----------
    log : Log
        On an even clock whose zero is the onset; it begins `BEFORE` it.
    rate : float
        Hz.
    seconds : float
        After the onset.
    command : (ndarray, ndarray)
        Instants and values of straight lines; of actions, instants and numbers.
    load : (ndarray, ndarray) or None
        Instants and force or torque on the output, positive where it opposes positive motion; with
        a load over the stroke what that leaves.
    stroke : OverStroke or None
        Load over the position, for a model that has one.
    own_load : bool
        Whether the model loads itself: the log's load is then an output, not an input.
    initial : mapping of str to float or str
        Signal to where it starts.
    settings : mapping of str to object
        Parameters that the stand set.
    note : str
        Stand and step that the log names, if any.
    findings : tuple of str
        What the caller should know.
    """

    log: Log
    rate: float
    seconds: float
    command: tuple[Floats, Floats]
    load: tuple[Floats, Floats] | None
    stroke: OverStroke | None
    own_load: bool
    initial: Mapping[str, float | str]
    settings: Mapping[str, Any]
    note: str = ""
    findings: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Of the log."""
        return self.log.name

    @cached_property
    def seen(self) -> Mapping[str, Floats]:
        """What the log shows, not what was put in: role to values, shape (n,)."""
        own_load = {"load"} if self.own_load else set()
        return {r: v for r, v in self.log.channels.items() if r not in INPUTS - own_load}

    def within(self, seconds: float) -> RoleTest:
        """Return the test up to some seconds after its onset."""
        keep = self.log.time < seconds * (1.0 + 1e-9)
        log = self.log.part(keep, 0.0, seconds)
        return replace(self, log=log, seconds=min(seconds, self.seconds))


def action_numbers(wiring: str) -> tuple[str, ...]:
    """Return the actions that command a wiring; none where a position is commanded."""
    from elevon import _core

    return tuple(next(w for w in _core.wirings() if w["name"] == wiring)["actions"])


def test_of(
    raw: Log,
    log: Log,
    actuator: Actuator,
    *,
    rate: float,
    seconds: float,
    findings: Sequence[str],
) -> RoleTest:
    """Return the test of a log: as it was recorded, and on instants counted from the onset."""
    stand = raw.stand
    loads_itself = stand.whole_load and _shows_load(actuator.wiring)
    none = loads_itself or not log.has("load")
    load, stroke = (None, None) if none else read_load(actuator, log.time, log.channels)
    named = None if raw.recording is None else raw.recording.meta.get("log")
    return RoleTest(
        log,
        rate,
        seconds,
        _command_of(log.time, log["command"], sequence=bool(action_numbers(actuator.wiring))),
        load,
        stroke,
        loads_itself,
        {**_initial(actuator, log.channels), **_stated(actuator.wiring, stand.initial)},
        {p: v for p, v in stand.parameters.items() if p in actuator.parameters},
        f"{stand.name}: {named}" if stand.name and named else "",
        tuple(findings),
    )


def _shows_load(wiring: str) -> bool:
    from elevon import _core

    return any(signal["role"] == "load" for signal in _core.signals(wiring, "low"))


def _command_of(time: Floats, command: Floats, *, sequence: bool) -> tuple[Floats, Floats]:
    if sequence:
        level = np.rint(command)
        turns = np.concatenate(([0], np.flatnonzero(np.diff(level)) + 1))
        return time[turns], level[turns]
    return lines(time, command, _EXACT * float(np.ptp(command)))


def _initial(actuator: Actuator, channels: Mapping[str, Floats]) -> dict[str, float | str]:
    """Where the model starts, as far as the log shows it."""
    from elevon import _core

    names = _core.initial(actuator.wiring, "low")
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


def _stated(wiring: str, given: Mapping[str, Any]) -> dict[str, Any]:
    from elevon import _core

    names = _core.initial(wiring, "low")
    return {name: value for name, value in given.items() if name in names}


def same_test(a: RoleTest, b: RoleTest) -> bool:
    """Whether a second log, a baseline, was commanded the same as a first, and loaded alike.

    It may go on for longer, as it is read as far as the first, and end a little sooner: a bench
    that is started by hand cuts a short log's end off.
    Of two logs that name their step the load needs be no nearer: it may follow from a motion that
    a fault has changed.
    """
    seconds = min(a.seconds, b.seconds)
    if a.seconds > _SOONER * seconds:
        return False
    grid = np.linspace(0.0, seconds, 200)
    size = max(float(np.ptp(a.command[1])), 1e-12)
    apart = _command_change(a, grid) - _command_change(b, grid)
    if float(np.sqrt(np.mean(apart**2))) > _ALIKE * size:
        return False
    if a.note and a.note == b.note and a.settings == b.settings:
        return True
    return load_alike((a.load, a.stroke), (b.load, b.stroke), grid)


def _command_change(test: RoleTest, grid: Floats) -> Floats:
    """A command relative to where it began; actions are few and start alike."""
    times, values = test.command
    return np.asarray(np.interp(grid, times, values) - values[0], dtype=np.float64)
