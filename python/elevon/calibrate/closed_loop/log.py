"""A log as the closed loop needs it: what was demanded, and whatever of the motion was recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError, unknown

if TYPE_CHECKING:
    from elevon.recording import Recording

__all__ = ["CHANNELS", "ROLES", "LoopLog", "loop_log"]

Bools = npt.NDArray[np.bool_]

#: What a log may show, and what it is: output side, motor, torque current (peak) and its voltage.
CHANNELS: dict[str, str] = {
    "position": "position of the output",
    "motor_position": "angle of the motor",
    "speed": "speed of the output",
    "motor_speed": "speed of the motor",
    "current": "torque current",
    "voltage": "quadrature voltage",
}
#: Roles of a recording that serve a channel, and names that do where no roles are stated.
ROLES: dict[str, tuple[str, ...]] = {
    "position": ("output_position", "encoder_position", "output_position"),
    "motor_position": ("motor_position", "resolver_position"),
    "speed": ("output_speed", "output_speed"),
    "motor_speed": ("motor_speed", "resolver_speed"),
    "current": ("torque_current", "current_q_meas", "current_q"),
    "voltage": ("torque_voltage", "voltage_q_meas"),
}
_FEWEST = 50  # samples
_JUMP = 0.02  # of the demand's range within one sample, ...
_BETWEEN = 3  # points of the demand a sample
_ALONE = 5.0  # ... and so many times what changes beside it: a step, not a slope


@dataclass(frozen=True)
class LoopLog:
    """A log on its own clock, SI.

    Attributes
    ----------
    name : str
        File name.
    time : ndarray, shape (n,)
        s, from zero, increasing.
    command : ndarray, shape (n,)
        Position demanded, in the output's unit.
    signals : mapping of str to ndarray, shape (n,)
        Some of `CHANNELS`; NaN where a sample is missing.
    load : (ndarray, ndarray) or None
        Times and signed load on the output, where it was measured.
    magnitude : bool
        The current has no sign.
    used : ndarray of bool, shape (n,)
        Samples that count.

    Raises
    ------
    InputError
        Too short, time that does not increase, an unknown channel, a demand that never changes.
    """

    name: str
    time: Floats
    command: Floats
    signals: Mapping[str, Floats]
    load: tuple[Floats, Floats] | None = None
    magnitude: bool = False
    used: Bools = field(default_factory=lambda: np.empty(0, dtype=bool))

    def __post_init__(self) -> None:
        if len(self.time) < _FEWEST:
            raise InputError(f"{self.name}: {len(self.time)} samples; at least {_FEWEST}")
        if not np.all(np.diff(self.time) > 0.0):
            raise InputError(f"{self.name}: time does not increase")
        for channel in self.signals:
            if channel not in CHANNELS:
                raise unknown("channel", channel, CHANNELS, self.name)
        if not self.signals:
            raise InputError(f"{self.name}: nothing of the motion was recorded")
        if not float(np.ptp(self.command)) > 0.0:
            raise InputError(
                f"{self.name}: the demand never changes; nothing can be learned from it"
            )
        if not len(self.used):
            object.__setattr__(self, "used", np.ones(len(self.time), dtype=bool))

    @property
    def duration(self) -> float:
        """Length in s."""
        return float(self.time[-1])

    @cached_property
    def period(self) -> float:
        """Median of the clock's steps, s."""
        return float(np.median(np.diff(self.time)))

    def sigma(self, channel: str) -> float:
        """Return the spread of a channel about its mean over the samples that count."""
        return float(np.nanstd(self.signals[channel][self.used]))

    @cached_property
    def table(self) -> tuple[Floats, Floats]:
        """The demand as points: a jump stays a jump, between jumps the slope is continuous.

        Straight lines between samples would have a corner at each: a derivative on the error makes
        of them a current that steps in time with the log, always seen at the same place.
        """
        size = np.abs(np.diff(self.command))
        neighbour = np.maximum(np.append(size[1:], 0.0), np.insert(size[:-1], 0, 0.0))
        jump = (size > _JUMP * float(np.ptp(self.command))) & (size > _ALONE * neighbour)
        steps = np.flatnonzero(jump) + 1
        stretches = np.split(np.arange(len(self.time)), steps)
        ends = [*self.time[steps] - 1e-3 * np.diff(self.time)[steps - 1], None]
        points = [self._smooth(k, end) for k, end in zip(stretches, ends, strict=True)]
        return np.concatenate([p[0] for p in points]), np.concatenate([p[1] for p in points])

    def _smooth(self, k: npt.NDArray[np.intp], end: float | None) -> tuple[Floats, Floats]:
        """Return points of a stretch without jumps, held until just before the jump at its end."""
        from scipy.interpolate import Akima1DInterpolator

        times, values = self.time[k], self.command[k]
        if len(k) > 2 and float(np.ptp(values)) > 0.0:
            curve = Akima1DInterpolator(times, values)
            share = np.arange(_BETWEEN) / _BETWEEN
            fine = (times[:-1, None] + np.diff(times)[:, None] * share).ravel()
            times = np.append(fine, times[-1])
            values = curve(times)
        if end is not None:
            times, values = np.append(times, end), np.append(values, values[-1])
        return times, values

    def restricted(self, used: Bools) -> LoopLog:
        """Return the log with fewer samples that count."""
        return LoopLog(
            self.name, self.time, self.command, self.signals, self.load, self.magnitude,
            self.used & used,
        )  # fmt: skip

    def window(self, begin: float, end: float, settle: float) -> LoopLog:
        """Return a stretch as a log of its own, whose first `settle` seconds do not count."""
        keep = (self.time >= begin) & (self.time <= end)
        time = self.time[keep] - self.time[keep][0]
        return LoopLog(
            self.name, time, self.command[keep],
            {name: values[keep] for name, values in self.signals.items()},
            None if self.load is None else (self.load[0] - begin, self.load[1]),
            self.magnitude, self.used[keep] & (time >= settle),
        )  # fmt: skip

    def motion(self, per_output: float) -> tuple[Floats, Floats]:
        """Return motor speed and position error at the output, NaN where nothing shows them."""
        position = self.signals.get("position")
        if position is None and "motor_position" in self.signals:
            position = self.signals["motor_position"] / per_output
        if "motor_speed" in self.signals:
            speed = self.signals["motor_speed"]
        elif "speed" in self.signals:
            speed = self.signals["speed"] * per_output
        elif position is not None:
            speed = np.gradient(position, self.time) * per_output
        else:
            speed = np.full(len(self.time), np.nan)
        error = np.full(len(speed), np.nan) if position is None else self.command - position
        return np.asarray(speed, dtype=np.float64), np.asarray(error, dtype=np.float64)


