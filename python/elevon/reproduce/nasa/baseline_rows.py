"""What `nasa-baseline` reports."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from elevon.report.checks import Check, verdict
from elevon.reproduce.nasa.design import FactorEffect
from elevon.reproduce.nasa.histories import HistoryFigure
from elevon.reproduce.nasa.profiles import LoadKind, MotionProfile

DRIFT = 4.0
"""The laboratory warms by so much during a block [K] (ASSUMED): random order keeps it out of the
effects."""
MEASURES = {
    "rms_current_a": ("RMS current", "A", 3),
    "peak_current_a": ("Peak current", "A", 2),
    "tracking_rms_mm": ("Tracking RMS", "mm", 4),
    "tracking_max_mm": ("Tracking max", "mm", 3),
    "winding_rise_k": ("Winding rise in 30 s", "K", 3),
    "at_limit": ("Time at a limit", "1", 4),
}
"""What every run gives: title, unit, decimals."""


@dataclass(frozen=True, slots=True)
class BaselineRow:
    """One cell of the matrix over its replicates; statistics after the first 2 s.

    Attributes
    ----------
    profile, load : MotionProfile and float
        N, positive compressive.
    status, reason : str
        ``ok``, ``limited`` (requests more than there is, and runs), ``refused``, or how a run
        ended; and why.
    runs : tuple of tuple of float
        `MEASURES` of each replicate.
    """

    profile: MotionProfile
    load: float
    status: str
    reason: str = ""
    runs: tuple[tuple[float, ...], ...] = ()

    @property
    def direction(self) -> str:
        """Which way the load pushes."""
        if self.load == 0.0:
            return "none"
        return "compressive" if self.load > 0.0 else "tensile"

    def mean(self, name: str) -> float:
        """Return the mean of one of `MEASURES` over the replicates, NaN without any."""
        column = list(MEASURES).index(name)
        return float(np.mean([run[column] for run in self.runs])) if self.runs else float("nan")

    def scatter(self, name: str) -> float:
        """Return the standard deviation over the replicates, NaN with fewer than two."""
        column = list(MEASURES).index(name)
        values = [run[column] for run in self.runs]
        return float(np.std(values, ddof=1)) if len(values) > 1 else float("nan")

    def to_dict(self) -> dict[str, object]:
        """Return one row of the command's JSON object, in the units of the columns."""
        numbers = {name: _rounded(self.mean(name), MEASURES[name][2]) for name in MEASURES}
        return {
            "profile": self.profile.name,
            "amplitude_mm": 1e3 * self.profile.amplitude,
            "rate_mm_s": 1e3 * self.profile.rate,
            "load_n": abs(self.load),
            "direction": self.direction,
            **numbers,
            "rms_current_scatter_a": _rounded(self.scatter("rms_current_a"), 4),
            "replicates": len(self.runs),
            "status": self.status,
            "reason": self.reason,
        }


@dataclass(frozen=True)
class BaselineResult:
    """Everything `elevon reproduce nasa-baseline` reports.

    Attributes
    ----------
    rows : list of BaselineRow
        One a cell of the matrix.
    effects : dict
        Of each response, the effects of the factors and of their pairs.
    sheet : list of dict
        The runs in the order in which they were done: block, order, air temperature, cell.
    histories : list of HistoryFigure
        Figures 5, 6 and 7 of the paper.
    corners : list of dict
        Sharp against rounded corners.
    """

    rows: list[BaselineRow]
    checks: list[Check]
    load_kind: LoadKind
    seed: int
    replicates: int
    effects: dict[str, list[FactorEffect]] = field(default_factory=dict)
    sheet: list[dict[str, Any]] = field(default_factory=list)
    histories: list[HistoryFigure] = field(default_factory=list)
    corners: list[dict[str, Any]] = field(default_factory=list)
    meta: dict[str, Any] = field(default_factory=dict)

    def to_dict(self) -> dict[str, object]:
        """Return the JSON object of the command."""
        effects = [
            {"response": name, "unit": MEASURES[name][1], "term": e.term, "effect": e.effect,
             "interval": [e.low, e.high], "p": e.p}
            for name, fitted in self.effects.items()
            for e in fitted
        ]  # fmt: skip
        return {
            **verdict(self.checks),
            "load_kind": self.load_kind,
            "rows": [row.to_dict() for row in self.rows],
            "effects": effects,
            "corners": self.corners,
            "runs": self.sheet,
            "seed": self.seed,
            "replicates": self.replicates,
            **self.meta,
        }


def _rounded(value: float, digits: int) -> float | None:
    """A number at the resolution of its column; None where there is none."""
    return None if np.isnan(value) else round(value, digits) + 0.0


def page_values(result: BaselineResult) -> dict[str, object]:
    """Return the current of each run at 50 mm and 6 cm/s over its load, by profile."""
    middle = [
        row
        for row in result.rows
        if abs(row.profile.amplitude - 0.05) < 1e-9 and abs(row.profile.rate - 0.06) < 1e-9
    ]
    names = dict.fromkeys(row.profile.name for row in result.rows)
    currents = []
    for place, (name, colour) in enumerate(zip(names, _COLOURS, strict=False)):
        runs = [(row.load, run[0]) for row in middle if row.profile.name == name
                for run in row.runs]  # fmt: skip
        if runs:
            load, current = np.array(runs).T
            load = load / 1e3 + 0.06 * (place - 2)
            currents.append({"name": name, "colour": colour, "load": load, "current": current})
    return {"currents": currents}


_COLOURS = ("grey", "blue", "orange", "green", "red")
