"""Snapshots in binary: what a viewer gets thirty times a second."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence

import numpy as np

from elevon.live.ring import SampleRing

RATE = 30.0
"""Snapshots a second."""
MOST_ROWS = 96
"""Rows of a snapshot: more samples are thinned to them."""
_HEAD = struct.Struct("<ddfIII")


class SharedFrames:
    """What viewers have in common: each snapshot and each state is encoded once for all.

    Parameters
    ----------
    ring : SampleRing
        Where samples come from.
    state : callable
        Returns the bench's state as text.
    """

    def __init__(self, ring: SampleRing, state: Callable[[], str]) -> None:
        self.ring = ring
        self._state = state
        self._tick, self._noted = -1.0, -1
        self._last = ring.written
        self._text = ""
        self._bodies: dict[tuple[int, tuple[int, ...]], tuple[int, bytes]] = {}

    def at(self, tick: float) -> int:
        """Go on to a picture's number; return the number of the sample up to which it goes."""
        if tick != self._tick:
            self._tick, self._last = tick, self.ring.written
            self._bodies.clear()
        return self._last

    def state(self, number: int) -> str:
        """Return the state as text; made anew when its number is another one."""
        if number != self._noted:
            self._noted, self._text = number, self._state()
        return self._text

    def body(self, first: int, columns: tuple[int, ...]) -> tuple[int, bytes]:
        """Return the rows from a sample on to the picture's last, and how many they are."""
        key = (first, columns)
        if key not in self._bodies:
            times, values = self.ring.between(first, self._last, columns, MOST_ROWS)
            packed = times.astype("<f8").tobytes() + values.astype(np.dtype("<f4")).tobytes()
            self._bodies[key] = (len(times), packed)
        return self._bodies[key]


class SnapshotWriter:
    """Packs what is new in a ring for one viewer.

    A snapshot holds, little-endian: time [s] and factor as float64, the factor asked for as
    float32, then as uint32 the number of the choice of signals, rows and columns; then the rows'
    instants as float64 and their values as float32, row by row.

    Parameters
    ----------
    frames : SharedFrames
        Where samples come from.
    """

    def __init__(self, frames: SharedFrames) -> None:
        self._frames = frames
        self._next = frames.ring.written
        self._columns: tuple[int, ...] = ()
        self._choice = 0

    def choose(self, names: Sequence[str], choice: int) -> None:
        """Take other signals from now on; those that are not there are left out."""
        self._columns, self._choice = tuple(self._frames.ring.columns(names)), choice

    def pack(self, tick: float, time: float, factor: float, wanted: float) -> bytes:
        """Return the snapshot of what came since the last one, for a picture's number."""
        last = self._frames.at(tick)
        rows, body = self._frames.body(self._next, self._columns)
        self._next = last
        head = _HEAD.pack(time, factor, wanted, self._choice, rows, len(self._columns))
        return head + body
