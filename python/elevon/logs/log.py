"""The one log: channels by role on one clock, and what stands beside them.

A measured log and a simulation's own recording are the same thing here. Whoever needs another
clock, fewer channels or samples makes another `Log` of it; there is no second class.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np
import numpy.typing as npt

from elevon.arrays import Bools, Floats
from elevon.errors import InputError, did_you_mean
from elevon.logs.brake import Brake, brake_of
from elevon.logs.command.note import CommandNote
from elevon.recording import Recording
from elevon.recording.channel import Channel

Value = TypeVar("Value")
Arguments = ParamSpec("Arguments")
#: Roles by whose channel the clock is chosen, where no other is named.
_CLOCKS = ("speed_ref", "command", "output_position", "torque_current")
_FEWEST_STEPS = 30  # of a clock that has a usual one
_UNEVEN = 0.25  # of the usual step: half of the steps stray by more where there is none
_LONG_STEP = 1.5  # usual steps: more than that lacks a row
_MOST_MISSING = 4.0  # times the rows: a clock that lacks more is no clock with gaps
_NEAR = 1.0  # s of the brake's level that a part of a log keeps beyond its ends


@dataclass(frozen=True)
class StandSettings:
    """What the stand that wrote a log set, as its recording states it.

    Attributes
    ----------
    name : str
        Of the stand; empty where none is stated.
    parameters : mapping of str to float or str
        Values of the actuator and its load, by path.
    initial : mapping of str to float or str
        Where the motion began, by signal.
    moves_output : bool
        Whether a rig moved the output.
    cutoff : float
        Of the recorder's filter [Hz]; 0 where none is stated.
    whole_load : bool
        Whether the role ``load`` is the whole load, as a run records it; else the stand's force.
    """

    name: str = ""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    initial: Mapping[str, Any] = field(default_factory=dict)
    moves_output: bool = False
    cutoff: float = 0.0
    whole_load: bool = False

    @classmethod
    def of(cls, recording: Recording) -> StandSettings:
        """Return what a recording states."""
        stated, filtered = recording.meta.get("stand"), recording.meta.get("acquisition")
        cutoff = float(filtered.get("cutoff_hz", 0.0)) if isinstance(filtered, Mapping) else 0.0
        if not isinstance(stated, Mapping):
            return cls(cutoff=cutoff, whole_load="scenario" in recording.meta)
        return cls(
            str(stated.get("name", "")),
            dict(stated.get("parameters", {})),
            dict(stated.get("initial", {})),
            bool(stated.get("rig_moves")),
            cutoff,
        )


@dataclass(frozen=True, eq=False)
class Log:
    """A log, SI.

    Attributes
    ----------
    name : str
        Of the file.
    time : ndarray, shape (n,)
        Seconds, increasing; from the first sample unless something else is stated.
    channels : mapping of str to ndarray, shape (n,)
        Role to values; NaN where a sample is missing.
    units : mapping of str to str
        Role to SI unit, where known.
    good : ndarray of bool, shape (n,)
        Samples that count. Rows that the file lacks stand here as instants without a value that do
        not count (`gaps_filled`); all others count, unless stated.
    start : float
        The file's instant of `time` zero [s].
    note : CommandNote or None
        What the operator knows.
    brake : Brake
        What is known of the brake.
    stand : StandSettings
        What the stand set.
    gain : (float, float) or None
        Position gain and its deviation [1/s], where a waveform of the command was fitted with it.
    warnings : tuple of str
        What the import warned of.
    recording : Recording or None
        What was read, on its own clocks.
    """

    name: str
    time: Floats
    channels: Mapping[str, Floats]
    units: Mapping[str, str] = field(default_factory=dict)
    good: Bools = field(default_factory=lambda: np.empty(0, dtype=np.bool_))
    start: float = 0.0
    note: CommandNote | None = None
    brake: Brake = field(default_factory=Brake.none)
    stand: StandSettings = field(default_factory=StandSettings)
    gain: tuple[float, float] | None = None
    warnings: tuple[str, ...] = ()
    recording: Recording | None = field(default=None, repr=False)
    memory: dict[object, Any] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        if len(self.good) != len(self.time):
            object.__setattr__(self, "good", np.ones(len(self.time), dtype=np.bool_))

    @classmethod
    def of(
        cls,
        recording: Recording,
        name: str,
        *,
        note: CommandNote | None = None,
        warnings: Sequence[str] = (),
        clock: str | None = None,
    ) -> Log:
        """Return the log of a recording, on the clock of the channel with the role `clock`.

        Channels of other clocks are read at its instants: states as they were last, the others
        along straight lines.

        Raises
        ------
        InputError
            No channel has a role, or none that one.
        """
        served = _served(recording)
        if clock is None:
            clock = next((r for r in (*_CLOCKS, *served) if r in served), None)
        if clock not in served:
            raise InputError(f"{name}: no channel has the role {clock!r}; roles: {_list(served)}")
        base = served[clock].clock
        time = np.asarray(base.time, dtype=np.float64)
        channels = {
            role: np.array(c.values, dtype=np.float64)
            if c.clock is base
            else on_clock(c.time, c.values, time, c.unit)
            for role, c in served.items()
        }
        units = {role: c.unit for role, c in served.items()}
        start = float(time[0]) if len(time) else 0.0
        time, channels, good = gaps_filled(time - start, channels)
        speed = bridged(time, channels["motor_speed"]) if "motor_speed" in channels else None
        return cls(
            name, time, channels, units, good, start, note=note, warnings=tuple(warnings),
            brake=brake_of(recording, note, time, start, speed), stand=StandSettings.of(recording),
            recording=recording,
        )  # fmt: skip

    def on(self, role: str) -> Log:
        """Return the log on the clock of the channel that has a role; as `of`."""
        if self.recording is None or not len(self.time):
            return self
        channel = _served(self.recording).get(role)
        if channel is not None:
            whole = gaps_filled(np.asarray(channel.time) - self.start, {})[0]
            if np.array_equal(whole, self.time):
                return self
        return Log.of(self.recording, self.name, note=self.note, warnings=self.warnings, clock=role)

    @cached_property
    def period(self) -> float:
        """Median spacing of the samples [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def duration(self) -> float:
        """Last instant [s]."""
        return float(self.time[-1])

    @property
    def current(self) -> Floats:
        """Torque current [A]; where none was measured, its set point."""
        return self["torque_current" if self.has("torque_current") else "current_ref"]

    @property
    def current_target(self) -> Floats:
        """Set point of the torque current [A]; where none was logged, the current."""
        return self["current_ref" if self.has("current_ref") else "torque_current"]

    @property
    def speed_ref(self) -> Floats:
        """Set point of the motor's speed [rad/s]."""
        return self["speed_ref"]

    @property
    def speed(self) -> Floats:
        """Speed of the motor [rad/s]."""
        return self["motor_speed"]

    @property
    def motor(self) -> Floats:
        """Angle of the motor [rad]."""
        return self["motor_position"]

    @property
    def output(self) -> Floats:
        """Position of the output, in its unit."""
        return self["output_position"]

    def has(self, *roles: str) -> bool:
        """Whether all of some roles were recorded."""
        return all(role in self.channels for role in roles)

    def get(self, role: str) -> Floats | None:
        """Return a channel, None where it was not recorded."""
        return self.channels.get(role)

    def __getitem__(self, role: str) -> Floats:
        if role not in self.channels:
            hint = did_you_mean(role, self.channels)
            roles = _list(self.channels)
            raise InputError(f"{self.name}: no channel has the role {role!r}{hint}; roles: {roles}")
        return self.channels[role]

    def __iter__(self) -> Iterator[str]:
        return iter(self.channels)

    def with_channels(self, **channels: Floats) -> Log:
        """Return the log with channels added or replaced, by role."""
        return replace(self, channels={**self.channels, **channels})

    def without(self, *roles: str) -> Log:
        """Return the log with channels left out."""
        return replace(self, channels={r: v for r, v in self.channels.items() if r not in roles})

    def counting(self, keep: Bools) -> Log:
        """Return the log with fewer samples that count."""
        return replace(self, good=self.good & keep)

    def after(self, transient: float) -> Log:
        """Return the log in which what comes before an instant [s] does not count.

        Raises
        ------
        InputError
            No instant of the log.
        """
        if not 0.0 <= transient < self.duration:
            raise InputError(f"transient of {transient:g} s: {self.name} lasts {self.duration:g} s")
        return self.counting(self.time >= transient)

    def part(self, keep: Bools, first: float, last: float) -> Log:
        """Return the samples between two instants [s] as a log of its own, from zero."""
        brake = self.brake
        if len(brake.time):
            near = (brake.time >= first - _NEAR) & (brake.time <= last + _NEAR)
            brake = replace(brake, time=brake.time[near] - first, level=brake.level[near])
        return replace(
            self,
            time=self.time[keep] - first,
            channels={role: values[keep] for role, values in self.channels.items()},
            good=self.good[keep],
            start=self.start + first,
            brake=brake,
            recording=None,
        )


def per_log(
    function: Callable[Concatenate[Log, Arguments], Value],
) -> Callable[Concatenate[Log, Arguments], Value]:
    """Make a function of a log, and of numbers beside it, keep its results with the log."""

    @wraps(function)
    def once(log: Log, /, *given: Arguments.args, **named: Arguments.kwargs) -> Value:
        work = (function, given, tuple(named.items())) if given or named else function
        if work not in log.memory:
            log.memory[work] = function(log, *given, **named)
        return log.memory[work]  # type: ignore[no-any-return]

    return once


def on_clock(at: npt.ArrayLike, values: npt.ArrayLike, time: Floats, unit: str = "") -> Floats:
    """Return values, shape (m,), at other instants, shape (n,); of a state (unit 1) the last."""
    places, known = (np.asarray(x, dtype=np.float64) for x in (at, values))
    if unit == "1":
        return np.asarray(known[(np.searchsorted(places, time + 1e-9, side="right") - 1).clip(0)])
    return np.asarray(np.interp(time, places, known), dtype=np.float64)


def bridged(time: Floats, values: Floats, unit: str = "") -> Floats:
    """Return a channel without gaps, shape (n,); one without any sample stays as it is."""
    good = np.isfinite(values)
    if good.all() or not good.any():
        return values
    return on_clock(time[good], values[good], time, unit)


def gaps_filled(
    time: Floats, channels: Mapping[str, Floats]
) -> tuple[Floats, dict[str, Floats], Bools]:
    """Return a clock, its channels and what counts, with an instant for every row that is missing.

    Instants of the file stay to the last bit. Between two that lie farther apart than 1.5 usual
    steps, instants are added at the usual spacing; there every channel is NaN and nothing counts.
    A clock without a usual step (half of its steps stray by more than a quarter of it), or with
    more gaps than rows, is left as it is.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds, increasing.
    channels : mapping of str to ndarray, shape (n,)
        By role.

    Returns
    -------
    time, channels, good
        Shapes (m,), m at least n.
    """
    same = time, dict(channels), np.ones(len(time), dtype=np.bool_)
    steps = np.diff(time)
    if len(steps) < _FEWEST_STEPS:
        return same
    period = float(np.median(steps))
    if float(np.median(np.abs(steps / period - 1.0))) > _UNEVEN:
        return same
    missing = np.where(steps > _LONG_STEP * period, np.rint(steps / period) - 1.0, 0.0)
    count = missing.astype(np.intp)
    if not 0 < count.sum() <= _MOST_MISSING * len(time):
        return same
    places = np.arange(len(time)) + np.concatenate(([0], np.cumsum(count)))
    good = np.zeros(len(time) + int(count.sum()), dtype=np.bool_)
    good[places] = True
    whole = np.interp(np.arange(len(good)), places, time)
    whole[places] = time
    out = {}
    for role, values in channels.items():
        out[role] = np.full(len(good), np.nan)
        out[role][places] = values
    return whole, out, good


def _served(recording: Recording) -> dict[str, Channel]:
    """Role to channel, as the recording states it; where it states nothing, by known names."""
    if "roles" in recording.meta:
        return {role: recording[name] for role, name in recording.roles.items()}
    from elevon.logs.maps.column_map import known_signals

    known = known_signals()
    named = {known[c.name].role: c for c in reversed(recording.channels) if c.name in known}
    return {role: channel for role, channel in named.items() if role}


def _list(roles: Mapping[str, object]) -> str:
    return ", ".join(roles) or "none"