def loop_log(recording: Recording, name: str, *, magnitude: bool | None = None) -> LoopLog:
    """Return what the closed loop needs of a recording, by the roles it states, else by names.

    Parameters
    ----------
    recording : Recording
        With a position command and at least one channel of the motion on the same clock.
    name : str
        Of the log.
    magnitude : bool, optional
        Whether the current has no sign; default: where it is never negative though the motion is.

    Raises
    ------
    InputError
        No command, nothing of the motion; and as `LoopLog`.
    """
    roles = recording.meta.get("roles")
    roles = roles if isinstance(roles, Mapping) else {}

    def channel(words: tuple[str, ...]) -> str | None:
        named = (str(roles[word]) for word in words if word in roles)
        return next((n for n in (*named, *words) if n in recording), None)

    command = channel(("command", "position_ref"))
    if command is None:
        raise InputError(f"{name}: no channel has the role 'command': nothing to run the loop on")
    clock = recording[command].time
    served = {key: channel(words) for key, words in ROLES.items()}
    signals = {
        key: np.interp(clock, recording[name].time, recording[name].values)
        for key, name in served.items()
        if name is not None
    }
    if magnitude is None:
        magnitude = _unsigned(signals)
    load = channel(("load", "load_force"))
    return LoopLog(
        name,
        np.asarray(clock - clock[0], dtype=np.float64),
        np.asarray(recording[command].values, dtype=np.float64),
        signals,
        None if load is None else (recording[load].time - clock[0], recording[load].values),
        magnitude,
    )


def _unsigned(signals: Mapping[str, Floats]) -> bool:
    """A current that is never below zero though the motion reverses has lost its sign."""
    current = signals.get("current")
    if current is None:
        return False
    moves = next((signals[k] for k in ("motor_speed", "speed") if k in signals), None)
    if moves is None:
        moves = np.gradient(
            next(signals[k] for k in ("position", "motor_position") if k in signals)
        )
    both = float(np.nanmin(moves)) < 0.0 < float(np.nanmax(moves))
    size = float(np.nanmax(np.abs(current)))
    return bool(both and size > 0.0 and float(np.nanmin(current)) > -0.02 * size)
