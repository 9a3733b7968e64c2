"""The answer of a diagnosis."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple

from elevon.number_text import severity_texts
from elevon.plain import WORKING, Plain, in_unit, key
from elevon.report import ReportTable
from elevon.results import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.diagnose.by_model import DiagnosisRequest
    from elevon.report import Report

SEEN = 3.0  # deviations that a fault's shift must reach to be observable


class FaultPlace(NamedTuple):
    """A kind of fault and its place."""

    kind: str
    place: str

    @property
    def key(self) -> str:
        """``KIND@PLACE``."""
        return f"{self.kind}@{self.place}"


class SuspectedFault(NamedTuple):
    """A fault with the median of its severity and the interval of 90 %."""

    kind: str
    place: str
    severity: float
    unit: str
    interval: tuple[float, float]


@dataclass(frozen=True)
class Cause(Plain):
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
    ambiguous_with : tuple of FaultPlace
        Kinds and places that the logs do not separate from it.
    """

    kind: str
    place: str
    unit: str
    probability: float
    severity: float
    interval: tuple[float, float]
    ambiguous_with: tuple[FaultPlace, ...] = ()


@dataclass(frozen=True)
class Explanation(Plain):
    """One set of faults that may be there.

    Attributes
    ----------
    faults : tuple of SuspectedFault
        None for healthy.
    probability : float
        Of this set and no other.
    """

    faults: tuple[SuspectedFault, ...]
    probability: float


@dataclass(frozen=True)
class Alternative(Plain):
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


@dataclass(frozen=True)
class Moved(Plain):
    """One feature against the healthy unit."""

    COMPUTED: ClassVar = ("score",)

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


@dataclass(frozen=True)
class Reason(Plain):
    """Why no cause is named: a feature of the logs, its value and the limit that it passes."""

    feature: str
    value: float
    limit: float


def _severity_cells(cause: Cause) -> tuple[str, str, str]:
    """Return a severity with its interval; a class may have none."""
    if math.isnan(cause.severity):
        return "-", "-", "-"
    return severity_texts(cause.severity, cause.interval, cause.unit)


