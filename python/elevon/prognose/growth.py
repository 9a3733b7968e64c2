"""The filter: what inspections say of a unit's faults and of how they grow."""

from __future__ import annotations

from collections.abc import Mapping
from math import erfc, pi, sqrt

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.prognose.fault_filter import COMMON, RATE, SLOPE, WANDER, FaultFilter
from elevon.prognose.future import LASTING, MODEL_ERROR
from elevon.prognose.manner import WITHOUT_LAW, GrowthPrior, prior_of
from elevon.prognose.observation import Inspection, Measured, Seen, governing
from elevon.prognose.process import NUMBERS, ONSET, Process, UnitPopulation

COUNT = 2000
SURPRISE = 3.0
_CHECKED = 3  # last diagnoses of a fault that the predictive check looks at
_GIVEN_UP = 0.02  # probability of the law below which it counts as contradicted
_UNLIKELY = 0.003  # probability below which they contradict what was expected


def _chance(scores: Floats) -> float:
    """Return how likely squares of up to three normal numbers are together as large as these."""
    total = float(np.sum(scores**2))
    if len(scores) == 2:
        return float(np.exp(-0.5 * total))
    tail = erfc(sqrt(0.5 * total))
    more = sqrt(2.0 * total / pi) * float(np.exp(-0.5 * total))
    return tail if len(scores) == 1 else tail + more


