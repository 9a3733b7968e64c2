"""Particle filter over severities and growth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from elevon.prognose.observation import Inspection
from elevon.prognose.process import Population, Process

__all__ = ["BIAS", "COUNT", "ParticleFilter", "resampled"]

Floats = npt.NDArray[np.float64]
COUNT = 2000
BIAS = 0.01
"""Deviation of the diagnoses' common relative error. Measured: 0.3 to 1 % for play, about 1 % for
shorts and for much friction; taken as the same for all faults (ASSUMED). The model behind them is
one and the same at each inspection, so that part of its error does not average out."""
SURPRISE = 4.0
_SHRINK = 0.98  # of Liu and West: what is drawn is moved, its spread stays
_FEWEST = 0.5  # effective particles, of all, below which they are drawn anew


class ParticleFilter:
    """Sequential importance resampling with the process as proposal (Gordon 1993), fixed
    parameters by the kernel of Liu and West (2001).

    Parameters
    ----------
    process : Process
        How units grow.
    count : int
        Particles.
    seed : int
        Of chance.

    Attributes
    ----------
    units : Population
        The posterior of the moment.
    surprises : list of (float, str, float)
        Use, fault and deviations off of diagnoses that stood more than `SURPRISE` of them from
        what was expected.
    """  # noqa: D205

    def __init__(self, process: Process, *, count: int = COUNT, seed: int = 0) -> None:
        self.process = process
        self.rng = np.random.default_rng([16, seed])
        self.units = process.start(count, self.rng)
        self.surprises: list[tuple[float, str, float]] = []

    def update(self, item: Inspection) -> Population:
        """Grow to an inspection, weigh by what it saw, make new what was replaced after it."""
        units = self.process.to(self.units, item.usage, self.rng)
        severity = self.process.severity(units.damage)
        self._compare(units, severity, item)
        score = np.log(np.maximum(units.weight, 1e-300))
        for k, law in enumerate(self.process.laws):
            if law.key in item.seen:
                score += item.seen[law.key].log_likelihood(severity[:, k])
        weight = np.exp(score - score.max())
        units = replace(units, weight=weight / weight.sum())
        if 1.0 / float(np.sum(units.weight**2)) < _FEWEST * len(weight):
            units = resampled(units, len(weight), self.rng, shrink=_SHRINK)
        if item.reset:
            units = self.process.reset(units, item.reset, self.rng)
        self.units = units
        return units

    def _compare(self, units: Population, severity: Floats, item: Inspection) -> None:
        """Note a diagnosis that the units expected before it hardly allow."""
        for k, law in enumerate(self.process.laws):
            seen = item.seen.get(law.key)
            if seen is None or seen.severity is None:
                continue
            mean = float(units.weight @ severity[:, k])
            variance = float(units.weight @ (severity[:, k] - mean) ** 2)
            deviation = seen.low if mean < seen.severity else seen.high
            score = (seen.severity - mean) / np.sqrt(variance + deviation**2)
            if abs(score) > SURPRISE:
                self.surprises.append((item.usage, law.key, float(score)))


def resampled(
    units: Population, count: int, rng: np.random.Generator, *, shrink: float = 1.0
) -> Population:
    """Draw units by their weights (systematic); `shrink` below 1 moves what is drawn."""
    edges = np.cumsum(units.weight)
    at = (rng.random() + np.arange(count)) / count * edges[-1]
    index = np.minimum(np.searchsorted(edges, at), len(edges) - 1)
    out = units.picked(index)
    return out if shrink >= 1.0 else _jittered(units, out, shrink, rng)


def _jittered(
    before: Population, out: Population, shrink: float, rng: np.random.Generator
) -> Population:
    """Move what was drawn, law by law, by a kernel that keeps mean and covariance.

    Damage moves along with growth and form: with little scatter of the growth all particles would
    else soon descend from a few.
    """
    damage, growth, form = out.damage.copy(), out.growth.copy(), out.form.copy()
    for k in range(damage.shape[1]):
        updated = before.active[:, k] & (before.damage[:, k] > 0.0) & (before.weight > 0.0)
        moved = out.active[:, k] & (out.damage[:, k] > 0.0)
        if updated.sum() < 10 or not moved.any():
            continue
        weight = before.weight[updated] / before.weight[updated].sum()
        new = _kernel(_rows(before, updated, k), weight, _rows(out, moved, k), shrink, rng)
        damage[moved, k] = np.exp(new[:, 0])
        growth[moved, k], form[moved, k] = new[:, 1], new[:, 2]
    return replace(out, damage=damage, growth=growth, form=form)


def _rows(units: Population, keep: npt.NDArray[np.bool_], k: int) -> Floats:
    """Logarithm of the damage, growth, form of one law, shape (n, 3)."""
    columns = (np.log(units.damage[keep, k]), units.growth[keep, k], units.form[keep, k])
    return np.column_stack(columns)


def _kernel(
    before: Floats, weight: Floats, after: Floats, shrink: float, rng: np.random.Generator
) -> Floats:
    """Return rows drawn from a weighted sample, shrunk to its mean and spread again."""
    mean = weight @ before
    rest = before - mean
    values, vectors = np.linalg.eigh((rest.T * weight) @ rest)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    jitter = np.sqrt(1.0 - shrink**2) * rng.standard_normal(after.shape) @ root.T
    return np.asarray(shrink * after + (1.0 - shrink) * mean + jitter)
