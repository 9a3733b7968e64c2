"""Features of a log: what each is, how well it repeats, how well the model knows it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from elevon.arrays import Floats

Two = tuple[float, float]


@dataclass(frozen=True)
class Feature:
    """One line of the table.

    Attributes
    ----------
    name, unit, text : str
        In words, where the name is none.
    repeats : (float, float)
        Least deviation from day to day: share of the value, and SI.
    mismatch : (float, float)
        How far a healthy unit may deviate from the model, likewise.
    error : float
        Of what the model says a fault does to it, as a share of the shift.
    kind : str
        ``size``: an amplitude; what a unit has and what a fault adds meet at an unknown angle.
        ``share``: a fault moves it by a share of the unit's own value. Else by a difference.
    least : float
        Value below which shares are those of this one.
    pooled : float
        Where above zero, it deviates from the model by one share in all tests of a unit, and that
        share deviates by so much between tests.
    constant : bool
        Whether it is a number of the drive or of a sensor, the same whatever is commanded: what
        two model runs differ by there is rounding.
    """

    name: str
    unit: str
    text: str = ""
    repeats: Two = (0.0, 0.0)
    mismatch: Two = (0.0, 0.0)
    error: float = 0.0
    kind: Literal["", "size", "share"] = ""
    least: float = 0.0
    pooled: float = 0.0
    constant: bool = False


FeatureTable = Mapping[str, Feature]


def deviations(
    records: Sequence[Feature], values: Floats, of: Literal["repeats", "mismatch"]
) -> Floats:
    """Return the least deviation, or the model's mismatch, of features at values, shape (k,)."""
    pairs = np.array([getattr(f, of) for f in records]).reshape(-1, 2)
    level = np.maximum(np.abs(values), [f.least for f in records])
    out = np.hypot(pairs[:, 0] * level, pairs[:, 1])
    return np.asarray(np.maximum(out, 1e-12), dtype=np.float64)


@dataclass(frozen=True)
class FeatureVector:
    """Features of one log.

    Attributes
    ----------
    names : tuple of str
        Keys of a `FeatureTable`.
    values, std : ndarray, shape (k,)
        With the deviation that the noise within the log gives them.
    floats : bool
        Whether the output flies in its backlash on its own: its lost motion is then the width in
        which the two positions' difference lies.
    """

    names: tuple[str, ...]
    values: Floats
    std: Floats
    floats: bool = False

    def only(self, names: Sequence[str]) -> FeatureVector:
        """Return some of it, in the order given."""
        at = [self.names.index(name) for name in names]
        return FeatureVector(tuple(names), self.values[at], self.std[at], self.floats)


def periodic_covariance(moves: Sequence[FeatureVector], names: Sequence[str]) -> Floats:
    """Return the covariance of features, shape (k, k), that independent moves give them."""
    rows = [v.only(names).values for v in moves if all(n in v.names for n in names)]
    moved = np.array(rows).reshape(len(rows), len(names))
    return np.asarray(moved.T @ moved, dtype=np.float64)
