"""The recording: what a run, or a bench, has to say."""

import os
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.errors import FormatError, InputError, did_you_mean, unknown
from elevon.recording.channel import Channel, ChannelSet, Clock, in_si
from elevon.recording.convert import to_arrow, to_pandas, to_xarray
from elevon.recording.header import Header, plain

if TYPE_CHECKING:
    from elevon.recording.formats import save as _save
    from elevon.recording.plot import plot as _plot

MAX_BYTES = 8 * 2**30


class _Later:
    """A method whose module is imported when it is first looked up: `import elevon` stays light."""

    def __init__(self, module: str) -> None:
        self._module = module

    def __set_name__(self, owner: type, name: str) -> None:
        self._owner, self._name = owner, name

    def __get__(self, instance: object, owner: type) -> Any:
        function = getattr(import_module(self._module), self._name)
        setattr(self._owner, self._name, function)
        return function.__get__(instance, owner)


def _copied(values: npt.ArrayLike) -> npt.ArrayLike:
    """Return a copy of values whose masked ones are NaN."""
    if np.ma.is_masked(values):
        return np.ma.filled(np.ma.asarray(values, dtype=np.float64), np.nan)
    return np.array(values)


class Recording(ChannelSet):
    """Named channels on one or several clocks, with what is known about them.

    A simulated run and a measured log are the same type. Channels are found by name
    (``recording["output_position"]``); values are SI and read-only.

    Parameters
    ----------
    channels : iterable of Channel
        Channels; two of them on one clock must hold the same `Clock`.
    clocks : iterable of Clock, optional
        Clocks that carry no channel.
    meta : mapping, optional
        What is known about the run: status, message, actuator, fidelity, seed, parameter hash,
        version, steps... Text, numbers, sequences and mappings only.
    labels : sequence or mapping, optional
        The faults really present.
    final : mapping, optional
        Signal name to last value (SI).

    Attributes
    ----------
    names : list of str
        Names of the channels.
    clocks : dict of str to Clock
        The clocks by name.
    meta, labels, final
        As given, in plain Python types.

    Raises
    ------
    InputError
        A name given twice (names differing only by case count as one), two clocks of one name, a
        `meta` that no file could hold.
    """

    def __init__(
        self,
        channels: Iterable[Channel],
        *,
        clocks: Iterable[Clock] = (),
        meta: Mapping[str, object] | None = None,
        labels: Sequence[object] | Mapping[str, object] | None = None,
        final: Mapping[str, float] | None = None,
    ) -> None:
        super().__init__(channels, clocks)
        self.meta: dict[str, Any] = plain(dict(meta or {}), "meta")
        self.labels: Any = plain(labels if labels is not None else [], "labels")
        self.final: dict[str, float] = plain(final or {}, "final")

    @classmethod
    def build(
        cls,
        time: npt.ArrayLike,
        values: Mapping[str, npt.ArrayLike],
        units: Mapping[str, str],
        *,
        clock: str = "main",
        rate: float | None = None,
        gaps: Sequence[int] | None = None,
        meta: Mapping[str, object] | None = None,
        labels: Sequence[object] | Mapping[str, object] | None = None,
    ) -> "Recording":
        """Make a recording on one clock from arrays in any units; `joined` adds further clocks.

        Parameters
        ----------
        time : array_like, shape (n,)
            Instants in s, strictly increasing, regular or not.
        values : mapping of str to array_like, shape (n,)
            Channel name to values, which are copied; NaN marks a missing sample, and what a mask
            hides becomes one.
        units : mapping of str to str
            The unit of every channel; values are converted to SI.
        clock : str
            Name of the clock.
        rate : float, optional
            Nominal rate in Hz.
        gaps : sequence of int, optional
            As for `Clock`; found from the rate when absent.
        meta, labels
            As for `Recording`.

        Returns
        -------
        Recording
            On one clock.

        Raises
        ------
        InputError
            A channel without unit, a unit without channel, or as for `Clock` and `Channel`.
        """
        for name in units:
            if name not in values:
                raise unknown("channel", name, values, "units")
        missing = [name for name in values if name not in units]
        if missing:
            raise InputError(f"units: no unit for the channels {', '.join(missing)}")
        base = Clock(clock, np.ma.copy(time), rate, gaps)
        channels = [in_si(name, units[name], _copied(values[name]), base) for name in values]
        return cls(channels, clocks=[base], meta=meta, labels=labels)

    @property
    def status(self) -> str:
        """`ok`, `tripped`, `diverged`, `interrupted`; `measured` when nothing was simulated."""
        return str(self.meta.get("status", "measured"))

    @property
    def time(self) -> npt.NDArray[np.float64]:
        """Time of the samples [s], shape (n,); of several clocks one has to be named."""
        return self.clock().time

    @property
    def roles(self) -> dict[str, str]:
        """Role (``"motor_speed"``) to channel name; empty where nothing says what is what.

        A simulated recording has it from its wiring, a log from its column map: ``meta["roles"]``.
        """
        stated = self.meta.get("roles")
        if not isinstance(stated, Mapping):
            return {}
        return {str(role): str(name) for role, name in stated.items() if name in self}

    def role(self, name: str) -> Channel:
        """Return the channel that has a role; `InputError` where none does, with those played."""
        roles = self.roles
        if name not in roles:
            known = ", ".join(roles) or "none: say them in a column map"
            hint = did_you_mean(name, roles)
            raise InputError(f"the recording has no {name!r}{hint}; roles: {known}")
        return self[roles[name]]

    def __repr__(self) -> str:
        clocks = ", ".join(repr(clock) for clock in self.clocks.values())
        return f"<Recording {self.status}: {len(self)} channels on [{clocks}]>"

    def _repr_html_(self) -> str:
        from elevon.recording.plot import recording_card

        return recording_card(self)

    def select(
        self, names: Iterable[str] | None = None, *, clock: str | None = None
    ) -> "Recording":
        """Return a recording with some of the channels, sharing their values.

        Parameters
        ----------
        names : iterable of str, optional
            Channels chosen, in this order; default all.
        clock : str, optional
            Only the channels of this clock.

        Raises
        ------
        UnknownNameError
            No such channel or clock, with the nearest names.
        """
        chosen = self.channels if names is None else [self[name] for name in names]
        clocks: list[Clock] = []
        if clock is not None:
            base = self.clock(clock)
            chosen, clocks = [channel for channel in chosen if channel.clock is base], [base]
        elif names is None:
            clocks = list(self.clocks.values())
        return self._with(chosen, clocks)

    def window(self, start: float = -np.inf, stop: float = np.inf) -> "Recording":
        """Return the part with start <= time <= stop (s), on every clock, sharing the values."""
        parts: dict[str, tuple[Clock, slice]] = {}
        for clock in self.clocks.values():
            first = int(np.searchsorted(clock.time, start, "left"))
            last = max(first, int(np.searchsorted(clock.time, stop, "right")))
            gaps = [gap - first for gap in clock.gaps if first <= gap < last - 1]
            part = slice(first, last)
            parts[clock.name] = Clock(clock.name, clock.time[part], clock.rate, gaps), part
        channels = []
        for c in self.channels:
            base, part = parts[c.clock.name]
            channels.append(Channel(c.name, c.unit, c.values[part], base, c.text))
        return self._with(channels, [clock for clock, _ in parts.values()])

    def joined(self, other: "Recording") -> "Recording":
        """Return a recording with the channels and clocks of both; meta of `other` wins.

        Raises
        ------
        InputError
            A channel or a clock of the same name in both.
        """
        labels = self.labels or other.labels
        return Recording(
            [*self.channels, *other.channels],
            clocks=[*self.clocks.values(), *other.clocks.values()],
            meta={**self.meta, **other.meta},
            labels=labels,
            final={**self.final, **other.final},
        )

    def with_meta(self, **entries: object) -> "Recording":
        """Return the same recording with entries of `meta` added or replaced."""
        same = self._with(self.channels, self.clocks.values())
        same.meta = plain({**self.meta, **entries}, "meta")
        return same

    def _with(self, channels: Iterable[Channel], clocks: Iterable[Clock]) -> "Recording":
        return Recording(
            channels, clocks=clocks, meta=self.meta, labels=self.labels, final=self.final
        )

    def equals(self, other: "Recording") -> bool:
        """Return whether two recordings are the same, to the last bit of every value."""
        return (
            Header.of(self).to_json() == Header.of(other).to_json()
            and all(self.clocks[name].equals(other.clocks[name]) for name in self.clocks)
            and all(self[name].equals(other[name]) for name in self.names)
        )

    to_pandas = to_pandas
    to_xarray = to_xarray
    to_arrow = to_arrow
    if not TYPE_CHECKING:
        plot = _Later("elevon.recording.plot")
        save = _Later("elevon.recording.formats")
    else:
        plot = _plot
        save = _save

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, max_bytes: int = MAX_BYTES) -> "Recording":
        """Read a file written by `save`. No code in it is ever run.

        Parameters
        ----------
        path : path
            The file.
        max_bytes : int
            The largest size in memory that is accepted; default 8 GiB.

        Raises
        ------
        FormatError
            Damaged, not a recording, or larger than `max_bytes`.
        InputError
            No such file, or an ending that is not a format.
        """
        from elevon.recording.formats import load

        loaded = dict(vars(load(path, max_bytes=max_bytes)))
        if old := loaded.pop("old"):
            from elevon.recording.contents import warn_of_old_names

            warn_of_old_names(path, old, 2)
        try:
            return cls(**loaded)
        except InputError as error:
            raise FormatError(f"{path}: {error}") from error
