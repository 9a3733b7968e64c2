"""Rows of a table against baselines of their own unit, drawn anew for every batch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.positions.features import FEATURES
from elevon.diagnose.surrogate.boosted import Batch
from elevon.diagnose.surrogate.features import NAMES
from elevon.diagnose.surrogate.population import learned
from elevon.diagnose.surrogate.table import TrainingTable
from elevon.diagnose.surrogate.view import View, hidden


def limits() -> tuple[Floats, Floats]:
    """Return the ends of the faults' ranges: lowest (as a size) and highest, shape (f,)."""
    candidates = learned()
    low = np.array([abs(c.low) if c.low < 0.0 else c.high for c in candidates])
    return low, np.array([c.high for c in candidates])


def sizes(severity: Floats) -> Floats:
    """Return the signed root of severities over their range, shape (..., f)."""
    low, high = limits()
    share = np.where(severity < 0.0, np.abs(severity) / low, severity / high)
    return np.asarray(np.sign(severity) * np.sqrt(share))


def severities(size: Floats) -> Floats:
    """Return the severities of sizes; the inverse of `sizes`, cut at the ends of the range."""
    low, high = limits()
    lowest = np.array([-1.0 if c.low < 0.0 else 0.0 for c in learned()])
    inside = np.clip(size, lowest, 1.0)
    return np.asarray(np.sign(inside) * inside**2 * np.where(inside < 0.0, low, high))


def _deviation(values: Floats) -> Floats:
    """Return the least run-to-run deviation that diagnosis by the model allows for."""
    share, least = (np.array([FEATURES[name].repeats[k] for name in NAMES]) for k in (0, 1))
    return np.asarray(np.hypot(share * np.abs(values), least))


@dataclass(frozen=True)
class Rows:
    """A table with, for every row, the other healthy days of its unit.

    What runs of a simulation lack from day to day is drawn anew whenever they are read
    for.

    Attributes
    ----------
    table : TrainingTable
        Rows.
    deviation : ndarray, shape (n, k)
        Of what is drawn.
    others : ndarray of int, shape (n, d)
        Rows of the baselines; -1 where there is none.
    """

    table: TrainingTable
    deviation: Floats
    others: npt.NDArray[np.int64]

    @classmethod
    def of(cls, table: TrainingTable) -> Rows:
        """Find the baselines of rows."""
        base = {int(u): np.flatnonzero(table.baseline & (table.unit == u)) for u in set(table.unit)}
        width = max((len(v) for v in base.values()), default=1)
        others = np.full((len(table.unit), width), -1, dtype=np.int64)
        for row, unit in enumerate(table.unit.tolist()):
            near = base[unit][base[unit] != row]
            others[row, : len(near)] = near
        return cls(table, _deviation(table.values), others)

    def usable(self) -> npt.NDArray[np.int64]:
        """Rows with a baseline."""
        return np.flatnonzero(self.others[:, 0] >= 0)

    def values(self, rows: npt.NDArray[np.int64], rng: np.random.Generator) -> Floats:
        """Return the features of rows, shape (..., k), of a day of their own each."""
        step = self.deviation[rows] * rng.standard_normal((*rows.shape, len(NAMES)))
        return np.asarray(self.table.values[rows] + step)

    def references(
        self, rows: npt.NDArray[np.int64], rng: np.random.Generator, most: int | None = None
    ) -> tuple[Floats, Floats]:
        """Return the mean of one or more baselines of each row (`most` at most), and how many."""
        there = self.others[rows] >= 0
        keys = np.where(there, rng.random(there.shape), 2.0)
        those = np.minimum(there.sum(axis=1), most or there.shape[1])
        count = 1 + np.floor(rng.random(len(rows)) * those).astype(np.int64)
        chosen = (keys.argsort(axis=1).argsort(axis=1) < count[:, None]).astype(np.float64)
        values = self.values(self.others[rows], rng)
        return (chosen[:, :, None] * values).sum(axis=1) / count[:, None], count.astype(np.float64)

    def inputs(
        self,
        view: View,
        rows: npt.NDArray[np.int64],
        rng: np.random.Generator,
        *,
        hide: bool = False,
        most: int | None = None,
    ) -> Floats:
        """Return the trees' inputs of rows; `most` baselines each at most."""
        values = self.values(rows, rng)
        if hide:
            values = hidden(values, rng)
        if not view.relative:
            return view.inputs(values, None, np.ones(len(rows)))
        healthy, count = self.references(rows, rng, most)
        return view.inputs(values, healthy, count)

    def batch(self, view: View, rows: npt.NDArray[np.int64], rng: np.random.Generator) -> Batch:
        """Return a training batch."""
        return Batch(self.inputs(view, rows, rng, hide=True), sizes(self.table.severity[rows]))
