"""What a notebook shows of a recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.report.cards import Html, badge, card, sparkline, table
from elevon.units import display_unit

if TYPE_CHECKING:
    from elevon.recording.channel import Channel
    from elevon.recording.recording import Recording


def recording_card(recording: Recording) -> Html:
    """Return the HTML view of a recording: status, clocks, a line and a curve a channel."""
    meta = recording.meta
    facts: list[tuple[str, object]] = [("", badge(recording.status))]
    facts += [("", meta[name]) for name in ("message", "actuator", "fidelity") if meta.get(name)]
    facts += [("clock", repr(clock)[len("Clock(") : -1]) for clock in recording.clocks.values()]
    rows = [_row(channel, len(recording.clocks) > 1) for channel in recording.channels]
    head = ["channel", "unit", "least", "greatest", "last", "", "what it is"]
    return card("Recording", facts, table(head, rows))


def _row(channel: Channel, name_clock: bool) -> list[object]:
    unit = display_unit(channel.unit)
    values = channel.to(unit)
    good = values[np.isfinite(values)]
    numbers = (good.min(), good.max(), values[-1]) if good.size else ("", "", "")
    text = f"{channel.text} [{channel.clock.name}]" if name_clock else channel.text
    return [
        channel.name,
        "" if unit == "1" else unit,
        *(number if isinstance(number, str) else f"{number:.5g}" for number in numbers),
        sparkline(values),
        text,
    ]
