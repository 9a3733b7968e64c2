"""Snapshots in binary: what a viewer gets thirty times a second."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from elevon.live.ring import SampleRing

MOST_ROWS = 96
"""Rows of a snapshot: more samples are thinned to them."""
_HEAD = struct.Struct("<ddfIII")


class SnapshotWriter:
    """Packs what is new in a ring for one viewer.

    A snapshot holds, little-endian: time [s] and factor as float64 (the factor float64, too), the
    factor asked for as float32, then as uint32 the number of the choice of signals, rows and
    columns; then the rows' instants as float64 and their values as float32, row by row.

    Parameters
    ----------
    ring : SampleRing
        Where samples come from.
    """

    def __init__(self, ring: SampleRing) -> None:
        self._ring = ring
        self._next = ring.written
        self._columns: list[int] = []
        self._choice = 0

    def choose(self, names: Sequence[str], choice: int) -> None:
        """Take other signals from now on; those that are not there are left out."""
        self._columns, self._choice = self._ring.columns(names), choice

    def pack(self, time: float, factor: float, wanted: float) -> bytes:
        """Return the snapshot of what came since the last one."""
        self._next, times, values = self._ring.since(self._next, self._columns, MOST_ROWS)
        rows, columns = values.shape
        head = _HEAD.pack(time, factor, wanted, self._choice, rows, columns)
        return head + times.astype("<f8").tobytes() + values.astype(np.dtype("<f4")).tobytes()
