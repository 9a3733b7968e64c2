"""What the inspections show, and whether the run-to-failure histories draw theirs as badly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.learning.fit import share_interval
from elevon.prognose.law import LAWS
from elevon.prognose.observation import SIGMAS
from elevon.progress import Progress
from elevon.report import Check, verdict
from studies.inspection_error.campaign import OF_THE_DAY, Inspected, inspect_units
from studies.inspection_error.fit import Group, Scatter, fitted, fitted_interval, stated
from studies.inspection_error.plan import DAYS, FAULTS, Growing
from studies.prognosis.truth import INSPECTIONS, InspectionError

__all__ = ["InspectionErrors", "study_inspection_error"]

_SEEN = 0.9  # share of inspections that see a fault from its least severity on
_STATED = 1.25  # between the deviations stated and those that the histories state, either way


@dataclass(frozen=True)
class InspectionErrors:
    """The inspections and what follows from them."""

    seed: int
    units: int
    inspections: tuple[Inspected, ...]

    def of(self, fault: Growing, days: int = 1) -> list[Inspected]:
        """Return a fault's inspections within the range, by logs of so many days."""
        levels = range(len(fault.levels))
        subset = [row for row in self.inspections if row.law == fault.law and row.days == days]
        return [row for row in subset if row.level in levels]

    def rows(self) -> list[dict[str, Any]]:
        """Return the table: one row a fault, and one more for friction, by logs of three days."""
        cells = [(fault, days) for fault in FAULTS for days in (1, DAYS)]
        rows = [(fault, self.of(fault, days)) for fault, days in cells]
        return [_row(fault, subset, self.seed) for fault, subset in rows if subset]

    def detection(self) -> list[dict[str, Any]]:
        """Return how many inspections saw each severity."""
        out = []
        for fault in FAULTS:
            subset = [r for r in self.inspections if r.law == fault.law and r.days == 1]
            for level in sorted({row.level for row in subset}):
                at = [row for row in subset if row.level == level]
                seen = sum(row.estimate is not None for row in at)
                out.append(
                    {
                        "fault": fault.key,
                        "severity": float(np.mean([row.severity for row in at])),
                        "inspections": len(at),
                        "seen": seen,
                        "interval": list(share_interval(seen, len(at))),
                        "error_median": _error_median(at),
                        "others": sum(bool(row.others) for row in at),
                    }
                )
        return out

    @property
    def checks(self) -> list[Check]:
        """Whether the histories' inspections err as much as those that were measured."""
        out = []
        for fault in FAULTS:
            subset, drawn = self.of(fault), INSPECTIONS[fault.law]
            if fault.law == OF_THE_DAY:
                subset = self.of(fault, DAYS)
            seen = [row for row in subset if row.estimate is not None]
            out += [
                Check(f"{fault.key}: error over what the histories draw (RMS, lower end)",
                      _over_drawn(seen, drawn, self.seed), 1.0),
                Check(f"{fault.key}: deviation stated over what the histories state",
                      _over_stated(seen, drawn), _STATED),
                Check(f"{fault.key}: share seen from the histories' least severity on",
                      _seen_from(subset, drawn.seen), _SEEN, at_least=True),
            ]  # fmt: skip
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return what `--json` prints."""
        checks = self.checks
        return {
            **verdict(checks),
            "seed": self.seed,
            "units": self.units,
            "rows": self.rows(),
            "detection": self.detection(),
            "inspections": [row.to_dict() for row in self.inspections],
        }


def study_inspection_error(
    *, seed: int = 0, units: int = 6, folder: Path | None = None, progress: Progress | None = None
) -> InspectionErrors:
    """Make and diagnose the inspections; arguments and errors as `inspect_units`."""
    rows = inspect_units(seed=seed, units=units, folder=folder, progress=progress)
    return InspectionErrors(seed, units, tuple(rows))


def _offsets(rows: Sequence[Inspected]) -> dict[int, tuple[float, float]]:
    """Return the mean severity and error of what was seen of each level."""
    out = {}
    for level in sorted({row.level for row in rows}):
        subset = [
            (r.severity, r.error) for r in rows if r.level == level and r.estimate is not None
        ]
        if subset:
            severity, error = np.mean(subset, axis=0)
            out[level] = (float(severity), float(error))
    return out


def _groups(rows: Sequence[Inspected]) -> list[Group]:
    """Return true severities and errors of what was seen, less the levels' means, by unit."""
    means, out = _offsets(rows), []
    for unit in sorted({row.unit for row in rows}):
        subset = [
            (r.severity, r.error - r.severity / means[r.level][0] * means[r.level][1])
            for r in rows
            if r.unit == unit and r.estimate is not None
        ]
        if subset:
            out.append((np.array([s for s, _ in subset]), np.array([e for _, e in subset])))
    return out


