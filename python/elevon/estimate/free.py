"""One free parameter: what a fit may move, between which bounds, in which steps that matter."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats

_LEAST = 0.02  # of a first value that does not change its sign


@dataclass(frozen=True)
class Free:
    """One number that a fit may move. The fitted variable counts in spreads.

    Attributes
    ----------
    path : str
        Parameter path, or a name for what no actuator file holds.
    start : float
        First value, SI.
    spread : float
        A change that matters, or the deviation of what is believed before: of the logarithm, or SI.
    low, high : float
        Bounds, SI.
    log_scale : bool
        Whether the logarithm is fitted.
    unit, register : str
        SI unit and register, for the report.
    kind : str
        ``parameter``, ``output`` (acts on a simulated signal) or ``input`` (acts on the load).
    """

    path: str
    start: float
    spread: float
    low: float = -math.inf
    high: float = math.inf
    log_scale: bool = False
    unit: str = ""
    register: str = ""
    kind: str = "parameter"

    @classmethod
    def about(cls, path: str, first: float, share: float, *, signed: bool = False) -> Free:
        """Return a number believed within a share of its first value; its sign stays."""
        return cls(path, first, share * first, low=-math.inf if signed else _LEAST * first)

    def inner(self, value: float) -> float:
        """Return the fitted variable of a value."""
        return (math.log(value) if self.log_scale else value) / self.spread

    def outer(self, x: float) -> float:
        """Return the value of a fitted variable."""
        return math.exp(x * self.spread) if self.log_scale else x * self.spread

    def slope(self, x: float) -> float:
        """Return d value / d fitted variable."""
        return self.spread * (self.outer(x) if self.log_scale else 1.0)


def inner(free: Sequence[Free], values: Mapping[str, float] | None = None) -> Floats:
    """Return the point of some values (of the starts), shape (p,), clipped to the bounds."""
    given = values or {}
    return np.array([f.inner(min(max(given.get(f.path, f.start), f.low), f.high)) for f in free])


def outer(free: Sequence[Free], x: Floats) -> dict[str, float]:
    """Return paths and values of a point, shape (p,)."""
    return {f.path: f.outer(float(v)) for f, v in zip(free, x, strict=True)}


def bounds(free: Sequence[Free]) -> tuple[Floats, Floats]:
    """Return the lowest and the highest fitted variables, shape (p,) each."""
    return np.array([f.inner(f.low) for f in free]), np.array([f.inner(f.high) for f in free])
