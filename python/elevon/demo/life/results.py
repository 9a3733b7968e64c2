"""What the demonstration of a life holds: its unit, its inspections, its predictions."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from elevon.calibrate.outcome import Calibration
from elevon.demo.steps import Story
from elevon.diagnose.engine.answer import Diagnosis
from elevon.prognose import Inspection, Prognosis, ResponseTables
from elevon.prognose.future import Life
from elevon.prognose.metrics import Track, cumulative_relative_accuracy
from elevon.report.checks import Check


@dataclass(frozen=True)
class Statement:
    """What a diagnosis says, as it is kept.

    Attributes
    ----------
    data : dict
        Its JSON form.
    text : str
        In words.
    """

    data: dict[str, Any]
    text: str

    @classmethod
    def of(cls, answer: Diagnosis) -> Statement:
        """Take it from the whole answer."""
        from elevon.diagnose.engine.words import sentence

        return cls(answer.to_dict(), sentence(answer))

    @property
    def status(self) -> str:
        """``healthy`` or ``faulty``."""
        return str(self.data["status"])

    @property
    def best(self) -> list[str]:
        """Faults of the best explanation, ``KIND@PLACE``."""
        return list(self.data["best"]["faults"])


@dataclass(frozen=True)
class InspectionVisit:
    """One inspection.

    Attributes
    ----------
    usage : float
        Flights.
    log : Path
        What the bench wrote.
    diagnosis : Statement
        Of it.
    inspection : Inspection
        As the filter takes it.
    prognosis : Prognosis
        From all inspections up to this one.
    """

    usage: float
    log: Path
    diagnosis: Statement
    inspection: Inspection
    prognosis: Prognosis


@dataclass
class LifeDemo(Story):
    """Everything the report shows.

    Attributes
    ----------
    life : Life
        The true course.
    calibration : Calibration
        The healthy unit as its logs show it.
    response : ResponseTables
        The calibrated unit's tables.
    visits : list of InspectionVisit
        In the order of flights.
    """

    life: Life = field(init=False)
    calibration: Calibration = field(init=False)
    response: ResponseTables = field(init=False)
    healthy: list[Path] = field(default_factory=list)
    visits: list[InspectionVisit] = field(default_factory=list)

    @property
    def track(self) -> Track:
        """The predictions against the end that came."""
        rows = [(v.usage, v.prognosis.median, *v.prognosis.interval) for v in self.visits]
        usage, median, low, high = np.array(rows).T
        return Track(usage, median, low, high, self.life.end)

    @property
    def accuracy(self) -> float:
        """Mean relative accuracy over 50 to 90 % of life."""
        return cumulative_relative_accuracy(self.track, (0.5, 0.6, 0.7, 0.8, 0.9))

    @property
    def inside(self) -> float:
        """Share of the predictions whose 90 % interval holds the true end of life."""
        track = self.track
        return float(np.mean((track.low <= track.true) & (track.true <= track.high)))

    @property
    def checks(self) -> list[Check]:
        """What must hold of any one life; how well it was predicted is shown, and judged by many.

        `python -m studies prognosis` requests accuracy and coverage, of sixty lives.
        """
        track = self.track
        named = np.mean([v.diagnosis.status == "faulty" for v in self.visits[1:]])
        width = (track.high - track.low)[[len(track.usage) // 3, -1]]
        return [
            Check("last interval's width over that at a third of the inspections",
                  float(width[1] / width[0]), 1.0),
            Check("inspections after the first that name a fault", float(named), 0.8,
                  at_least=True),
        ]  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            **self.summary(self.checks),
            "end": self.life.end,
            "cumulative_relative_accuracy": self.accuracy,
            "inside": self.inside,
            "rows": [
                {
                    "usage": v.usage,
                    "status": v.diagnosis.status,
                    "faults": v.diagnosis.best,
                    "rul": v.prognosis.median,
                    "low": v.prognosis.interval[0],
                    "high": v.prognosis.interval[1],
                    "truth": self.life.end - v.usage,
                }
                for v in self.visits
            ],
        }