def _row(fault: Growing, rows: Sequence[Inspected], seed: int) -> dict[str, Any]:
    groups = _groups(rows)
    scatter = fitted(groups)
    low, high = fitted_interval(groups, seed)
    seen = [row for row in rows if row.estimate is not None]
    share, absolute = stated(_estimates(seen), _deviation(seen))
    inside = [_inside(row) for row in seen]
    return {
        "fault": fault.key,
        "unit": LAWS[fault.law].unit,
        "days": rows[0].days,
        "inspections": len(rows),
        "seen": len(seen),
        "offset": [list(pair) for pair in _offsets(rows).values()],
        **{
            name: value
            for key in scatter.__dict__
            for name, value in (
                (key, getattr(scatter, key)),
                (f"{key}_interval", [getattr(low, key), getattr(high, key)]),
            )
        },
        "stated_relative": share,
        "stated_absolute": absolute,
        "stated_over_scatter": _stated_over(seen, scatter),
        "of_the_day": float(np.std(np.log([row.day for row in rows]))),
        "error_rms": float(
            np.sqrt(np.mean((_estimates(seen) - _true(seen)) ** 2 / _true(seen) ** 2))
        ),
        "coverage": float(np.mean(inside)),
        "detectable": float(np.median([row.detectable for row in rows])),
    }


def _estimates(rows: Sequence[Inspected]) -> Floats:
    return np.array([row.estimate for row in rows], dtype=np.float64)


def _true(rows: Sequence[Inspected]) -> Floats:
    return np.array([row.severity for row in rows])


def _deviation(rows: Sequence[Inspected]) -> Floats:
    return np.array([0.5 * (row.low + row.high) for row in rows])


def _inside(row: Inspected) -> bool:
    """Whether the 90 % interval holds the true severity."""
    assert row.estimate is not None
    return row.estimate - SIGMAS * row.low <= row.severity <= row.estimate + SIGMAS * row.high


def _stated_over(rows: Sequence[Inspected], scatter: Scatter) -> float:
    """Return the deviations stated over those from one inspection to the next: a median."""
    true = _true(rows)
    day = float(np.std(np.log([row.day for row in rows])))
    subset = np.hypot(scatter.per_visit(true), day * (1.0 + true))
    return float(np.median(_deviation(rows) / subset))


def _error_median(rows: Sequence[Inspected]) -> float | None:
    errors = [abs(row.estimate - row.severity) for row in rows if row.estimate is not None]
    return float(np.median(errors)) if errors else None


def _over_drawn(rows: Sequence[Inspected], drawn: InspectionError, seed: int) -> float:
    """Return the lower end of 95 % of the errors' RMS over the deviation that is drawn."""
    by_unit = []
    for unit in sorted({row.unit for row in rows}):
        subset = [row for row in rows if row.unit == unit]
        s = _true(subset)
        whole = np.sqrt(drawn.per_visit(s) ** 2 + drawn.common(s) ** 2)
        by_unit.append(float(np.mean(((_estimates(subset) - s - drawn.mean(s)) / whole) ** 2)))
    rng = np.random.default_rng([seed, 106])
    draws = rng.choice(by_unit, size=(2000, len(by_unit))).mean(axis=1)
    return float(np.sqrt(np.quantile(draws, 0.025)))


def _over_stated(rows: Sequence[Inspected], drawn: InspectionError) -> float:
    """Return the median ratio of the deviations stated, the larger over the smaller."""
    ratio = float(np.median(_deviation(rows) / drawn.stated(_estimates(rows))))
    return max(ratio, 1.0 / ratio)


def _seen_from(rows: Sequence[Inspected], least: float) -> float:
    subset = [row for row in rows if row.severity >= least]
    return float(np.mean([row.estimate is not None for row in subset])) if subset else float("nan")
