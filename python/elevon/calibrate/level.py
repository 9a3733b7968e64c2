"""A determined value: how far it may be off, and its interval."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from elevon.calibrate.estimate import quantile

__all__ = ["Level", "as_values"]


@dataclass(frozen=True)
class Level:
    """A value with its deviation and degrees of freedom."""

    value: float
    std: float
    degrees: float = np.inf

    @property
    def interval(self) -> tuple[float, float]:
        """90 % interval."""
        half = quantile(self.degrees) * self.std
        return self.value - half, self.value + half

    def widened(self, std: float) -> Level:
        """Return it with a further deviation, independent of the others."""
        return Level(self.value, float(np.hypot(self.std, std)), self.degrees)


def as_values(levels: Mapping[str, Level]) -> dict[str, float]:
    """Return path to value."""
    return {path: item.value for path, item in levels.items()}
