"""Named channels on one or several clocks, before anything is known about them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from elevon.errors import InputError, unknown
from elevon.recording.channel import Channel
from elevon.recording.clock import Clock


class ChannelSet:
    """Channels by name, each on one of the clocks.

    Parameters
    ----------
    channels : iterable of Channel
        Channels; two of them on one clock must hold the same `Clock`.
    clocks : iterable of Clock
        Clocks that carry no channel.

    Raises
    ------
    InputError
        A name given twice (names differing only by case count as one), two clocks of one name.
    """

    def __init__(self, channels: Iterable[Channel], clocks: Iterable[Clock]) -> None:
        self._channels: dict[str, Channel] = {}
        self.clocks: dict[str, Clock] = {}
        for clock in clocks:
            self._add_clock(clock)
        seen: dict[str, str] = {}
        for channel in channels:
            other = seen.setdefault(channel.name.lower(), channel.name)
            if channel.name in self._channels or other != channel.name:
                raise InputError(f"channel {channel.name!r}: the name is given twice")
            self._add_clock(channel.clock)
            self._channels[channel.name] = channel

    def _add_clock(self, clock: Clock) -> None:
        if self.clocks.setdefault(clock.name, clock) is not clock:
            raise InputError(f"clock {clock.name!r}: two different clocks have this name")

    @property
    def names(self) -> list[str]:
        """Names of the channels, in recorded order."""
        return list(self._channels)

    @property
    def channels(self) -> list[Channel]:
        """The channels, in recorded order."""
        return list(self._channels.values())

    def __getitem__(self, name: str) -> Channel:
        try:
            return self._channels[name]
        except KeyError:
            raise unknown("channel", str(name), self._channels, "recording") from None

    def __contains__(self, name: object) -> bool:
        return name in self._channels

    def __iter__(self) -> Iterator[str]:
        return iter(self._channels)

    def __len__(self) -> int:
        return len(self._channels)

    def _ipython_key_completions_(self) -> list[str]:
        return self.names

    def clock(self, name: str | None = None) -> Clock:
        """Return a clock by name, or the only one.

        Raises
        ------
        InputError
            No such clock, or no name and several clocks.
        """
        if name is None and len(self.clocks) == 1:
            return next(iter(self.clocks.values()))
        if name is None:
            raise InputError(
                f"the recording has {len(self.clocks)} clocks; name one of "
                f"{', '.join(map(repr, self.clocks)) or 'none'}"
            )
        if name not in self.clocks:
            raise unknown("clock", name, self.clocks, "recording")
        return self.clocks[name]

    def on_clock(self, name: str | None = None) -> list[Channel]:
        """Return the channels of one clock, in recorded order; errors as `clock`."""
        clock = self.clock(name)
        return [channel for channel in self._channels.values() if channel.clock is clock]
