"""The recording: what a run, or a bench, has to say."""

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.errors import FormatError, InputError, unknown
from elevon.recording.channel import Channel, in_si
from elevon.recording.channel_set import ChannelSet
from elevon.recording.clock import Clock
from elevon.recording.header import Header, plain
from elevon.recording.roles import channel_of, roles_of
from elevon.recording.window import cut

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    import xarray as xr
    from matplotlib.figure import Figure

MAX_BYTES = 8 * 2**30


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
            Channel name to values; NaN marks a missing sample.
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
        base = Clock(clock, time, rate, gaps)
        channels = [in_si(name, units[name], values[name], base) for name in values]
        return cls(channels, clocks=[base], meta=meta, labels=labels)

    @property
    def status(self) -> str:
        """`ok`, `tripped`, `diverged`, `interrupted`; `measured` when nothing was simulated."""
        return str(self.meta.get("status", "measured"))

    @property
    def roles(self) -> dict[str, str]:
        """Role (``"motor_speed"``) to channel name; empty where nothing says what is what."""
        return roles_of(self)

    def role(self, name: str) -> Channel:
        """Return the channel that has a role; `InputError` where none does."""
        return channel_of(self, name)

    def __repr__(self) -> str:
        clocks = ", ".join(repr(clock) for clock in self.clocks.values())
        return f"<Recording {self.status}: {len(self)} channels on [{clocks}]>"

    def _repr_html_(self) -> str:
        from elevon.recording.notebook_card import recording_card

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
        channels, clocks = cut(self.channels, self.clocks.values(), start, stop)
        return self._with(channels, clocks)

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

    def to_pandas(self, clock: str | None = None, *, units: bool = False) -> "pd.DataFrame":
        """Return one clock's channels as a table indexed by time (s); units in ``attrs``.

        With `units` they also stand in the columns' names: ``output_position [rad]``.
        """
        from elevon.recording.convert import to_pandas

        return to_pandas(self, clock, units=units)

    def to_xarray(self) -> "xr.Dataset":
        """Return all channels as a dataset, one time dimension a clock, units as attributes.

        The dimension is ``time`` for a single clock, ``time_NAME`` for each of several.
        """
        from elevon.recording.convert import to_xarray

        return to_xarray(self)

    def to_arrow(self, clock: str | None = None) -> "pa.Table":
        """Return one clock's time and channels as an Arrow table, units in the field metadata."""
        from elevon.recording.convert import to_arrow

        return to_arrow(self, clock)

    def plot(
        self,
        names: Iterable[str] | None = None,
        path: str | os.PathLike[str] | None = None,
        *,
        units: Mapping[str, str] | None = None,
        title: str | None = None,
        compare: "Recording | str | os.PathLike[str] | None" = None,
        spectra: bool = False,
        force: bool = False,
    ) -> "Figure | Path":
        """Plot a run: command against output, error, current, speed, faults and states marked.

        With names, or where nothing says what is what: one panel for each unit and clock.

        Parameters
        ----------
        names : iterable of str, optional
            Channels; by default what shows how the run went, by the roles of the channels.
        path : path, optional
            ``.png``, ``.svg`` or ``.pdf`` for a picture, ``.html`` for one self-contained
            interactive page. Without it the matplotlib figure is returned and nothing written.
        units : mapping of str to str, optional
            Channel name to the unit displayed; default degrees, rpm and degC for angles, angular
            speeds and temperatures, else SI.
        title : str, optional
            Title; default the actuator's name.
        compare : Recording or path, optional
            Another run, drawn over this one: healthy beside faulty.
        spectra : bool
            Add the amplitude spectra of error, current and speed.
        force : bool
            Whether an existing file may be replaced.

        Returns
        -------
        Figure or Path
            The figure, or the file written.

        Raises
        ------
        UnknownNameError
            Unknown channel or file ending.
        OutputError
            The file exists already or cannot be written.
        """
        from elevon.recording.plot import plot

        names = None if names is None else list(names)
        return plot(
            self,
            names,
            path,
            units=units or {},
            title=title,
            compare=None if compare is None else self._other(compare),
            with_spectra=spectra,
            force=force,
        )

    @staticmethod
    def _other(given: "Recording | str | os.PathLike[str]") -> "tuple[str, Recording]":
        """Return another recording and what it is called in a legend."""
        if isinstance(given, Recording):
            return str(given.meta.get("label") or "other"), given
        return Path(given).name, Recording.load(given)

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Write the recording to a file, whole or not at all.

        Parameters
        ----------
        path : path
            The ending chooses the format: ``.parquet``, ``.nc``, ``.mat`` (version 5, at most
            2 GB), ``.csv`` (a plain table with ``NAME.csv.json`` beside it; several clocks: one
            table ``NAME.CLOCK.csv`` each). All give back every bit on load.
        force : bool
            Whether an existing file may be replaced.

        Returns
        -------
        Path
            The file written.

        Raises
        ------
        UnknownNameError
            Another ending.
        InputError
            Something this format cannot hold.
        OutputError
            The file exists already or cannot be written.
        """
        from elevon.recording.formats import save

        return save(self, path, force=force)

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
        from elevon.recording.old import warn_of_old_names

        loaded = dict(vars(load(path, max_bytes=max_bytes)))
        if old := loaded.pop("old"):
            warn_of_old_names(path, old, 2)
        try:
            return cls(**loaded)
        except InputError as error:
            raise FormatError(f"{path}: {error}") from error
