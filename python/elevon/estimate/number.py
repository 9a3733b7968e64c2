"""One estimated number: its value, how well it is known, where it goes, what it stands on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Annotated, ClassVar

import numpy as np

from elevon.plain import WORKING, Plain, key

LEVEL = 0.90  # of every interval


@dataclass(frozen=True)
class Estimate(Plain):
    """A number with its interval.

    Attributes
    ----------
    value, std : float
        SI; standard deviation, for correlated residuals.
    degrees : float
        Degrees of freedom of the deviation.
    interval : (float, float)
        Of `LEVEL`; by default even about the value, from deviation and degrees.
    path : str
        Parameter path, or a name such as ``sensor.speed_offset`` for what no actuator file holds.
    unit : str
        SI unit.
    register : str
        ``plant``, ``controller``, ``sensor``, ``load`` or ``initial``.
    old : float or None
        Value before.
    source : str
        ``signals`` or ``simulation``.
    given : tuple of str
        Values of the actuator file it stands on: only the ratio to these is determined.
    note : str
        What else to know.
    in_set : bool
        Whether an actuator file has a place for it.
    """

    value: float
    std: float
    degrees: Annotated[float, WORKING] = field(default=math.inf, compare=False)
    interval: Annotated[tuple[float, float], key("low", "high")] = (math.nan, math.nan)
    path: str = ""
    unit: str = ""
    register: str = ""
    old: float | None = None
    source: str = "signals"
    given: tuple[str, ...] = ()
    note: str = ""
    in_set: bool = True

    COMPUTED: ClassVar = ("level",)
    level: ClassVar = LEVEL

    def __post_init__(self) -> None:
        if math.isnan(self.interval[0]):
            half = quantile(self.degrees) * self.std
            object.__setattr__(self, "interval", (self.value - half, self.value + half))

    def widened(self, std: float) -> Estimate:
        """Return it with a further deviation, independent of the others."""
        return Estimate(self.value, math.hypot(self.std, std), self.degrees)

    def scaled(self, factor: float) -> Estimate:
        """Return a multiple of it."""
        return Estimate(factor * self.value, abs(factor) * self.std, self.degrees)

    def inverted(self) -> Estimate:
        """Return one over it, to first order."""
        return Estimate(1.0 / self.value, self.std / self.value**2, self.degrees)

    def within(self, low: float = -math.inf, high: float = math.inf) -> Estimate:
        """Return it with an interval that keeps to what is possible."""
        ends = (max(self.interval[0], low), min(self.interval[1], high))
        return replace(self, interval=ends)


#: Numbers by path, and why others are not among them.
Determined = tuple[dict[str, Estimate], dict[str, str]]


def as_values(estimates: Mapping[str, Estimate]) -> dict[str, float]:
    """Return path to value."""
    return {path: item.value for path, item in estimates.items()}


def weighted_mean(pairs: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return mean and deviation of (value, deviation); wider where they scatter by more."""
    values, deviations = np.array(pairs).T
    weight = np.maximum(deviations, 1e-12) ** -2.0
    mean = float(np.sum(weight * values) / np.sum(weight))
    chi = float(np.sum(weight * (values - mean) ** 2)) / max(len(pairs) - 1, 1)
    return mean, math.sqrt(max(1.0, chi) / float(np.sum(weight)))


@cache
def quantile(degrees: float) -> float:
    """Half width of an interval of `LEVEL` in standard deviations, Student's t."""
    from scipy.stats import t

    tail = 0.5 + 0.5 * LEVEL
    return float(t.ppf(tail, max(degrees, 2.0))) if math.isfinite(degrees) else 1.6449
