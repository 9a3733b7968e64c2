"""What the histories show: accuracy, coverage, horizon, with their intervals and checks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from elevon.prognose.metrics import (
    Track,
    convergence,
    coverage,
    cumulative_relative_accuracy,
    prognostic_horizon,
    relative_accuracy,
    wilson,
)
from elevon.report.checks import Check, verdict

__all__ = ["SHARES", "PrognosisResult", "UnitResult"]

SHARES = (0.5, 0.6, 0.7, 0.8, 0.9)
_ACCURACY = 0.85
_COVERAGE = (0.80, 0.97)
_TRACKS = ("track", "unaided")


@dataclass(frozen=True)
class UnitResult:
    """One history and its predictions.

    Attributes
    ----------
    number : int
        Of the history.
    law : str
        Which ended it.
    first : str
        Requirement that failed.
    track : Track
        By particles.
    unaided : Track
        By the laws alone, without a diagnosis: what a prediction must beat.
    seconds : float
        Largest processor time of an update and a look ahead.
    """

    number: int
    law: str
    first: str
    track: Track
    unaided: Track
    seconds: float

    def noted(self) -> dict[str, Any]:
        """Return all of it in JSON's types, for the log of finished histories."""
        tracks = {
            name: {key: np.asarray(value).tolist() for key, value in vars(track).items()}
            for name in _TRACKS
            for track in [getattr(self, name)]
        }
        return {**vars(self), **tracks}

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> UnitResult:
        """Return what `noted` wrote."""
        tracks = {name: _track(data[name]) for name in _TRACKS}
        return cls(**{**data, **tracks})

    def to_dict(self) -> dict[str, Any]:
        """Return a row."""
        return {
            "history": self.number,
            "law": self.law,
            "first_requirement": self.first,
            "end": self.track.end,
            "inspections": len(self.track.usage),
            "cumulative_relative_accuracy": cumulative_relative_accuracy(self.track, SHARES),
            **{f"ra_{s:.0%}".replace("%", ""): relative_accuracy(self.track, s) for s in SHARES},
            "prognostic_horizon": prognostic_horizon(self.track),
            "convergence": convergence(self.track),
        }


@dataclass(frozen=True)
class PrognosisResult:
    """All histories.

    Attributes
    ----------
    units : tuple of UnitResult
        In order.
    seed : int
        Of everything.
    seconds : float
        Time it took.
    left_out : tuple of str
        Lives that could not be judged, with the reason.
    measured : bool
        Whether inspections carried what the unit showed of its requirements.
    """

    units: tuple[UnitResult, ...]
    seed: int
    seconds: float = field(compare=False)
    left_out: tuple[str, ...] = ()
    measured: bool = False

    def accuracy(self, law: str | None = None, track: str = "track") -> float:
        """Return the mean relative accuracy over units and `SHARES`; of another track by name."""
        tracks = [getattr(unit, track) for unit in self._chosen(law)]
        return float(np.mean([cumulative_relative_accuracy(t, SHARES) for t in tracks]))

    def covered(self, law: str | None = None) -> float:
        """Return the share of intervals that hold the truth, over units and `SHARES`."""
        tracks = [u.track for u in self._chosen(law)]
        return float(np.mean([coverage(tracks, share) for share in SHARES]))

    def width(self, share: float) -> float:
        """Return the median width of the intervals at a share of life, in lives."""
        rows = [(u.track.predicted(share), u.track.end) for u in self.units]
        return float(np.median([(high - low) / end for (_, low, high), end in rows]))

    def _chosen(self, law: str | None) -> Sequence[UnitResult]:
        return [u for u in self.units if law is None or u.law == law]

    @property
    def checks(self) -> list[Check]:
        """What must hold."""
        low, high = _COVERAGE
        widths = [self.width(share) for share in SHARES]
        narrowing = max(b / a for a, b in pairwise(widths))
        checks = [
            Check("mean relative accuracy, 50 to 90 % of life", self.accuracy(), _ACCURACY,
                  at_least=True),
            Check("coverage of the 90 % interval, at least", self.covered(), low, at_least=True),
            Check("coverage of the 90 % interval, at most", self.covered(), high),
            Check("interval width over that of the share of life before", narrowing, 1.0),
        ]  # fmt: skip
        checks += [
            Check(f"mean relative accuracy, {law}", self.accuracy(law), _ACCURACY, at_least=True)
            for law in dict.fromkeys(u.law for u in self.units)
        ]
        return checks

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        horizons = [prognostic_horizon(u.track) for u in self.units]
        return {
            **verdict(self.checks),
            "seed": self.seed,
            "measured": self.measured,
            "summary": self.summary(),
            "prognostic_horizon": {
                "alpha": 0.2,
                "median": float(np.median(horizons)),
                "quartiles": [float(v) for v in np.quantile(horizons, (0.25, 0.75))],
            },
            "rows": [unit.to_dict() for unit in self.units],
            "left_out": list(self.left_out),
            "seconds": self.seconds,
            "longest_s": max(u.seconds for u in self.units),
        }

    def summary(self) -> list[dict[str, Any]]:
        """Return figures by law and of all."""
        rows = []
        for law in [*dict.fromkeys(u.law for u in self.units), None]:
            chosen = self._chosen(law)
            each = [cumulative_relative_accuracy(u.track, SHARES) for u in chosen]
            half = 1.96 * float(np.std(each, ddof=1)) / np.sqrt(len(each)) if len(each) > 1 else 0.0
            hits = self.covered(law)
            rows.append(
                {
                    "law": law or "all",
                    "histories": len(chosen),
                    "accuracy": self.accuracy(law),
                    "accuracy_interval": [self.accuracy(law) - half, self.accuracy(law) + half],
                    "unaided_accuracy": self.accuracy(law, "unaided"),
                    "coverage": hits,
                    "coverage_interval": list(wilson(hits, len(chosen))),
                    "horizon": float(np.median([prognostic_horizon(u.track) for u in chosen])),
                    **{
                        f"ra_{s:.0%}".replace("%", ""): float(
                            np.mean([relative_accuracy(u.track, s) for u in chosen])
                        )
                        for s in SHARES
                    },
                }
            )
        return rows


def _track(rows: Mapping[str, Any]) -> Track:
    """Return a track of what `UnitResult.noted` wrote."""
    usage, median, low, high = (np.array(rows[key]) for key in ("usage", "median", "low", "high"))
    return Track(usage, median, low, high, rows["end"], rows["start"])