class GrowthFilter:
    """Severities and growth of a unit, fault by fault.

    Faults are diagnosed one by one and hardly drive each other's growth: each has a `FaultFilter`
    of its own, whose clock runs at the pace that the other faults' means give it.

    Parameters
    ----------
    process : Process
        How units grow.
    seed : int
        Of chance.
    priors : mapping of str to (GrowthPrior, GrowthPrior), optional
        ``KIND@PLACE`` to what a fleet says of units beside the law and without it; default: what
        the laws say, and what is ASSUMED.

    Attributes
    ----------
    faults : list of FaultFilter
        One a law.
    usage : float
        Use so far.
    surprises : list of (float, str, float)
        Use, fault and deviations off of diagnoses that stood more than `SURPRISE` of them from
        what was expected.
    """

    def __init__(
        self,
        process: Process,
        *,
        seed: int = 0,
        priors: Mapping[str, tuple[GrowthPrior, GrowthPrior]] | None = None,
    ) -> None:
        self.process, self.usage = process, 0.0
        given = priors or {}
        self.faults = [
            FaultFilter(
                shapes,
                law,
                given.get(law.key, (prior_of(law), WITHOUT_LAW)),
                np.random.default_rng([15, seed, k]),
            )
            for k, (shapes, law) in enumerate(zip(process.shapes, process.laws, strict=True))
        ]
        self.surprises: list[tuple[float, str, float]] = []
        self._scores: list[list[float]] = [[] for _ in process.laws]
        self._seed = seed

    def update(self, item: Inspection) -> None:
        """Grow to an inspection, take in what it saw, make new what was replaced after it."""
        self._grow(item.usage)
        for k, law in enumerate(self.process.laws):
            seen = item.seen.get(law.key)
            if seen is not None:
                self._compare(k, seen)
                self.faults[k].update(seen)
        for name, value in item.measured.items():
            self._measured(name, value)
        for k, law in enumerate(self.process.laws):
            if law.key in item.reset:
                self.faults[k].renew()
                self._scores[k] = []

    def _grow(self, usage: float) -> None:
        if usage < self.usage:
            raise InputError(f"use goes back from {self.usage:g} to {usage:g}")
        if usage > self.usage:
            folds = ONSET * float(np.log(usage / self.usage)) if self.usage > 0.0 else 0.0
            paces = self.process.paces(self.medians()) if len(self.faults) > 1 else np.ones(1)
            for fault, pace in zip(self.faults, paces.tolist(), strict=True):
                fault.grow(usage - self.usage, pace, folds)
            self.usage = usage

    def medians(self) -> Floats:
        """Return the severities' means, shape (k,)."""
        return np.array([fault.expected()[0] for fault in self.faults])

    def _compare(self, k: int, seen: Seen) -> None:
        """Note a diagnosis that what was known before it hardly allows: not the first sighting."""
        if seen.severity is None or seen.probability < 0.5 or not self.faults[k].seen:
            return
        mean, variance = self.faults[k].expected()
        deviation = seen.low if mean < seen.severity else seen.high
        score = (seen.severity - mean) / np.sqrt(variance + deviation**2 + seen.common**2)
        self._scores[k].append(float(score))
        if abs(score) > SURPRISE:
            self.surprises.append((self.usage, self.process.laws[k].key, float(score)))

    def contradictions(self) -> list[tuple[float, str, float]]:
        """Return use, fault and deviations of what the last diagnoses, or all, say of the law.

        A predictive check: the squares of the last diagnoses' deviations from what was expected of
        each are together less likely than `_UNLIKELY`; or growth by the law has become less likely
        than `_GIVEN_UP`.
        """
        out = []
        for k, (law, fault) in enumerate(zip(self.process.laws, self.faults, strict=True)):
            if law.trust <= 0.0:
                continue
            scores = np.array(self._scores[k][-_CHECKED:])
            by_law = fault.by_law()
            if len(scores) and (_chance(scores) < _UNLIKELY or by_law < _GIVEN_UP):
                worst = float(scores[np.argmax(np.abs(scores))])
                out.append((self.usage, law.key, worst))
        return out

    def _measured(self, name: str, value: Measured) -> None:
        """Take in a requirement's own value: the model's at the unit's severities, and off it.

        The model's error is a share of its value; `LASTING` of its square stays as faults
        grow, the rest is the value's own scatter. It is laid to the law that moves it most.
        """
        response = self.process.response
        r, k = governing(response, name)
        limit = response.thresholds[r]
        reserve = float(response.requirements[r].reserve(np.array(value.value), limit))
        sign = 1.0 if response.requirements[r].at_least else -1.0
        size = MODEL_ERROR * (1.0 + sign * reserve)
        deviation = float(np.hypot(value.deviation / limit, np.sqrt(1.0 - LASTING) * size))
        others = self.medians()

        def model(level: Floats) -> Floats:
            severity = np.tile(others, (len(level), 1))
            severity[:, k] = np.maximum(level, 0.0)
            return np.asarray(response.reserve(severity)[r])

        lasting = float(np.sqrt(LASTING) * size)
        self.faults[k].measure(
            model, value=reserve, deviation=deviation, lasting=lasting, which=r,
            count=len(response.requirements),
        )  # fmt: skip

    def drawn(self, count: int, rng: np.random.Generator) -> UnitPopulation:
        """Draw units that may be this one."""
        laws, size = self.process.laws, len(self.process.response.requirements)
        numbers = {name: np.zeros((count, len(laws))) for name in NUMBERS}
        row = np.zeros((count, len(laws)), dtype=np.intp)
        active = np.ones((count, len(laws)), dtype=np.bool_)
        seeds = rng.integers(0, 2**63, len(laws) + 1)
        measured = any(fault.measured for fault in self.faults)
        free = np.random.default_rng(seeds[-1])
        off = free.standard_normal((count, len(laws), size if measured else 0))
        for k, fault in enumerate(self.faults):
            level, state, manner, active[:, k] = fault.draw(count, np.random.default_rng(seeds[k]))
            shapes = fault.shapes
            damage = np.interp(level, shapes.level, shapes.damage)
            numbers["damage"][:, k] = np.where(active[:, k], damage, 0.0)
            for name, index in (("growth", RATE), ("slope", SLOPE), ("wander", WANDER)):
                numbers[name][:, k] = state[:, index]
            for name in ("drift", "memory", "changes", "path"):
                numbers[name][:, k] = getattr(manner, name)
            row[:, k] = manner.row
            if fault.measured:
                off[:, k] = state[:, COMMON + 1 :]
        return UnitPopulation(**numbers, row=row, active=active, off=off, usage=self.usage)

    @property
    def units(self) -> UnitPopulation:
        """`COUNT` units that may be this one."""
        return self.drawn(COUNT, np.random.default_rng([16, self._seed]))
