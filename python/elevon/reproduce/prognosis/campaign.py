"""Sixty lives on the high-fidelity model, each predicted from its inspections."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.errors import InputError
from elevon.prognose import (
    Inspection,
    Mission,
    ParticleFilter,
    Process,
    Response,
    UnscentedFilter,
    respond,
)
from elevon.prognose.future import MODEL_ERROR, look_ahead
from elevon.prognose.metrics import (
    Track,
    convergence,
    coverage,
    cumulative_relative_accuracy,
    prognostic_horizon,
    relative_accuracy,
    wilson,
)
from elevon.prognose.particle import BIAS, resampled
from elevon.prognose.predict import LEVEL
from elevon.prognose.process import Population
from elevon.progress import Progress
from elevon.report.checks import Check, all_passed
from elevon.reproduce.prognosis.truth import FAULTS, UnitTruth, inspections_of, true_unit

__all__ = ["SHARES", "PrognosisResult", "UnitResult", "reproduce_prognosis"]

Floats = npt.NDArray[np.float64]
SHARES = (0.5, 0.6, 0.7, 0.8, 0.9)
_INTERVAL = 0.04  # of the life that the model expects, between inspections
_SAMPLES = 1000
_ACCURACY = 0.85
_COVERAGE = (0.80, 0.97)


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
    unscented : Track
        By the unscented filter, from the inspections that `SHARES` ask for.
    seconds : float
        Largest processor time of an update and a look ahead.
    """

    number: int
    law: str
    first: str
    track: Track
    unaided: Track
    unscented: Track
    seconds: float

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
    """

    units: tuple[UnitResult, ...]
    seed: int
    seconds: float = field(compare=False)
    left_out: tuple[str, ...] = ()

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
            "status": "pass" if all_passed(self.checks) else "fail",
            "checks": [check.to_dict() for check in self.checks],
            "seed": self.seed,
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
                    "unscented_accuracy": self.accuracy(law, "unscented"),
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


def campaign_mission() -> Mission:
    """Return the histories' mission."""
    return Mission.load(Path(str(files("elevon.reproduce.prognosis") / "mission.toml")))


def reproduce_prognosis(
    *, histories: int = 60, seed: int = 0, progress: Progress | None = None
) -> PrognosisResult:
    """Let units live and predict their ends.

    Parameters
    ----------
    histories : int
        Lives, shared evenly by the laws of `FAULTS`.
    seed : int
        Of everything.
    progress : callable, optional
        Told the done fraction.

    Raises
    ------
    InputError
        Fewer histories than laws.
    """
    if histories < len(FAULTS):
        raise InputError(f"{histories} histories: at least {len(FAULTS)}, one a law, are needed")
    begin = clock.perf_counter()
    base, mission = Actuator.load("torino-rotary"), campaign_mission()
    expected = _expected(base, mission)
    units, left_out = [], []
    for number in range(histories):
        law = FAULTS[number % len(FAULTS)]
        truth = true_unit(base, mission, law, number, seed)
        seen = inspections_of(truth, mission.laws(), _INTERVAL * expected[law], seed)
        if not seen or seen[0].usage > SHARES[0] * truth.life.end:
            left_out.append(f"history {number}: no inspection before half of its life")
        else:
            units.append(predicted(truth, mission, seen, seed))
        if progress is not None:
            progress((number + 1) / histories)
    return PrognosisResult(tuple(units), seed, clock.perf_counter() - begin, tuple(left_out))


def _expected(base: Actuator, mission: Mission) -> dict[str, float]:
    """Return the median life that the model expects of a unit in which one law acts alone."""
    out = {}
    for law in mission.laws():
        asked = tuple(
            item for item in mission.requirement if item.fault is None or item.fault == law.key
        )
        alone = mission.model_copy(update={"requirement": asked})
        process = Process(respond(base, alone, laws=[law]))
        rng = np.random.default_rng(0)
        units = process.start(500, rng)
        growing = replace(units, active=np.ones_like(units.active))
        future = look_ahead(process, growing, mission.usage, rng)
        out[law.name] = float(np.median(future.end))
    return out


