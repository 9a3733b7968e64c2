"""Windows of an actuator that is read by the roles of its logs: periods of its command, or actions.

A position that is commanded periodically is cut into its periods; of an actuator that is commanded
by actions each window begins with the action that its baselines begin with.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.replay import Replay, replay
from elevon.diagnose.engine.table import FeatureVector
from elevon.diagnose.monitor.cutter import Bools, CutWindow, WindowCutter
from elevon.diagnose.monitor.windows import NO_MOTION, OTHER, Day, Windows, apart, stretch, usable
from elevon.diagnose.roles.log import complete, role_log
from elevon.diagnose.roles.numbers import Numbers, noise_deviation
from elevon.diagnose.roles.reading import BEFORE, RoleReading
from elevon.errors import InputError
from elevon.logs.log import Log, on_clock

if TYPE_CHECKING:
    from collections.abc import Mapping

    from elevon.actuator import Actuator
    from elevon.diagnose.engine.candidates import CandidateFault


@dataclass
class CommandCutter(WindowCutter):
    """Cuts where a command is `fast` away from where the day began; `speed` is its channel."""

    def _moving(self, values: Floats) -> Bools:
        command = values[:, self.speed]
        known = command[np.isfinite(command)]
        if math.isnan(self.place.level) and known.size:
            self.place.level = float(known[0])
        return np.asarray(np.abs(command - self.place.level) > self.fast)


@dataclass
class ActionCutter(WindowCutter):
    """Cuts a window wherever the action `fast` is commanded anew; between them the unit rests."""

    def _moving(self, values: Floats) -> Bools:
        level = np.rint(values[:, self.speed])
        before = np.concatenate(([self.place.level], level[:-1]))
        return np.asarray((level == self.fast) & np.isfinite(before) & (before != self.fast))

    def _push(self, time: Floats, values: Floats) -> None:
        command = values[:, self.speed]
        known = command[np.isfinite(command)]
        if known.size:
            self.place.level = float(np.rint(known[-1]))
        super()._push(time, values)

    def _close(self) -> CutWindow:
        out = super()._close()
        self.place.fast = math.nan
        return out


_CLOSE = 0.06  # of the command's range, RMS: two periods differ by less; square waves by a sample
_AWAY_REPEATS = 0.15  # likewise: a command has gone away
_REPEATS = 1.0  # periods, beside the first, that a command must show


def period_of(time: Floats, command: Floats, name: str) -> float:
    """Return the period of a command [s].

    Parameters
    ----------
    time : ndarray, shape (n,)
        Even, from the instant at which it began [s].
    command : ndarray, shape (n,)
        What was commanded.
    name : str
        Of the log.

    Raises
    ------
    InputError
        It does not repeat, or not within the log.
    """
    lags, off = _differences(command)
    size = max(float(np.ptp(command)), 1e-300)
    away = np.flatnonzero(off > _AWAY_REPEATS * size)
    back = np.flatnonzero(off < _CLOSE * size)
    back = back[back > away[0]] if away.size else back[:0]
    if not back.size:
        raise InputError(
            f"{name}: its command does not repeat within {time[-1] - time[0]:g} s, so it is not "
            "watched: elevon diagnose takes such a log as a whole; a longer baseline, or --window "
            "with the width of one period, where the motion does repeat"
        )
    near = back[: int(np.argmax(np.append(np.diff(back), 2) > 1)) + 1]  # the first dip
    lowest = int(near[np.argmin(off[near])])
    return float(_between(lags, off, lowest) * (time[1] - time[0]))


def _differences(command: Floats) -> tuple[Floats, Floats]:
    """Lags, in samples, and the RMS of the command's change over each."""
    count = len(command)
    most = int(count / (1.0 + _REPEATS))
    x = command - command.mean()
    size = 1 << (2 * count - 1).bit_length()
    spectrum = np.fft.rfft(x, size)
    product = np.fft.irfft(spectrum * spectrum.conj(), size)[: most + 1]
    square = np.concatenate(([0.0], np.cumsum(x**2)))
    lags = np.arange(most + 1)
    ends = square[count - lags] + square[count] - square[lags]
    off = np.sqrt(np.maximum(ends - 2.0 * product, 0.0) / (count - lags))
    return lags.astype(np.float64), off


def _between(lags: Floats, off: Floats, lowest: int) -> float:
    """Where the square of a dip is least, by the parabola through three lags."""
    if not 0 < lowest < len(lags) - 1:
        return float(lags[lowest])
    before, here, after = off[lowest - 1 : lowest + 2] ** 2
    bend = before - 2.0 * here + after
    return float(lags[lowest] + (0.5 * (before - after) / bend if bend > 0.0 else 0.0))


