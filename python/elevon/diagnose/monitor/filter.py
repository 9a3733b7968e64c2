"""Generalised likelihood ratio of a change at an unknown instant, on windows of a stream.

The features of window t, less a healthy unit's, are

    x_t = u + b_t + d [t >= tau] + e_t,

u: how this unit deviates from what is expected, once for all; b_t: what its day does to it, with a
memory (an Ornstein-Uhlenbeck process); e_t: noise of a window; d: what a fault does from window tau
on. A Kalman filter follows u and b_t; the fault's trace in its innovations is linear in d, so that
the log likelihood ratio of (tau, d) is d'c - d'C d / 2 with a vector c and a matrix C that are
carried from window to window for each tau (Willsky and Jones 1976). C needs no data: many streams
are filtered at once, which gives the threshold.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.errors import FormatError


@dataclass(frozen=True)
class WindowSpread:
    """How healthy windows vary.

    Attributes
    ----------
    unit : ndarray, shape (k, k)
        Of what is not known of the unit, the same for all windows.
    day : ndarray, shape (k, k)
        From day to day.
    noise : ndarray, shape (k, k)
        From window to window.
    memory : float
        Share of a day's deviation that is left after one window.
    """

    unit: Floats
    day: Floats
    noise: Floats
    memory: float


@dataclass
class Change:
    """A window at which a fault may have begun.

    Attributes
    ----------
    window : int
        Its number.
    opening : bool
        Whether it is the first of a day: then the day itself may be what is seen.
    linear : ndarray, shape (m, k)
        The vector c of m streams.
    information : ndarray, shape (k, k)
        The matrix C.
    moved : ndarray, shape (2k, k)
        What the fault has done to the filter's state.
    """

    window: int
    opening: bool
    linear: Floats
    information: Floats
    moved: Floats


class ChangeFilter:
    """The filter, for m streams at once.

    Parameters
    ----------
    spread : WindowSpread
        Of healthy windows.
    directions : ndarray, shape (d, k)
        What faults do; length is of no matter.
    streams : int
        m.
    last : int
        Changes within a day that are followed; older ones are dropped.
    """

    def __init__(
        self, spread: WindowSpread, directions: Floats, *, streams: int, last: int
    ) -> None:
        k = len(spread.noise)
        self._spread, self._directions, self._last = spread, directions, last
        self._state = np.zeros((streams, 2 * k))
        zero = np.zeros((k, k))
        self._covariance = np.block([[spread.unit, zero], [zero, spread.day]])
        self._seen = np.hstack([np.eye(k), np.eye(k)])
        self._opening = True
        self.changes: list[Change] = []
        self.windows = 0

    def new_day(self) -> None:
        """Forget the day; what is known of the unit stays."""
        if self._opening:
            return
        k = len(self._spread.noise)
        self._state[:, k:] = 0.0
        self._covariance[k:, :k] = self._covariance[:k, k:] = 0.0
        self._covariance[k:, k:] = self._spread.day
        for change in self.changes:
            change.moved[k:] = 0.0
        self._opening = True

    def step(self, deviations: Floats) -> None:
        """Take one window of every stream, shape (m, k); NaN where a number is not there."""
        self._begin(len(deviations))
        rows = np.isfinite(deviations[0])
        seen, k = self._seen[rows], deviations.shape[1]
        noise = self._spread.noise[np.ix_(rows, rows)]
        inverse = np.linalg.inv(seen @ self._covariance @ seen.T + noise)
        gain = self._covariance @ seen.T @ inverse
        surprise = deviations[:, rows] - self._state @ seen.T
        for change in self.changes:
            trace = np.eye(k)[rows] - seen @ change.moved
            weight = trace.T @ inverse
            change.linear += surprise @ weight.T
            change.information += weight @ trace
            change.moved += gain @ trace
        self._state += surprise @ gain.T
        self._covariance -= gain @ seen @ self._covariance
        self._forget()
        self.windows += 1
        self._opening = False

    def ratios(self) -> tuple[Floats, Floats]:
        """Greatest log likelihood ratio of a change at a day's start and within it, shape (m,)."""
        out = []
        for opening in (True, False):
            changes = [self._ratio(c).max(axis=1) for c in self.changes if c.opening is opening]
            out.append(np.max(changes, axis=0) if changes else np.zeros(len(self._state)))
        return out[0], out[1]

    def best(self, stream: int = 0, *, opening: bool) -> Change:
        """Return the change of the greatest ratio in one stream."""
        changes = [c for c in self.changes if c.opening is opening]
        return max(changes, key=lambda c: float(self._ratio(c)[stream].max()))

    def arrays(self) -> dict[str, Floats]:
        """Return where it stands, as arrays."""
        out = {"state": self._state, "covariance": self._covariance}
        out["opening"] = np.array([float(self._opening)])
        for name, shape in self._shapes().items():
            rows = [np.asarray(getattr(c, name), dtype=np.float64) for c in self.changes]
            out[f"change_{name}"] = np.array(rows).reshape(len(rows), *shape)
        return out

    def take_arrays(self, arrays: Mapping[str, Floats], windows: int, place: str) -> None:
        """Go on from where `arrays` was called, after so many windows.

        Raises
        ------
        FormatError
            Something is missing, of another shape, or not finite; `place` is named.
        """
        self._state = needed(arrays, "state", self._state.shape, place)
        self._covariance = needed(arrays, "covariance", self._covariance.shape, place)
        self._opening = bool(needed(arrays, "opening", (1,), place)[0])
        count = len(needed(arrays, "change_window", (None,), place))
        columns = [
            needed(arrays, f"change_{name}", (count, *shape), place)
            for name, shape in self._shapes().items()
        ]
        self.changes = [
            Change(int(row[0]), bool(row[1]), *(part.copy() for part in row[2:]))
            for row in zip(*columns, strict=True)
        ]
        self.windows = windows

    def _shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of what is carried for a change, in the order of its fields."""
        streams, k = len(self._state), len(self._spread.noise)
        return {
            "window": (), "opening": (), "linear": (streams, k), "information": (k, k),
            "moved": (2 * k, k),
        }  # fmt: skip

    def _ratio(self, change: Change) -> Floats:
        """Best amplitude of each direction, none below zero: (u'c)^2 / (2 u'C u)."""
        along = np.maximum(change.linear @ self._directions.T, 0.0)
        size = np.einsum("dk,kl,dl->d", self._directions, change.information, self._directions)
        return np.asarray(0.5 * along**2 / np.maximum(size, 1e-30))

    def _begin(self, streams: int) -> None:
        k = len(self._spread.noise)
        blank = (np.zeros((streams, k)), np.zeros((k, k)), np.zeros((2 * k, k)))
        self.changes.append(Change(self.windows, self._opening, *blank))
        for opening in (True, False):
            changes = [c for c in self.changes if c.opening is opening]
            for old in changes[: -self._last]:
                self.changes.remove(old)

    def _forget(self) -> None:
        """Let a window pass: the day's deviation fades and is renewed."""
        k, memory = len(self._spread.noise), self._spread.memory
        keep = np.concatenate((np.ones(k), np.full(k, memory)))
        self._state *= keep
        self._covariance *= np.outer(keep, keep)
        self._covariance[k:, k:] += (1.0 - memory**2) * self._spread.day
        for change in self.changes:
            change.moved *= keep[:, None]


def needed(
    arrays: Mapping[str, Floats], name: str, shape: tuple[int | None, ...], place: str
) -> Floats:
    """Return a finite array of a shape (None: any length).

    Raises
    ------
    FormatError
        It is not there; `place` is named.
    """
    got = arrays.get(name)
    alike = got is not None and len(got.shape) == len(shape)
    if (
        got is None
        or not alike
        or any(s not in (None, n) for s, n in zip(shape, got.shape, strict=True))
        or not np.isfinite(got).all()
    ):
        raise FormatError(f"{place}: is damaged: {name} is missing, of another shape or not finite")
    return got
