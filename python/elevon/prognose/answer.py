"""The answer of a prognosis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from elevon.prognose.future import Future

__all__ = ["KnownFault", "Prognosis", "survival"]


@dataclass(frozen=True)
class KnownFault:
    """What is known of one fault at the last inspection.

    Attributes
    ----------
    kind, place, unit, law : str
        The fault and the law that drives it.
    severity, interval : float, (float, float)
        Median and interval, of the prognosis' level.
    factor, factor_interval : float, (float, float)
        The unit's own factor on the law's rate.
    inspections : int
        Inspections that saw the fault.
    growing : float
        Probability that it grows; the factor is that of the futures in which it does.
    """

    kind: str
    place: str
    unit: str
    law: str
    severity: float
    interval: tuple[float, float]
    factor: float
    factor_interval: tuple[float, float]
    inspections: int
    growing: float = 1.0

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "kind": self.kind,
            "place": self.place,
            "unit": self.unit,
            "law": self.law,
            "severity": self.severity,
            "interval": list(self.interval),
            "factor": self.factor,
            "factor_interval": list(self.factor_interval),
            "inspections": self.inspections,
            "p_growing": self.growing,
        }


@dataclass(frozen=True)
class Prognosis:
    """Remaining useful life of one unit.

    Attributes
    ----------
    unit : str
        Of use.
    usage : float
        Use at the last inspection.
    level : float
        Of all intervals.
    future : Future
        The samples.
    requirements : tuple of str
        Names, in the order of `Future.first`.
    known : tuple of KnownFault
        Severities and growth at the last inspection.
    reserve : tuple of dict
        Each requirement's ``name``, ``value``, ``threshold``, ``unit`` at the median severities.
    findings : tuple of str
        What the caller should know.
    serial : str
        Of the unit.
    seconds : dict of str to float
        Time of ``tables``, ``updates``, ``prediction``.
    """

    unit: str
    usage: float
    level: float
    future: Future
    requirements: tuple[str, ...]
    known: tuple[KnownFault, ...]
    reserve: tuple[dict[str, Any], ...]
    findings: tuple[str, ...]
    serial: str = ""
    seconds: Mapping[str, float] = field(default_factory=dict, compare=False)

    @property
    def median(self) -> float:
        """Median of the remaining useful life; infinite where no end is in sight."""
        return self.quantile(0.5)

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of `level`."""
        tail = 0.5 * (1.0 - self.level)
        return self.quantile(tail), self.quantile(1.0 - tail)

    def quantile(self, share: float) -> float:
        """Return a quantile of the remaining useful life."""
        ranked = np.sort(self.future.remaining)
        return float(ranked[min(int(share * len(ranked)), len(ranked) - 1)])

    @property
    def first(self) -> dict[str, float]:
        """Share of the futures in which each requirement fails first, largest first."""
        failed = self.future.first
        shares = {name: float(np.mean(failed == k)) for k, name in enumerate(self.requirements)}
        return dict(sorted(shares.items(), key=lambda item: -item[1]))

    def survives(self, more: float) -> float:
        """Return the probability of surviving `more` units of use."""
        return float(np.mean(self.future.remaining > more))

    def to_dict(self, horizons: Sequence[float] = ()) -> dict[str, Any]:
        """Return the JSON form; lives without end in sight are null."""
        low, high = self.interval
        likely = next(iter(self.first))
        none = not np.isfinite(self.future.end).any()
        return {
            "status": "ok",
            "serial": self.serial or None,
            "usage": self.usage,
            "rul": {
                "median": _number(self.median),
                "interval": [_number(low), _number(high)],
                "level": self.level,
                "unit": self.unit,
            },
            "p_survive": [[n, p] for n, p in survival(self, horizons)],
            "first_requirement": None if none else likely,
            "first_shares": self.first,
            "eol_samples": len(self.future.end),
            "faults": [item.to_dict() for item in self.known],
            "requirements": [dict(item) for item in self.reserve],
            "findings": list(self.findings),
            "seconds": dict(self.seconds),
        }


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def survival(result: Prognosis, horizons: Sequence[float] = ()) -> list[tuple[float, float]]:
    """Return the probability of surviving the next N, at round N or at those given."""
    if horizons:
        return [(float(n), result.survives(float(n))) for n in horizons]
    finite = result.future.remaining[np.isfinite(result.future.remaining)]
    far = float(np.quantile(finite, 0.99)) if len(finite) else 1000.0
    if far <= 0.0:
        return [(0.0, 0.0)]
    step = _round_up(far / 10.0)
    return [(k * step, result.survives(k * step)) for k in range(1, 11)]


def _round_up(value: float) -> float:
    """Return the next of 1, 2, 5, 10, ... at or above a value."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= value * (1.0 - 1e-9))