def least_difference(a: Floats, b: Floats) -> float:
    """Return the RMS by which two periods of equal length differ, one turned to fit best."""
    x, y = a - a.mean(), b - b.mean()
    product = np.fft.irfft(np.fft.rfft(x) * np.fft.rfft(y).conj(), len(x))
    square = np.mean(x**2) + np.mean(y**2) - 2.0 * float(product.max()) / len(x)
    return float(np.sqrt(max(square, 0.0)))


def begins(command: Floats, action: int) -> list[int]:
    """Return the samples at which an action is commanded anew."""
    level = np.rint(command)
    return [int(k) for k in np.flatnonzero((level[1:] == action) & (level[:-1] != action)) + 1]


def first_action(command: Floats, name: str) -> int:
    """Return the action that is commanded first.

    Raises
    ------
    InputError
        None is.
    """
    level = np.rint(command[np.isfinite(command)])
    turns = np.flatnonzero(np.diff(level)) + 1
    if not turns.size:
        raise InputError(f"{name}: nothing is commanded: the command never changes")
    return int(level[turns[0]])


_LEAST = 200  # samples of a window that may be used
_LEAD = 1.0  # s of a motion's beginning that are left out at least, as of a turning servo's
_AWAY = 0.01  # of the command's range: beyond it the motion has begun
_COMPLETE = 0.98  # of a channel's samples in a window: a bridged gap looks like a fault
_RATE = 0.02  # relative difference of two sampling rates that are one
_LATER = 0.1  # of a log's length by which another may begin its only action later
_SHORT = 0.98  # of the time between two actions that a window takes
_ALIKE = 0.05  # of the command's range, RMS, by which a window's command may differ
_OTHERWISE = 0.05  # of a window's samples that may be commanded otherwise
_NOISE = 3.0  # deviations of its noise below which a load is none
#: Of the least deviation from day to day that of two windows of one day: temperatures, supply and
#: friction are the same, clocks and ripple are not. ASSUMED.
_WITHIN_DAY = 0.3
#: Read where a baseline has them; without the first nothing is watched.
_NEEDED = ("command", "output_position")


@dataclass(frozen=True, eq=False)
class WindowReading(RoleReading):
    """A test of which only a window is seen: from `first` [s] on."""

    first: float = 0.0

    @cached_property
    def inside(self) -> Floats:
        """Instants of the window [s]."""
        return self.log.time[self.log.time >= self.first - 1e-9]

    def _numbers(self, channels: Mapping[str, Floats], *, noisy: bool = False) -> Numbers:
        count = len(self.inside)
        if count == len(self.log.time):
            return super()._numbers(channels, noisy=noisy)
        part = replace(
            self, log=self.log.part(self.log.time >= self.first - 1e-9, 0.0, self.seconds)
        )
        tail = {role: values[-count:] for role, values in channels.items()}
        return part._numbers(tail, noisy=noisy)

    def digest(self) -> bytes:
        """Of all in the log that its model runs depend on."""
        return super().digest() + repr(self.first).encode()


