"""The simulation's own thread: real time times a factor, actions between two samples."""

from __future__ import annotations

import queue
import threading
import time as clock
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from threading import Lock
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from elevon.arrays import Floats
from elevon.errors import RangeError

if TYPE_CHECKING:
    from elevon.live.unit import Source


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
        """Remove the samples: the following time does not continue them."""
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


Value = TypeVar("Value")
SLOWEST, FASTEST = 0.1, 100.0
SPAN = 120.0  # s of samples at hand: plots, spectrum, health
_WAKE = 0.01  # s between two looks at the clock: a third of a frame
_LATE = 0.2  # s of delay that is caught up; what is more is given up, the factor falls
_BUSY = 0.05  # s of work after which actions are looked for again


class LiveLoop:
    """Runs a source against the clock and keeps its last samples.

    Parameters
    ----------
    source : Source
        What is shown.
    factor : float
        Simulated time over wall time.
    """

    def __init__(self, source: Source, factor: float = 1.0) -> None:
        self.source = source
        self.ring = SampleRing(source.names, int(SPAN / source.period))
        self.listener: Callable[[float, Sequence[float]], None] | None = None
        self.paused = False
        self.reached_factor = 0.0
        self._factor = check_factor(factor)
        self._todo: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="simulation", daemon=True)
        self._rebase()

    @property
    def factor(self) -> float:
        """The requested speed factor; `reached_factor` is the one achieved."""
        return self._factor

    def set_factor(self, factor: float) -> None:
        """Request another speed factor (on the loop's own thread)."""
        self._factor = check_factor(factor)
        self._rebase()

    def pause(self, paused: bool) -> None:
        """Pause or continue (on the loop's own thread)."""
        self.paused = paused
        self._rebase()

    def start(self) -> None:
        """Begin."""
        self.ring.append(self.source.time, self.source.step())
        self._rebase()
        self._thread.start()

    def stop(self) -> None:
        """End, and wait for it."""
        self._stop.set()
        if self._thread.is_alive():
            self._todo.put(lambda: None)
            self._thread.join()

    def call(self, work: Callable[[], Value], timeout: float = 10.0) -> Value:
        """Call a function between two samples, on the loop's thread; return its result."""
        if not self._thread.is_alive():
            return work()
        answer: Future[Value] = Future()

        def do() -> None:
            try:
                answer.set_result(work())
            except BaseException as error:  # noqa: BLE001 - it belongs to whoever asked
                answer.set_exception(error)

        self._todo.put(do)
        return answer.result(timeout)

    def _run(self) -> None:
        while not self._stop.is_set():
            if self.paused or not self._behind():
                self._measure()
                self._actions(_WAKE)
            else:
                self._actions(0.0)

    def _actions(self, wait: float) -> None:
        """Do what was asked for; wait for the first of it [s]: an act wakes the loop."""
        with suppress(queue.Empty):
            if wait:
                self._todo.get(timeout=wait)()
            while True:
                self._todo.get_nowait()()

    def _behind(self) -> bool:
        """Go on to the clock's instant; True where it is not reached yet."""
        begin = clock.perf_counter()
        while self.source.time < self._target():
            self.sample()
            if clock.perf_counter() - begin > _BUSY:
                if self._target() - self.source.time > _LATE * self._factor:
                    self._rebase(measured=True)
                self._measure()
                return True
        return False

    def sample(self) -> None:
        """Advance by one sample, whatever the clock says."""
        before = self.source.time
        values = self.source.step()
        time = self.source.time
        if time <= before:  # it stands: tripped, diverged or ended
            self._rebase()
            self._stop.wait(_WAKE)
            self._base_wall = clock.perf_counter()
            return
        self.ring.append(time, values)
        if self.listener is not None:
            self.listener(time, values)

    def _target(self) -> float:
        return self._base + (clock.perf_counter() - self._base_wall) * self._factor

    def _rebase(self, *, measured: bool = False) -> None:
        if not measured:
            self._mark = (clock.perf_counter(), self.source.time)
        self._base, self._base_wall = self.source.time, clock.perf_counter()

    def _measure(self) -> None:
        wall, time = self._mark
        now = clock.perf_counter()
        if now - wall > 0.5:
            self.reached_factor = (self.source.time - time) / (now - wall)
            self._mark = (now, self.source.time)


def check_factor(factor: float) -> float:
    """Return a factor; `RangeError` outside 0.1 to 100."""
    if not SLOWEST <= factor <= FASTEST:
        raise RangeError(f"factor {factor:g}: must be {SLOWEST:g} to {FASTEST:g}")
    return factor
