"""What the trees are given: changes of the features against a healthy unit, made comparable.

The view ``relative`` holds them against baselines of the same unit, the view ``absolute`` against
the middle of all healthy units that were trained.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.surrogate.features import NAMES, VOLTAGE, changes

VIEWS = ("relative", "absolute")
_VOLTAGE = np.array([name in VOLTAGE for name in NAMES])
_FOLLOWING = np.array([name == "following_gain" for name in NAMES])
_ARRAYS = ("centre", "floor", "spread", "wide", "middle", "range")


@dataclass(frozen=True)
class View:
    """How features become inputs.

    Attributes
    ----------
    relative : bool
        Whether baselines of the unit are the reference.
    centre : ndarray, shape (k,)
        Healthy units' median, SI.
    floor : ndarray, shape (k,)
        Least size of what a share is taken of.
    spread, wide : ndarray, shape (k,)
        Deviation of a healthy unit's change, and of all changes.
    middle, range : ndarray, shape (k,)
        Mean and deviation of healthy units over their centre.
    """

    relative: bool
    centre: Floats
    floor: Floats
    spread: Floats
    wide: Floats
    middle: Floats
    range: Floats

    def change(self, values: Floats, healthy: Floats | None) -> Floats:
        """Return changes over the healthy spread, shape (n, k); 0 where a feature is missing.

        Parameters
        ----------
        values : ndarray, shape (n, k)
            By `NAMES`, SI.
        healthy : ndarray, shape (n, k), or None
            Mean of the unit's baselines; the view ``absolute`` has none.
        """
        reference = self.centre if healthy is None else healthy
        return np.nan_to_num(changes(values, reference, self.floor) / self.spread)

    def context(self, healthy: Floats) -> Floats:
        """Return how far units lie from the middle of those trained, in their scatter, (n, k)."""
        context = changes(healthy, self.centre, self.floor)
        return np.nan_to_num((context - self.middle) / self.range)

    def inputs(self, values: Floats, healthy: Floats | None, count: Floats) -> Floats:
        """Return what the trees are given, shape (n, m).

        `count`, shape (n,), is the number of baselines; the rest as for `change`.
        """
        change = self.change(values, healthy)
        missing = [np.isnan(values[:, at]).any(axis=1) for at in (_VOLTAGE, _FOLLOWING)]
        parts = [np.arcsinh(change), change * self.spread / self.wide, np.stack(missing, axis=1)]
        if self.relative and healthy is not None:
            parts.append(self.context(healthy).clip(-3.0, 3.0))
            parts.append(1.0 / count[:, None])
        return np.hstack(parts)

    def arrays(self) -> dict[str, Floats]:
        """Return what a file holds of it."""
        return {name: getattr(self, name) for name in _ARRAYS}

    @classmethod
    def build(cls, relative: bool, data: Mapping[str, Floats]) -> View:
        """Return a view from a file's arrays."""
        return cls(relative, *(np.asarray(data[name], dtype=np.float64) for name in _ARRAYS))


def hidden(values: Floats, rng: np.random.Generator, share: float = 0.1) -> Floats:
    """Leave the voltage, or the following gain, out of some rows."""
    out = values.copy()
    for at in (_VOLTAGE, _FOLLOWING):
        out[np.ix_(rng.random(len(out)) < share, at)] = np.nan
    return out