class RoleWindows(Windows):
    """Windows of an actuator that is read by roles.

    Parameters
    ----------
    actuator : Actuator
        The healthy unit.
    baselines : sequence of Log
        Of it.
    window : float, optional
        Width [s]; default: the command's period, or what an action takes.
    """

    within_day = _WITHIN_DAY
    # A day's windows repeat better than the model knows them, healthy or not.
    of_faults = 1.0

    def __init__(
        self, actuator: Actuator, baselines: Sequence[Log], window: float | None = None
    ) -> None:
        from elevon import _core

        self.actuator = actuator
        self.baselines = [self.ready(log) for log in baselines]
        first, *others = self.baselines
        self.roles = tuple(r for r in first.channels if all(log.has(r) for log in others))
        wirings = {w["name"]: w["actions"] for w in _core.wirings()}
        self._sequence = bool(wirings[actuator.wiring])
        self._even = [complete(log)[0] for log in self.baselines]
        command = self._even[0]["command"]
        self._range = float(np.ptp(command))
        self._action = first_action(command, first.name) if self._sequence else 0
        self.width = window if window is not None else self._width()

    def _width(self) -> float:
        """Return a period of the command, or what the action takes in every baseline."""
        if self._sequence:
            return min(map(self._until_again, self._even))
        first = self._even[0]
        away = np.abs(first["command"] - first["command"][0]) > _AWAY * self._range
        moving = slice(int(np.argmax(away)), None)
        return period_of(first.time[moving], first["command"][moving], first.name)

    def _until_again(self, log: Log) -> float:
        at = begins(log["command"], self._action)
        if not at:
            raise InputError(
                f"{log.name}: begins with another action than {self.baselines[0].name}; all "
                "baselines show the motion that is watched"
            )
        if len(at) > 1:
            return _SHORT * float(np.diff(log.time[at]).min())
        return role_log(log, self.actuator).seconds - _LATER * log.duration

    @property
    def _lead(self) -> float:
        """What is left out of a motion's beginning [s]: its first period is not like the others."""
        return 0.0 if self._sequence else max(_LEAD, self.width)

    def ready(self, log: Log) -> Log:
        """Return a log as it is fed."""
        if not log.has("command"):
            raise InputError(
                f"{log.name}: no channel has the role 'command': the motion cannot be run on the "
                f"model; roles: {', '.join(log) or 'none'}"
            )
        return replace(log.on("command"), recording=None)

    def watched(self, name: str, roles: Sequence[str]) -> tuple[str, ...]:
        """Return those roles of a day that are watched."""
        missing = [role for role in self.roles if role not in roles]
        if missing:
            raise InputError(
                f"{name}: no channel has the role {', '.join(missing)}, which the baselines have; "
                f"roles: {', '.join(roles) or 'none'}"
            )
        return self.roles

    def cutter(self, day: Day) -> WindowCutter:
        """Return what cuts a day."""
        command, needed = day.roles.index("command"), day.at(*_NEEDED)
        if self._sequence:
            return ActionCutter(self.width, 0.0, float(self._action), command, needed)
        return CommandCutter(self.width, self._lead, _AWAY * self._range, command, needed)

    def read(self, day: Day, window: CutWindow, *, any_motion: bool = False) -> FeatureVector | str:
        """Return the features of a window, or why it is not used."""
        if not usable(window, _LEAST):
            return NO_MOTION
        raw = day.log(window, self.baselines[0].units)
        gappy = [r for r, v in raw.channels.items() if np.isfinite(v).mean() < _COMPLETE]
        if "command" in gappy or len(gappy) >= len(raw.channels) - 1:
            return NO_MOTION
        log, _ = complete(raw.without(*gappy))
        template = self._template
        if abs(log.period * template.rate - 1.0) > _RATE:
            return f"not sampled at the baselines' {template.rate:.4g} Hz"
        at = template.inside - template.inside[0] + log.time[0]
        channels = {r: on_clock(log.time, v, at, log.units[r]) for r, v in log.channels.items()}
        reading = replace(template, log=replace(log, time=template.inside, channels=channels))
        if not any_motion and self._otherwise(reading.log):
            return OTHER
        return reading.features

    @cached_property
    def _template(self) -> WindowReading:
        """The first window of the first baseline, with the motion up to it."""
        day, window = next(self.cut(self.baselines[0]), (None, None))
        if day is None or window is None:
            raise InputError(
                f"{self.baselines[0].name}: has no whole window of {self.width:g} s behind the "
                f"first {self._lead:g} s of its motion"
            )
        # A window begins half a sample early, so that rounding decides nothing.
        log = stretch(self.baselines[0], 0.0, window.end + BEFORE)
        reading = role_log(log, self.actuator, until=window.end)
        first = reading.seconds - self.width
        values = {f.name: getattr(reading, f.name) for f in fields(reading)}
        return WindowReading(**values, first=first)

    @cached_property
    def _motion(self) -> Log:
        template = self._template
        return template.log.part(template.log.time >= template.first - 1e-9, 0.0, 0.0)

    def _otherwise(self, log: Log) -> bool:
        """Whether a window shows another motion or load than the baselines."""
        if self._sequence:
            levels = [np.rint(x["command"]) for x in (log, self._motion)]
            return bool(np.mean(levels[0] != levels[1]) > _OTHERWISE)
        off = least_difference(log["command"], self._motion["command"])
        return off > _ALIKE * self._range or apart([_force(log)], [_force(self._motion)])

    def model(self, candidates: Sequence[CandidateFault]) -> Replay:
        """Return what the model shows in a window, healthy and with each fault."""
        return replay(self._template, candidates)


def _force(log: Log) -> float:
    """RMS of the load, zero where it is noise."""
    load = log.get("load")
    if load is None:
        return 0.0
    rms = float(np.sqrt(np.mean(load**2)))
    return rms if rms > _NOISE * noise_deviation(load) else 0.0
