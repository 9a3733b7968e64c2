"""Healthy or not: false alarms on healthy recordings left out, detections by fault stage."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import stdtr

from elevon.arrays import Floats
from elevon.diagnose.modelfree import TRANSFER, HealthyBaseline
from elevon.diagnose.modelfree.scores import share_interval
from elevon.reproduce.cranfield.data import CONDITIONS, CranfieldData

DETECTION = (*TRANSFER, "current_assisted", "current_opposed")
FALSE_ALARM = 0.05
UNSEEN = tuple(f"spalling{stage}" for stage in range(1, 6))
"""Stages that the published detection does not see in this motion."""


@dataclass(frozen=True, slots=True)
class Detection:
    """How often one condition was called faulty.

    Attributes
    ----------
    condition : str
        ``normal``: each recording against the other healthy ones.
    hits, count : int
        Recordings called faulty, and all of them.
    hits_sessions : int or None
        The same when a difference between two sessions is allowed for.
    """

    condition: str
    hits: int
    count: int
    hits_sessions: int | None

    def to_dict(self) -> dict[str, Any]:
        """Return the row with its exact 95 % interval."""
        seen = self.hits_sessions
        return {
            "condition": self.condition, "rate": self.hits / self.count,
            "interval": list(share_interval(self.hits, self.count)), "recordings": self.count,
            "rate_between_sessions": None if seen is None else seen / self.count,
        }  # fmt: skip


def detect(data: CranfieldData, *, false_alarm: float = FALSE_ALARM) -> list[Detection]:
    """Hold every recording against the healthy ones at its load, itself left out.

    Parameters
    ----------
    data : CranfieldData
        All recordings.
    false_alarm : float
        Share of healthy recordings that may be called faulty.

    Returns
    -------
    list of Detection
        One for each condition that has recordings at a load with two healthy ones.
    """
    x, healthy = data.table.select(DETECTION), data.condition == "normal"
    rows: dict[str, list[tuple[bool, bool | None]]] = {}
    for index in range(len(x)):
        others = healthy.copy()
        others[index] = False
        here = others & (data.load == data.load[index])
        if here.sum() < 2:
            continue
        baseline = HealthyBaseline.fit(DETECTION, x[others], data.load[others])
        p = float(baseline.p_values(x[index], data.load[index])[0])
        sessions = _session_p(data, x, baseline, index)
        condition = str(data.condition[index])
        rows.setdefault(condition, []).append(
            (p < false_alarm, None if sessions is None else sessions < false_alarm)
        )
    return [_row(name, rows[name]) for name in CONDITIONS if name in rows]


def _row(condition: str, answers: list[tuple[bool, bool | None]]) -> Detection:
    sessions = [seen for _, seen in answers]
    known = None if None in sessions else sum(bool(seen) for seen in sessions)
    return Detection(condition, sum(hit for hit, _ in answers), len(answers), known)


def _session_p(
    data: CranfieldData, x: Floats, baseline: HealthyBaseline, index: int
) -> float | None:
    """Return the probability of a deviation when sessions differ as the unseen stages do.

    The scatter of their means, the stage in question left out, stands for the scatter between
    sessions. It holds what these faults do as well, so it errs towards seeing too little.
    """
    names = [name for name in UNSEEN if name != data.condition[index]]
    squares = []
    for load in np.unique(data.load):
        cells = [(data.condition == name) & (data.load == load) for name in names]
        means = [x[cell].mean(axis=0) for cell in cells if cell.any()]
        if len(means) < 3:
            return None
        squares.append(np.var(means, axis=0, ddof=1))
    at = int(np.flatnonzero(baseline.loads == data.load[index])[0])
    variance = baseline.spread**2 * (1.0 + 1.0 / baseline.counts[at])
    # Twice: the baseline is one session, the tested recording another.
    width = np.sqrt(variance + 2.0 * np.mean(squares, axis=0))
    largest = float(np.abs((x[index] - baseline.means[at]) / width).max())
    single = min(2.0 * float(stdtr(len(names) - 1, -largest)), 1.0 - 1e-15)
    return float(-np.expm1(len(DETECTION) * np.log1p(-single)))