@dataclass(frozen=True)
class Diagnosis(Result):
    """The answer.

    Attributes
    ----------
    logs : tuple of str
        The logs.
    status : str
        ``healthy``; ``faulty``; ``unknown_fault``: no candidate explains the logs, nor a healthy
        unit; ``model_does_not_fit``: the model does not show what the healthy unit shows;
        ``undecided``: no healthy state of this unit is known, neither a calibration nor a healthy
        log of the test. The last three name no faults and have a `reason`.
    p_fault : float
        Probability of any fault; where `status` is ``undecided``, if the unit were the file's.
    false_alarm : float
        Rate the status was set for.
    chance : float
        How often a healthy unit deviates as much.
    faults : tuple of Cause
        Most probable first.
    best : tuple of str
        The most probable set of faults, ``KIND@PLACE``.
    p_best : float
        Its probability; where no cause is named, that of no candidate.
    unobservable : tuple of dict
        ``kind``, ``place``, ``reason``.
    detectable : dict of str to float
        Smallest severity of each fault that moves the features by `SEEN` deviations.
    features : tuple of Moved
        Against the healthy unit.
    would_be_seen : dict of str to float
        Of a healthy answer: severity from which on each candidate would have raised an alarm in
        nine of ten such logs, the most frequent fault first. A candidate that is missing would
        not have been seen at any severity up to the catalogue's limit.
    findings : tuple of str
        What the caller should know.
    seconds : float
        Wall time from the logs in memory to the answer.
    hypotheses : tuple of Explanation
        Sets of faults that are still possible, most probable first.
    alternatives : tuple of Alternative
        A healthy unit and the other single faults, and what speaks against each.
    severity_units : mapping of str to str
        Unit of each candidate's severity, by ``KIND@PLACE``.
    p_other : float
        Probability of a fault that is no candidate; part of `p_fault`. From one half on it is
        unknown.
    reason : Reason or None
        Why no cause is named.
    rate : str
        ``guaranteed``: `false_alarm` holds for any distribution of healthy days, by as many healthy
        logs as that needs; ``assumed``: by a predictive distribution on a stated prior.
    actuator, parameter_hash : str
        Name of the actuator file, and the digits of its values.
    baselines : tuple of str
        Names of the healthy logs that were given.
    made_by : str
        Version of Elevon.
    method : str
        ``model``, or ``learned``: by classes that were learnt.
    prior : mapping of str to float
        Of classes that were learnt: the share of the learnt logs that have each, by
        ``KIND@PLACE``.
    request : DiagnosisRequest or None
        Logs and actuator of an answer by the model: its page draws the signals by them.
    """

    logs: tuple[str, ...]
    status: Literal["healthy", "faulty", "unknown_fault", "model_does_not_fit", "undecided"]
    p_fault: float
    false_alarm: float
    chance: float
    faults: tuple[Cause, ...]
    best: Annotated[tuple[str, ...], key("best.faults")]
    p_best: Annotated[float, key("best.probability")]
    unobservable: tuple[dict[str, str], ...]
    detectable: dict[str, float]
    features: tuple[Moved, ...]
    findings: tuple[str, ...]
    seconds: Annotated[float, in_unit("s")] = field(compare=False)
    hypotheses: tuple[Explanation, ...] = ()
    alternatives: tuple[Alternative, ...] = ()
    severity_units: Mapping[str, str] = field(default_factory=dict)
    would_be_seen: Mapping[str, float] = field(default_factory=dict)
    p_other: float = 0.0
    reason: Reason | None = None
    rate: Literal["guaranteed", "assumed"] = "assumed"
    actuator: str = ""
    parameter_hash: str = ""
    baselines: tuple[str, ...] = ()
    made_by: str = ""
    method: str = "model"
    prior: Mapping[str, float] = field(default_factory=dict)
    request: Annotated[DiagnosisRequest | None, WORKING] = field(
        default=None, compare=False, repr=False
    )

    KIND: ClassVar = "diagnosis"
    TABLE: ClassVar = "faults"
    COLUMNS: ClassVar = ("kind", "place", "probability", "severity", "unit", "interval")

    def to_dict(self, *, stored: bool = True) -> dict[str, Any]:
        """Return the JSON form; `prior` stands in it where classes were learnt."""
        data = super().to_dict(stored=stored)
        if not self.prior:
            del data["prior"]
        return data

    @property
    def alarm(self) -> bool:
        """Whether a fault is there, a candidate or another."""
        return self.status in ("faulty", "unknown_fault")

    @property
    def headline(self) -> str:
        """The answer in one line."""
        from elevon.diagnose.engine.page import verdict

        return verdict(self)

    def text_tables(self) -> list[ReportTable]:
        """Return the causes, the most probable first."""
        from elevon.diagnose.engine.page import folded

        rows = [
            (f"{c.kind}@{c.place}", f"{c.probability:.3f}", *_severity_cells(c),
             ", ".join(folded(c)))
            for c in self.faults
        ]  # fmt: skip
        columns = ("cause", "probability", "severity", "low", "high", "ambiguous with")
        return [ReportTable(columns, rows)]

    @property
    def remarks(self) -> list[str]:
        """What the caller should know: findings, the answer in words, what cannot be seen."""
        from elevon.diagnose.engine.page import by_reason, sentence

        unseen = [f"not observable: {n}: {reason}" for n, reason in by_reason(self.unobservable)]
        return [*self.findings, sentence(self), *unseen]

    def plot(self) -> Figure:
        """Return how far each feature deviates from a healthy unit."""
        from elevon.diagnose.pictures import features_figure

        return features_figure(self.features)

    def report(self, *, date: str | None = None) -> Report:
        """Return its page, with the logs' signals where it was computed in this process."""
        from elevon.diagnose.engine.page import diagnosis_page

        traces = () if self.request is None else self.request.traces(self)
        return diagnosis_page(self, self.actuator, date, traces=traces)
