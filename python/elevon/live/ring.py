"""The last samples of a running actuator, in memory of a fixed size."""

from __future__ import annotations

from collections.abc import Sequence
from threading import Lock

import numpy as np

from elevon.arrays import Floats


class SampleRing:
    """Rows of samples, the newest ones kept; written by one thread, read by any.

    Parameters
    ----------
    names : sequence of str
        The signals, one a column.
    rows : int
        How many samples are kept.
    """

    def __init__(self, names: Sequence[str], rows: int) -> None:
        self.names = tuple(names)
        self.rows = rows
        self.written = 0
        self._column = {name: i for i, name in enumerate(self.names)}
        self._time = np.full(rows, np.nan)
        self._values = np.full((rows, len(names)), np.nan)
        self._lock = Lock()

    def append(self, time: float, values: Sequence[float] | Floats) -> None:
        """Add one sample: its instant [s] and the value of each signal."""
        with self._lock:
            at = self.written % self.rows
            self._time[at] = time
            self._values[at] = values
            self.written += 1

    def clear(self) -> None:
        """Forget the samples: the time that follows does not go on from them."""
        with self._lock:
            self._time[:] = np.nan

    def columns(self, names: Sequence[str]) -> list[int]:
        """Return the columns of signals; one that is not there is left out."""
        return [self._column[name] for name in names if name in self._column]

    def between(
        self, first: int, last: int, columns: Sequence[int], most: int
    ) -> tuple[Floats, Floats]:
        """Return the samples of a range of numbers, thinned to `most` rows.

        Returns
        -------
        (ndarray of shape (n,), ndarray of shape (n, k))
            Instants [s], values.
        """
        with self._lock:
            first = max(first, self.written - self.rows, 0)
            stride = max(1, -(-(last - first) // most))
            # Counted from the newest, so that the picture is never late.
            picked = np.arange(last - 1, first - 1, -stride)[::-1] % self.rows
            time, values = (
                self._time[picked],
                self._values[np.ix_(picked, np.asarray(columns, dtype=np.intp))],
            )
        known = np.isfinite(time)
        return time[known], values[known]

    def latest(self) -> Floats:
        """Return the newest sample, shape (k,); NaN before the first."""
        with self._lock:
            return np.array(self._values[(self.written - 1) % self.rows])

    def stretch(self, begin: float, columns: Sequence[int]) -> tuple[Floats, Floats]:
        """Return the samples later than an instant [s]: times (n,), values (n, k)."""
        with self._lock:
            first = max(self.written - self.rows, 0)
            order = np.arange(first, self.written) % self.rows
            order = order[self._time[order] > begin]
            values = self._values[np.ix_(order, np.asarray(columns, dtype=np.intp))]
            return self._time[order], values