def predicted(
    truth: UnitTruth, mission: Mission, seen: Sequence[Inspection], seed: int
) -> UnitResult:
    """Predict a unit's end at each inspection, on tables of its own calibrated model."""
    response = respond(truth.calibrated, mission, snapshots=True)
    track, seconds = tracked(response, mission, seen, truth.life.end, seed)
    return UnitResult(
        truth.number,
        truth.law,
        mission.requirement[_first(truth, mission)].name,
        track,
        _unaided(response, mission, seen, truth, seed),
        _by_sigma_points(response, mission, seen, truth.life.end, seed),
        seconds,
    )


def _first(truth: UnitTruth, mission: Mission) -> int:
    """Index among all requirements of the one that failed."""
    key = next(law.key for law in mission.laws() if law.name == truth.law)
    asked = [k for k, r in enumerate(mission.requirement) if r.fault is None or r.fault == key]
    return asked[truth.life.first]


def tracked(
    response: Response, mission: Mission, seen: Sequence[Inspection], end: float, seed: int
) -> tuple[Track, float]:
    """Return the predictions at each inspection, and the longest time one took."""
    flt = ParticleFilter(Process(response), seed=seed)
    rows, longest = [], 0.0
    for item in seen:
        begin = clock.process_time()
        flt.update(item)
        rng = np.random.default_rng([20, seed])
        units = resampled(flt.units, _SAMPLES, rng)
        rows.append(_remaining(flt.process, units, mission, rng))
        longest = max(longest, clock.process_time() - begin)
    return _track(seen, rows, end), longest


def _remaining(
    process: Process, units: Population, mission: Mission, rng: np.random.Generator
) -> list[float]:
    """Return low, median, high of the remaining life, as `elevon predict` draws it."""
    units = process.scaled(units, BIAS, rng)
    future = look_ahead(process, units, mission.usage, rng, model_error=MODEL_ERROR)
    return _quantiles(future.remaining)


def _track(seen: Sequence[Inspection], rows: Sequence[Sequence[float]], end: float) -> Track:
    low, median, high = np.array(rows).T
    return Track(np.array([item.usage for item in seen]), median, low, high, end)


def _by_sigma_points(
    response: Response, mission: Mission, seen: Sequence[Inspection], end: float, seed: int
) -> Track:
    """Return the unscented filter's predictions, at the last inspection before each of `SHARES`."""
    flt = UnscentedFilter(Process(response))
    usage = np.array([item.usage for item in seen])
    asked = set(np.searchsorted(usage, np.array(SHARES) * end, side="right") - 1)
    rows, at = [], []
    for k, item in enumerate(seen):
        flt.update(item)
        if k in asked:
            rng = np.random.default_rng([22, seed])
            rows.append(_remaining(flt.process, flt.sampled(_SAMPLES, rng), mission, rng))
            at.append(item)
    return _track(at, rows, end)


def _quantiles(remaining: Floats) -> list[float]:
    tail = 0.5 * (1.0 - LEVEL)
    ranked = np.sort(np.minimum(remaining, 1e7))
    return [
        float(ranked[min(int(q * len(ranked)), len(ranked) - 1)]) for q in (tail, 0.5, 1 - tail)
    ]


def _unaided(
    response: Response, mission: Mission, seen: Sequence[Inspection], truth: UnitTruth, seed: int
) -> Track:
    """Return what the laws alone say: the same life for every unit, less what was used.

    They know which law will end the unit, which flatters them.
    """
    process = Process(response)
    rng = np.random.default_rng([21, seed])
    units = process.start(_SAMPLES, rng)
    others = [k for k, law in enumerate(process.laws) if law.name != truth.law]
    units.active[:, others] = False
    life = _quantiles(look_ahead(process, units, mission.usage, rng).end)
    rows = [[max(value - item.usage, 0.0) for value in life] for item in seen]
    return _track(seen, rows, truth.life.end)
