"""Particle filter over severities and growth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.prognose.future import LASTING, MODEL_ERROR
from elevon.prognose.measured import Measured, governing
from elevon.prognose.observation import Inspection, Seen
from elevon.prognose.process import Process, UnitPopulation

COUNT = 2000
SURPRISE = 3.0
_KERNEL = 0.08  # variance of what is drawn that is drawn anew, a lost share of the particles
_FEWEST = 0.5  # effective particles, of all, that one share of a likelihood leaves
_HALVINGS = 8  # so that a likelihood is applied in 256 shares at most


class ParticleFilter:
    """Sequential importance resampling with the process as proposal (Gordon 1993).

    Law by law: faults are diagnosed one by one and hardly drive each other's growth, so that each
    law's numbers are reweighted and drawn by its own diagnoses alone (factored particles: Ng,
    Peshkin and Pfeffer 2002), and no particle is lost in one fault for what another shows. Numbers
    that do not change are moved by the kernel of Liu and West (2001).

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
    units : UnitPopulation
        The posterior of the moment, of equal weights.
    surprises : list of (float, str, float)
        Use, fault and deviations off of diagnoses that stood more than `SURPRISE` of them from
        what was expected.
    """

    def __init__(self, process: Process, *, count: int = COUNT, seed: int = 0) -> None:
        self.process = process
        self.rng = np.random.default_rng([16, seed])
        self.units = process.start(count, self.rng)
        self.surprises: list[tuple[float, str, float]] = []
        self._counts = [0] * len(process.laws)

    def update(self, item: Inspection) -> UnitPopulation:
        """Grow to an inspection, weight by what it saw, make new what was replaced after it."""
        units = self.process.to(self.units, item.usage, self.rng)
        for k, law in enumerate(self.process.laws):
            seen = item.seen.get(law.key)
            if seen is None:
                continue
            self._compare(units, k, seen)
            units = self._reweighted(units, k, partial(self._likelihood, k, seen))
            if seen.severity is not None:
                units = _with_misfit(units, k, seen.scatter(self._expected(units, k, seen)))
                self._counts[k] += 1
        for name, value in item.measured.items():
            units = self._measured(units, name, value)
        if item.reset:
            units = self.process.reset(units, item.reset, self.rng)
        self.units = units
        return units

    def _expected(self, units: UnitPopulation, k: int, seen: Seen) -> Floats:
        """Return what diagnoses without scatter would say of units, shape (n,)."""
        severity = self.process.laws[k].severity(units.damage[:, k])
        return severity + seen.common * units.common[:, k]

    def _likelihood(self, k: int, seen: Seen, units: UnitPopulation) -> Floats:
        """Return the logarithm of a diagnosis' likelihood, shape (n,)."""
        expected = self._expected(units, k, seen)
        return seen.log_likelihood(expected, units.misfit[:, k], self._counts[k])

    def _measured(self, units: UnitPopulation, name: str, value: Measured) -> UnitPopulation:
        """Weigh by a requirement's own value: the model's at the units' severities, and off it.

        The model's error is a share of its value; `LASTING` of its square stays as faults
        grow, the rest is the value's own scatter.
        The numbers of the law that moves it most are reweighted, and the model's error
        stands beside them; of the other laws' faults their units' spread is in the value.
        """
        response = self.process.response
        r, k = governing(response, name)
        units = units.with_off(len(response.requirements), self.rng)
        limit = response.thresholds[r]
        reserve = float(response.requirements[r].reserve(np.array(value.value), limit))
        sign = 1.0 if response.requirements[r].at_least else -1.0
        size = MODEL_ERROR * (1.0 + sign * reserve)
        deviation = float(np.hypot(value.deviation / limit, np.sqrt(1.0 - LASTING) * size))
        seen = Seen(reserve, deviation, deviation)

        def likelihood(units: UnitPopulation) -> Floats:
            left = response.reserve(self.process.severity(units.damage))[r]
            return seen.log_likelihood(left + np.sqrt(LASTING) * size * units.off[:, k, r])

        return self._reweighted(units, k, likelihood)

    def _reweighted(
        self, units: UnitPopulation, k: int, likelihood: Callable[[UnitPopulation], Floats]
    ) -> UnitPopulation:
        """Weigh and draw one law's numbers, in shares of the likelihood that leave enough of them.

        A diagnosis that few particles predicted so narrows the cloud in steps, rather than to those
        few (tempering: Neal 2001).
        """
        left = 1.0
        while left > 0.0:
            score = likelihood(units)
            share = _share(score, left)
            left -= share
            units = _drawn(units, k, _weights(share * score), self.rng)
        return units

    def _compare(self, units: UnitPopulation, k: int, seen: Seen) -> None:
        """Note a diagnosis that the units expected before it hardly allow."""
        if seen.severity is None:
            return
        severity = self._expected(units, k, seen)
        mean = float(severity.mean())
        deviation = seen.low if mean < seen.severity else seen.high
        score = (seen.severity - mean) / np.sqrt(float(severity.var()) + deviation**2)
        if abs(score) > SURPRISE:
            self.surprises.append((units.usage, self.process.laws[k].key, float(score)))


