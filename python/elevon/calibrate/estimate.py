"""One estimated number: where it goes, how well it is known, what it stands on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

__all__ = ["LEVEL", "Estimate", "quantile"]

LEVEL = 0.90  # of every interval


@dataclass(frozen=True)
class Estimate:
    """A parameter with its interval.

    Attributes
    ----------
    path : str
        Parameter path, or a name such as ``sensor.speed_offset`` for what no actuator file holds.
    value : float
        SI.
    std : float
        Standard deviation, for coloured residuals.
    interval : (float, float)
        Of `LEVEL`.
    unit : str
        SI unit.
    register : str
        ``plant``, ``controller``, ``sensor``, ``load`` or ``initial``.
    old : float or None
        Value before.
    method : str
        ``simulation`` or ``direct``.
    given : tuple of str
        Values of the actuator file it stands on: only the ratio to these is determined.
    note : str
        What else to know.
    in_set : bool
        Whether an actuator file has a place for it.
    """

    path: str
    value: float
    std: float
    interval: tuple[float, float]
    unit: str
    register: str
    old: float | None = None
    method: str = "simulation"
    given: tuple[str, ...] = ()
    note: str = ""
    in_set: bool = True

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain types."""
        return {
            "path": self.path,
            "value": self.value,
            "unit": self.unit,
            "std": self.std,
            "low": self.interval[0],
            "high": self.interval[1],
            "level": LEVEL,
            "old": self.old,
            "register": self.register,
            "method": self.method,
            "given": list(self.given),
            "note": self.note,
            "in_set": self.in_set,
        }


def quantile(degrees: float) -> float:
    """Half width of an interval of `LEVEL` in standard deviations, Student's t."""
    from scipy.stats import t

    tail = 0.5 + 0.5 * LEVEL
    return float(t.ppf(tail, max(degrees, 2.0))) if math.isfinite(degrees) else 1.6449
