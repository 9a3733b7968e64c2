"""An answer held against what was injected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from elevon.diagnose.engine.answer import Cause, Diagnosis

__all__ = ["Injected", "Row", "judged"]


@dataclass(frozen=True)
class Injected:
    """A fault put into a log, SI.

    Attributes
    ----------
    kind, place : str
        Of the catalogue.
    severity : float
        In the catalogue's unit.
    """

    kind: str
    place: str
    severity: float

    @property
    def text(self) -> str:
        """In the grammar of faults."""
        return f"{self.kind}@{self.place}={self.severity!r}"


@dataclass(frozen=True)
class Row:
    """One log: what was true, what was reported.

    Attributes
    ----------
    name, test, group : str
        The log, its test, and the part of the campaign it belongs to.
    unit : int
        The unit of the bench.
    truth : tuple of Injected
        None for a healthy log.
    alarm : bool
        Called faulty.
    named : bool
        The most probable set is the injected one, and nothing of another kind explains it.
    causes : tuple of str
        That set.
    severities : tuple of (float, float, float) or None
        Median and 90 % interval for each injected fault, None where it is not listed.
    p_fault, chance, seconds : float
        As in the answer.
    """

    name: str
    test: str
    group: str
    unit: int
    truth: tuple[Injected, ...]
    alarm: bool
    named: bool
    causes: tuple[str, ...]
    severities: tuple[tuple[float, float, float] | None, ...]
    p_fault: float
    chance: float
    seconds: float

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "name": self.name,
            "test": self.test,
            "group": self.group,
            "unit": self.unit,
            "faults": [item.text for item in self.truth],
            "alarm": self.alarm,
            "named": self.named,
            "causes": list(self.causes),
            "severities": [None if s is None else list(s) for s in self.severities],
            "p_fault": self.p_fault,
            "chance": self.chance,
            "seconds": self.seconds,
        }


def judged(
    result: Diagnosis, name: str, *, test: str, group: str, unit: int, truth: Sequence[Injected]
) -> Row:
    """Hold an answer against the truth."""
    causes = [_cause(result, item) for item in truth]
    right = {f"{c.kind}@{c.place}" for c in causes if c is not None}
    sole = all(c is not None and all(k == c.kind for k, _ in c.ambiguous_with) for c in causes)
    named = result.status == "faulty" and set(result.best) == right and len(right) == len(truth)
    return Row(
        name,
        test,
        group,
        unit,
        tuple(truth),
        result.alarm,
        bool(truth) and named and sole,
        result.best if result.status == "faulty" else (),
        tuple(None if c is None else (c.severity, *c.interval) for c in causes),
        result.p_fault,
        result.chance,
        result.seconds,
    )


def _cause(result: Diagnosis, item: Injected) -> Cause | None:
    """Return the cause of the answer that names the injected fault, or a place like it."""
    for cause in result.faults:
        places = {cause.place} | {p for kind, p in cause.ambiguous_with if kind == item.kind}
        if cause.kind == item.kind and item.place in places:
            return cause
    return None