def resampled(units: UnitPopulation, count: int, rng: np.random.Generator) -> UnitPopulation:
    """Draw units by their weights (systematic)."""
    return units.picked(_systematic(units.weight, count, rng))


def _systematic(weight: Floats, count: int, rng: np.random.Generator) -> npt.NDArray[np.intp]:
    edges = np.cumsum(weight)
    at = (rng.random() + np.arange(count)) / count * edges[-1]
    return np.asarray(np.minimum(np.searchsorted(edges, at), len(edges) - 1))


def _weights(score: Floats) -> Floats:
    weight = np.exp(score - score.max())
    return np.asarray(weight / weight.sum())


def _effective(weight: Floats) -> float:
    """Share of the particles that a set of weights leaves effective."""
    return 1.0 / (len(weight) * float(np.sum(weight**2)))


def _share(score: Floats, left: float) -> float:
    """Return how much of a likelihood, of `left`, leaves `_FEWEST` of the particles effective."""
    if _effective(_weights(left * score)) >= _FEWEST:
        return left
    low, high = 0.0, left
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if _effective(_weights(middle * score)) >= _FEWEST:
            low = middle
        else:
            high = middle
    return high


def _with_misfit(units: UnitPopulation, k: int, added: Floats) -> UnitPopulation:
    misfit = units.misfit.copy()
    misfit[:, k] += added
    return replace(units, misfit=misfit)


def _drawn(
    units: UnitPopulation, k: int, weight: Floats, rng: np.random.Generator
) -> UnitPopulation:
    """Draw one law's numbers by weights, and move them by a kernel that keeps mean and covariance.

    Damage moves along with growth and form: with little scatter of the growth all particles would
    else soon descend from a few. The more particles the weights cost, the wider the kernel.
    """
    out = units.with_law(k, _systematic(weight, len(weight), rng))
    updated = units.active[:, k] & (units.damage[:, k] > 0.0) & (weight > 0.0)
    moved = out.active[:, k] & (out.damage[:, k] > 0.0)
    if updated.sum() < 10 or not moved.any():
        return out
    part = weight[updated] / weight[updated].sum()
    wide = _KERNEL * max(1.0 - _effective(weight), 0.0)  # equal weights round to just below zero
    new = _kernel(_rows(units, updated, k), part, _rows(out, moved, k), wide, rng)
    damage, growth, form = out.damage.copy(), out.growth.copy(), out.form.copy()
    common, coefficients, off = out.common.copy(), out.coefficients.copy(), out.off.copy()
    damage[moved, k], growth[moved, k] = np.exp(new[:, 0]), new[:, 1]
    form[moved, k] = np.abs(new[:, 2])  # one-sided as its prior
    last = 4 + coefficients.shape[2]
    common[moved, k], coefficients[moved, k], off[moved, k] = (
        new[:, 3],
        new[:, 4:last],
        new[:, last:],
    )
    return replace(
        out,
        damage=damage,
        growth=growth,
        form=form,
        common=common,
        coefficients=coefficients,
        off=off,
    )


def _rows(units: UnitPopulation, keep: npt.NDArray[np.bool_], k: int) -> Floats:
    """Logarithm of the damage and all fixed numbers of one law, shape (n, 4 + c + m)."""
    fixed = (units.growth, units.form, units.common)
    return np.column_stack(
        (
            np.log(units.damage[keep, k]),
            *(v[keep, k] for v in fixed),
            units.coefficients[keep, k],
            units.off[keep, k],
        )
    )


def _kernel(
    before: Floats, weight: Floats, after: Floats, wide: float, rng: np.random.Generator
) -> Floats:
    """Return rows drawn from a weighted sample, shrunk to its mean and spread again.

    `wide` is the share of the variance that is drawn anew.
    """
    mean = weight @ before
    residual = before - mean
    values, vectors = np.linalg.eigh((residual.T * weight) @ residual)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    jitter = np.sqrt(wide) * rng.standard_normal(after.shape) @ root.T
    return np.asarray(mean + np.sqrt(1.0 - wide) * (after - mean) + jitter)
