"""The answer of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

__all__ = ["SEEN", "Alternative", "Cause", "Diagnosis", "Explanation", "Moved"]

SEEN = 3.0  # deviations that a fault's shift must reach to be observable


@dataclass(frozen=True)
class Cause:
    """One distinguishable cause.

    Attributes
    ----------
    kind, place, unit : str
        Of the catalogue.
    probability : float
        Marginal.
    severity : float
        Median.
    interval : (float, float)
        Of 90 %.
    ambiguous_with : tuple of (str, str)
        Kinds and places that the logs do not separate from it.
    """

    kind: str
    place: str
    unit: str
    probability: float
    severity: float
    interval: tuple[float, float]
    ambiguous_with: tuple[tuple[str, str], ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "kind": self.kind,
            "place": self.place,
            "probability": self.probability,
            "severity": self.severity,
            "unit": self.unit,
            "interval": list(self.interval),
            "ambiguous_with": [{"kind": k, "place": p} for k, p in self.ambiguous_with],
        }


@dataclass(frozen=True)
class Explanation:
    """One set of faults that may be there.

    Attributes
    ----------
    faults : tuple of (str, str, str)
        Kind, place and unit of each; none for healthy.
    probability : float
        Of this set and no other.
    severity : tuple of float
        Median of each.
    interval : tuple of (float, float)
        Of 90 %, of each.
    """

    faults: tuple[tuple[str, str, str], ...]
    probability: float
    severity: tuple[float, ...]
    interval: tuple[tuple[float, float], ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        rows = zip(self.faults, self.severity, self.interval, strict=True)
        return {
            "faults": [
                {"kind": k, "place": p, "severity": s, "unit": u, "interval": list(ends)}
                for (k, p, u), s, ends in rows
            ],
            "probability": self.probability,
        }


@dataclass(frozen=True)
class Alternative:
    """A healthy unit or a single fault that is not the answer, and what speaks against it.

    Attributes
    ----------
    fault : str
        ``KIND@PLACE``; empty for a healthy unit.
    probability : float
        Of this and no other.
    severity : float or None
        At which it explains the logs best.
    unit : str
        Of it.
    log, name : str
        Log and feature that it explains worst.
    left : float
        What it leaves of that number, in deviations with its own model error.
    """

    fault: str
    probability: float
    severity: float | None
    unit: str
    log: str
    name: str
    left: float

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


@dataclass(frozen=True)
class Moved:
    """One feature against the healthy unit."""

    log: str
    name: str
    unit: str
    value: float
    expected: float
    deviation: float
    explained: float

    @property
    def score(self) -> float:
        """Deviations from the healthy unit."""
        return (self.value - self.expected) / self.deviation

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "log": self.log,
            "name": self.name,
            "unit": self.unit,
            "value": self.value,
            "expected": self.expected,
            "deviation": self.deviation,
            "explained": self.explained,
            "score": self.score,
        }


@dataclass(frozen=True)
class Diagnosis:
    """The answer.

    Attributes
    ----------
    logs : tuple of str
        The logs.
    status : str
        ``healthy`` or ``faulty``.
    p_fault : float
        Probability of any fault.
    false_alarm : float
        Rate the status was set for.
    chance : float
        How often a healthy unit deviates as much.
    faults : tuple of Cause
        Most probable first.
    best : tuple of str
        The most probable set of faults, ``KIND@PLACE``.
    p_best : float
        Its probability.
    unobservable : tuple of dict
        ``kind``, ``place``, ``reason``.
    detectable : dict of str to float
        Smallest severity of each fault that moves the features by `SEEN` deviations.
    moved : tuple of Moved
        The features.
    findings : tuple of str
        What the caller should know.
    seconds : float
        Wall time from the logs in memory to the answer.
    hypotheses : tuple of Explanation
        Sets of faults that are still possible, most probable first.
    alternatives : tuple of Alternative
        A healthy unit and the other single faults, and what speaks against each.
    units : mapping of str to str
        Unit of each candidate's severity, by ``KIND@PLACE``.
    p_other : float
        Probability of a fault that is no candidate; part of `p_fault`. Where it is the most
        probable, a faulty unit has an empty `best`.
    """

    logs: tuple[str, ...]
    status: str
    p_fault: float
    false_alarm: float
    chance: float
    faults: tuple[Cause, ...]
    best: tuple[str, ...]
    p_best: float
    unobservable: tuple[dict[str, str], ...]
    detectable: dict[str, float]
    moved: tuple[Moved, ...]
    findings: tuple[str, ...]
    seconds: float = field(compare=False)
    hypotheses: tuple[Explanation, ...] = ()
    alternatives: tuple[Alternative, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    p_other: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "status": self.status,
            "p_fault": self.p_fault,
            "p_other": self.p_other,
            "false_alarm": self.false_alarm,
            "chance": self.chance,
            "faults": [cause.to_dict() for cause in self.faults],
            "best": {"faults": list(self.best), "probability": self.p_best},
            "hypotheses": [item.to_dict() for item in self.hypotheses],
            "alternatives": [item.to_dict() for item in self.alternatives],
            "unobservable": [dict(item) for item in self.unobservable],
            "detectable": dict(self.detectable),
            "features": [item.to_dict() for item in self.moved],
            "findings": list(self.findings),
            "logs": list(self.logs),
            "seconds": self.seconds,
        }
