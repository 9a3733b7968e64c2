"""Thresholds at a set mean time between false alarms, from simulated healthy streams."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.spread import DEGREES
from elevon.diagnose.monitor.filter import Change, ChangeFilter, WindowSpread
from elevon.diagnose.monitor.reference import WindowReference

STREAMS = 2000
_TAIL = 0.05  # share of the streams that gives the tail
_WINDOWS = 40  # the most that are simulated of a day
_DAYS = 10  # the most that are simulated
_LEAST = 10  # streams above a threshold that is read off; beyond, the tail is drawn on


@dataclass(frozen=True)
class AlarmThresholds:
    """Of the log likelihood ratio.

    Attributes
    ----------
    opening, within : float
        For a fault there from a day's first window on, and for one that begins within a day.
        Half of the false alarms come from either.
    beyond : bool
        Whether the set time is longer than what was simulated, so that a tail was drawn on.
    """

    opening: float
    within: float
    beyond: bool


def for_days(
    reference: WindowReference, width: float, last: int, *, days: int, longest: float, time: float
) -> AlarmThresholds:
    """Return the thresholds of so many days, the longest of so many seconds; as `simulated`."""
    return simulated(
        reference.spread,
        reference.directions,
        days=min(max(days, 1), _DAYS),
        windows=min(max(int(longest / width), 2), _WINDOWS),
        width=width,
        time=time,
        noise_degrees=reference.noise_degrees,
        last=last,
    )


def simulated(
    spread: WindowSpread,
    directions: Floats,
    *,
    days: int,
    windows: int,
    width: float,
    time: float,
    noise_degrees: float,
    last: int,
) -> AlarmThresholds:
    """Return thresholds at which healthy streams alarm once in a mean time.

    Parameters
    ----------
    spread : WindowSpread
        Of healthy windows; the unit's and the day's part are known to `DEGREES` degrees of
        freedom, the noise to `noise_degrees`, so a stream's own spread is drawn, too.
    directions : ndarray, shape (d, k)
        As for `ChangeFilter`.
    days, windows : int
        Of a stream: days, and windows in each.
    width : float
        Of a window [s].
    time : float
        Mean time between false alarms [s].
    last : int
        As for `ChangeFilter`.
    """
    rng = np.random.default_rng(1576)
    draw = _Drawn(spread, noise_degrees, rng)
    watch = ChangeFilter(spread, directions, streams=STREAMS, last=last)
    top = [np.zeros(STREAMS), np.zeros(STREAMS)]
    for _ in range(days):
        watch.new_day()
        for deviations in draw.day(windows):
            watch.step(deviations)
            top = [np.maximum(a, b) for a, b in zip(top, watch.ratios(), strict=True)]
    chance = -np.expm1(-0.5 * days * windows * width / time)
    levels = [_level(values, float(chance)) for values in top]
    return AlarmThresholds(levels[0], levels[1], bool(chance * STREAMS < _LEAST))


def _level(values: Floats, chance: float) -> float:
    """Level that a stream exceeds with this chance; a power law where that is too seldom."""
    ranked = np.sort(values)[::-1]
    if chance * len(ranked) >= _LEAST:
        return float(np.quantile(values, 1.0 - chance))
    count = int(_TAIL * len(ranked))
    bend = float(np.mean(np.log(ranked[:count] / ranked[count])))  # Hill (1975)
    return float(ranked[count] * (_TAIL / chance) ** bend)


class _Drawn:
    """Healthy streams."""

    def __init__(
        self, spread: WindowSpread, noise_degrees: float, rng: np.random.Generator
    ) -> None:
        self._rng, self._memory = rng, spread.memory
        self._day, self._noise = _root(spread.day), _root(spread.noise)
        self._slow, self._fast = self._scale(DEGREES), self._scale(noise_degrees)
        self._unit = self._slow * self._normal(_root(spread.unit))

    def _scale(self, degrees: float) -> Floats:
        return np.asarray(np.sqrt(degrees / self._rng.chisquare(degrees, (STREAMS, 1))))

    def _normal(self, root: Floats) -> Floats:
        return np.asarray(self._rng.standard_normal((STREAMS, len(root))) @ root.T)

    def day(self, windows: int) -> list[Floats]:
        """Return the windows of one day, shape (m, k) each."""
        out, day = [], self._slow * self._normal(self._day)
        renewed = np.sqrt(1.0 - self._memory**2)
        for _ in range(windows):
            out.append(self._unit + day + self._fast * self._normal(self._noise))
            day = self._memory * day + renewed * self._slow * self._normal(self._day)
        return out


def _root(covariance: Floats) -> Floats:
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


MOST = 3  # windows that a cause rests on at last
_PREFIX = "cause_"  # before the names of its filter's arrays in a state


@dataclass
class AlarmCause:
    """A filter that has not seen the window of an onset.

    Attributes
    ----------
    watch : ChangeFilter
        As the monitor's, up to the window with the onset; goes on behind it.
    first : int
        Number of the window from which the fault counts.
    """

    watch: ChangeFilter
    first: int

    @classmethod
    def behind(cls, change: Change, before: ChangeFilter, after: ChangeFilter) -> AlarmCause:
        """Return what goes on behind an alarm.

        Parameters
        ----------
        change : Change
            What the alarm is of.
        before, after : ChangeFilter
            The monitor's without and with the alarm's window.
        """
        if change.window == before.windows and not change.opening:
            return cls(deepcopy(before), before.windows)
        return cls(deepcopy(after), change.window)

    @property
    def at(self) -> tuple[int, int]:
        """Windows that the filter has seen, and `first`."""
        return self.watch.windows, self.first

    def step(self, deviations: Floats) -> Change | None:
        """Take a window, shape (1, k); return the change, None where it is too long ago."""
        self.watch.step(deviations)
        return next((c for c in self.watch.changes if c.window == self.first), None)

    def arrays(self) -> dict[str, Floats]:
        """Return where it stands, as arrays."""
        return {_PREFIX + name: array for name, array in self.watch.arrays().items()}

    @classmethod
    def stored(
        cls, watch: ChangeFilter, arrays: Mapping[str, Floats], at: tuple[int, int], place: str
    ) -> AlarmCause:
        """Return what `arrays` were taken of, from a new filter, its windows and first one."""
        named = {n.removeprefix(_PREFIX): a for n, a in arrays.items() if n.startswith(_PREFIX)}
        watch.take_arrays(named, at[0], place)
        return cls(watch, at[1])
