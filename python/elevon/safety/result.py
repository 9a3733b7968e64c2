"""What a safety campaign finds: failures, cut sets, hazards, fidelity, and the rules they keep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from elevon.plain import STORED, WORKING, Plain, key
from elevon.report.checks import Check, CheckedResult
from elevon.safety.outcomes import Detection, Outcomes


@dataclass(frozen=True)
class FailureResult(Plain):
    """One failure: its rate, and how it is revealed.

    Attributes
    ----------
    name, part : str
        Its name, and the part that fails.
    rate, rate_low, rate_high : float
        Failures an hour and their interval.
    alpha, effect : float
        Share of the part's failures; probability that it is as severe as tried.
    evident : bool
        Whether it is seen within a flight.
    interval : float
        Hours until it is revealed: the flight, or the interval of its check.
    check : str
        What reveals it: the message, or the check.
    detections : tuple of Detection
        Phase by phase.
    source : str
        Where the rate is from.
    """

    name: str
    part: str
    rate: float
    rate_low: float
    rate_high: float
    alpha: float
    effect: float
    evident: bool
    interval: Annotated[float, key("interval_h")]
    check: str
    detections: Annotated[tuple[Detection, ...], STORED]
    source: Annotated[str, STORED]


@dataclass(frozen=True)
class CutSet(Plain):
    """A minimal set of failures that leads to a hazard.

    Attributes
    ----------
    failures : tuple of str
        Their names.
    order : int
        How many.
    dormant : tuple of str
        Those that nobody sees until their check.
    last : tuple of str
        Those of which one must come last; all of them: the order does not matter.
    phase : str
        The situation in which it is most frequent.
    mean, worst : float
        Events a flight hour over all flights, in the worst flight.
    low, high : float
        Mean with all rates at their least, and at their largest.
    common : float
        Part of the mean that common causes have.
    rows : tuple of int
        Rows that show it.
    """

    failures: tuple[str, ...]
    order: int
    dormant: tuple[str, ...]
    last: tuple[str, ...]
    phase: str
    mean: float
    worst: float
    low: float
    high: float
    common: Annotated[float, key("common_cause")]
    rows: tuple[int, ...]


@dataclass(frozen=True)
class Importance(Plain):
    """What one failure does for one hazard.

    Attributes
    ----------
    failure : str
        Its name.
    fussell_vesely : float
        Share of the hazard's mean that sets with the failure have.
    birnbaum : float
        Derivative of the hazard's mean with respect to the failure's rate.
    """

    failure: str
    fussell_vesely: float
    birnbaum: float


@dataclass(frozen=True)
class CheckEffect(Plain):
    """What a check's interval does for a hazard: its mean with half and with twice the interval."""

    check: str
    interval: Annotated[float, key("interval_h")]
    half: float
    twice: float


@dataclass(frozen=True)
class ThirdOrder(Plain):
    """A sampled bound on sets of three failures: never a cut set.

    Attributes
    ----------
    drawn, showing : int
        Situations with three failures, and those that show the hazard though no smaller set does.
    total : float
        Frequency of all sets of three, in 1/h.
    bound : float
        Upper end of the 95 % interval of the share, times the total.
    """

    drawn: int
    showing: int
    total: float
    bound: float


@dataclass(frozen=True)
class HazardRow(Plain):
    """A row that shows a hazard: its place, when it begins in s, at which fidelity, and why."""

    row: int
    time: float
    fidelity: str
    reason: str


@dataclass(frozen=True)
class HazardResult(Plain):
    """One hazard against its target.

    Attributes
    ----------
    name, text : str
        What it is.
    severity : str
        catastrophic, hazardous, major or minor.
    mean, worst : float
        Events a flight hour, over all flights and in the worst one.
    interval : tuple of float
        Mean with all rates at their least and at their largest.
    target : float
        Largest mean allowed.
    cut_sets : tuple of CutSet
        The most frequent first.
    third_order : ThirdOrder
        Bound on sets of three.
    importance : tuple of Importance
        The most important failure first.
    check_effects : tuple of CheckEffect
        Of each check.
    findings : tuple of HazardRow
        All rows that show it.
    healthy : int
        Rows without a failure that show it.
    """

    COMPUTED = ("met", "rows", "listed", "single")

    name: str
    text: str
    severity: Annotated[str, key("class")]
    mean: float
    worst: float
    interval: tuple[float, float]
    target: float
    cut_sets: tuple[CutSet, ...]
    third_order: ThirdOrder
    importance: tuple[Importance, ...]
    check_effects: tuple[CheckEffect, ...]
    findings: Annotated[tuple[HazardRow, ...], STORED]
    healthy: int

    @property
    def met(self) -> bool:
        """Whether the mean keeps the target."""
        return self.mean <= self.target

    @property
    def rows(self) -> int:
        """Rows that show it."""
        return len(self.findings)

    @property
    def listed(self) -> int:
        """Rows for which it is stated why no sensor could tell."""
        return sum(bool(finding.reason) for finding in self.findings)

    @property
    def single(self) -> int:
        """Failures that lead to it alone."""
        return sum(item.order == 1 for item in self.cut_sets)


@dataclass(frozen=True)
class Fidelity(Plain):
    """What the switching model said of rows that the reduced one ran.

    Attributes
    ----------
    near_limit : int
        Rows near a limit that could change their outcome.
    rerun_high, not_rerun : int
        Rows that ran in the switching model, and those that did not.
    changed_outcome : int
        Rows whose outcome the two do not share.
    rate, rate_interval : float, tuple of float
        Share of the others, drawn at random, whose outcome changed, with its 95 % interval.
    changed : tuple of int
        The rows.
    """

    near_limit: int
    rerun_high: int
    not_rerun: int
    changed_outcome: int
    rate: float
    rate_interval: tuple[float, float]
    changed: tuple[int, ...]


@dataclass(frozen=True)
class Coverage(Plain):
    """A monitor: how many failures it announces, and which share of all rates."""

    monitor: str
    failures: int
    share: float


@dataclass(frozen=True)
class TripleSample:
    """Rows with three failures, and the frequency of all sets of three [1/h]."""

    rows: tuple[int, ...]
    total: float


@dataclass(frozen=True)
class SafetyResult(CheckedResult):
    """What the campaign showed.

    Attributes
    ----------
    actuator : str
        What was run.
    runs : int
        Rows run.
    unsafe : int
        Rows with a failure that show a hazard, listed or not.
    groups : dict
        Rows of each part.
    failures : tuple of FailureResult
        In the catalogue's order.
    hazards : tuple of HazardResult
        In the order of the campaign's hazards.
    fidelity : Fidelity
        What the switching model said.
    coverage : tuple of Coverage
        Of each monitor.
    checks : list of Check
        The rules.
    flight : float
        Duration of a flight in h.
    seed : int
        Of surroundings and triples.
    record : str
        What was recorded of a run.
    outcomes : Outcomes
        The rows and what they showed.
    """

    actuator: str
    runs: int
    unsafe: int
    groups: dict[str, int]
    failures: tuple[FailureResult, ...]
    hazards: tuple[HazardResult, ...]
    fidelity: Fidelity
    coverage: tuple[Coverage, ...]
    checks: list[Check]
    flight: Annotated[float, key("flight_time_h")]
    seed: int
    record: str
    outcomes: Annotated[Outcomes, WORKING]
