"""What `nasa-separation` seeds and reports."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any

from elevon.plain import REMAINDER, WORKING, fields_of
from elevon.report.checks import Check, CheckedResult
from elevon.reproduce.nasa.effect import Effect
from elevon.reproduce.nasa.impact import Impact, ImpactTrace


@dataclass(frozen=True, slots=True)
class Seeded:
    """A fault, the severity seeded, and the feature named for it beforehand."""

    name: str
    grammar: str
    severity: float
    unit: str
    feature: str

    def text(self, share: float = 1.0) -> str:
        """Return the fault in the grammar of the command line, at a share of its severity."""
        return f"{self.grammar}={share * self.severity:g}{self.unit and ' ' + self.unit}"


@dataclass(frozen=True, slots=True)
class SeparationRow:
    """How far one fault stands from healthy in one profile under one load.

    Attributes
    ----------
    fault, feature, unit, profile : str
        What.
    load : float
        N, opposing.
    healthy, faulty : float
        Means of the feature, in its unit.
    effect : Effect
        In healthy standard deviations, with its interval.
    half : Effect or None
        Of half the severity, where it was run.
    winner : bool or None
        Whether this profile shows the fault best under this load; None: no profile can be named.
    power : float
        Probability that another such experiment names the best profile of this fault and load.
    draws : int or None
        Faulty draws (and as many times more healthy ones) that would name it, were the effects as
        estimated; None where it is named or where the fault is not shown.
    """

    fault: str
    feature: str
    unit: str
    profile: str
    load: float
    healthy: float
    faulty: float
    effect: Effect
    half: Effect | None
    winner: bool | None
    power: float
    draws: int | None

    def to_dict(self) -> dict[str, object]:
        """Return one row of the command's JSON object."""
        return fields_of(
            self, "fault", "profile", "load_n=load", "feature", "unit", "healthy", "faulty",
            "effect_size=effect.size", "interval=effect.interval", "half_severity=half.size",
            "winner", "power", "draws_needed=draws",
        )  # fmt: skip


@dataclass(frozen=True)
class SeparationResult(CheckedResult):
    """Everything `elevon reproduce nasa-separation` reports.

    Attributes
    ----------
    rows : list of SeparationRow
        One a fault, load and profile.
    impacts : list of Impact
        Excess of the load cell's peak that the gap makes.
    null_rate, null_tables : float
        Share of the healthy-against-healthy comparisons above the threshold, and of the whole
        tables that hold any.
    healthy, reassemblies : int
        Healthy units, and units of each fault.
    level : float
        Of every interval, so that all of them hold together with 95 %.
    traces : list of ImpactTrace
        Load-cell force of the nominal actuator about a reversal, with and without the gap.
    """

    rows: list[SeparationRow]
    impacts: list[Impact]
    checks: list[Check]
    null_rate: float
    null_tables: float
    seed: int
    healthy: int
    reassemblies: int
    level: float
    traces: Annotated[list[ImpactTrace], WORKING] = field(default_factory=list)
    meta: Annotated[dict[str, Any], REMAINDER] = field(default_factory=dict)

    def winners(self) -> dict[tuple[str, float], str | None]:
        """Return the best profile of each fault and load, None where none can be named."""
        best: dict[tuple[str, float], str | None] = {}
        for row in self.rows:
            best.setdefault((row.fault, row.load), None)
            if row.winner:
                best[row.fault, row.load] = row.profile
        return best
