"""A part of the time of clocks and channels."""

from collections.abc import Iterable

import numpy as np

from elevon.recording.channel import Channel
from elevon.recording.clock import Clock


def cut(
    channels: Iterable[Channel], clocks: Iterable[Clock], start: float, stop: float
) -> tuple[list[Channel], list[Clock]]:
    """Return channels and clocks with start <= time <= stop (s), sharing the values."""
    parts: dict[str, tuple[Clock, slice]] = {}
    for clock in clocks:
        first = int(np.searchsorted(clock.time, start, "left"))
        last = max(first, int(np.searchsorted(clock.time, stop, "right")))
        gaps = [gap - first for gap in clock.gaps if first <= gap < last - 1]
        part = slice(first, last)
        parts[clock.name] = Clock(clock.name, clock.time[part], clock.rate, gaps), part
    cut_channels = []
    for channel in channels:
        base, part = parts[channel.clock.name]
        values = channel.values[part]
        cut_channels.append(Channel(channel.name, channel.unit, values, base, channel.text))
    return cut_channels, [clock for clock, _ in parts.values()]
