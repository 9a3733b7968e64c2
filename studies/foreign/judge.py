"""Predictions of foreign lives, by our filter and by methods that know no law, in one table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from elevon.arrays import Floats
from elevon.prognose import Inspection
from elevon.prognose.observation import Seen
from studies.foreign.baselines import BASELINES, Rows
from studies.foreign.truth import Case, ForeignLife

SHARES = (0.5, 0.6, 0.7, 0.8, 0.9)
OURS = "ours"
_LEVELS = (np.arange(199) + 0.5) / 199.0
_FAR = 50.0  # expected lives that 'no end in sight' counts as in the scores

Predict = Callable[[Sequence[Inspection], Case], tuple[Floats, str]]


@dataclass(frozen=True)
class Judged:
    """One prediction against what came.

    Attributes
    ----------
    method, law, form : str
        Who predicted; the law given; the true form.
    number : int
        Of the life.
    density : float
        Inspections over each 4 % of the expected life.
    share : float
        Of life.
    true, median, low, high, crps : float
        Remaining life, its prediction with the 90 % interval, continuous ranked probability
        score; in lives.
    status : str
        Of ours.
    """

    method: str
    law: str
    form: str
    number: int
    density: float
    share: float
    true: float
    median: float
    low: float
    high: float
    crps: float
    status: str = "ok"

    @property
    def accuracy(self) -> float:
        """Relative accuracy, 0 at least."""
        return max(1.0 - abs(self.true - self.median) / self.true, 0.0)

    @property
    def covered(self) -> bool:
        """Whether the interval holds the truth."""
        return self.low <= self.true <= self.high


def judged_life(
    life: ForeignLife,
    given: Case,
    every: Sequence[Inspection],
    *,
    density: float,
    seed: int,
    predict: Predict | None,
) -> list[Judged]:
    """Predict one life at each share, at the last inspection before it."""
    out: list[Judged] = []
    key = given.tables.laws[0].key
    for share in SHARES:
        seen = [item for item in every if item.usage <= share * life.end]
        if not seen:
            continue
        since = share * life.end - seen[-1].usage
        rows = seen_rows(seen, key)
        rng = np.random.default_rng([33, seed, life.number, int(100 * share)])
        answers: dict[str, tuple[Floats, str]] = {
            name: (_since_seen(method(rows, given.limit, given.expected, rng), rows, seen), "ok")
            for name, method in BASELINES.items()
            if len(rows)
        }
        if predict is not None:
            answers[OURS] = predict(seen, given)
        for name, (remaining, status) in answers.items():
            left = np.clip(remaining - since, 0.0, _FAR * given.expected)
            out.append(_judged(name, life, density=density, share=share, left=left, status=status))
    return out


def _since_seen(remaining: Floats, rows: Rows, seen: Sequence[Inspection]) -> Floats:
    """Count remaining lives from the last inspection, not from the last that saw the fault."""
    return np.asarray(np.maximum(remaining - (seen[-1].usage - rows[-1, 0]), 0.0))


def seen_rows(seen: Iterable[Inspection], key: str) -> Rows:
    """Return use, severity and deviation of the inspections that saw the fault."""
    rows = [
        (item.usage, s.severity, _deviation(s))
        for item in seen
        if (s := item.seen.get(key)) is not None and s.severity is not None
    ]
    return np.array(rows).reshape(-1, 3)


def _deviation(seen: Seen) -> float:
    return float(np.hypot(0.5 * (seen.low + seen.high), seen.common))


def _judged(
    name: str, life: ForeignLife, *, density: float, share: float, left: Floats, status: str
) -> Judged:
    true, end = (1.0 - share), life.end
    low, median, high = np.quantile(left, (0.05, 0.5, 0.95)) / end
    quantiles = np.quantile(left, _LEVELS) / end
    off = true - quantiles
    crps = 2.0 * float(np.mean(np.where(off > 0.0, _LEVELS, _LEVELS - 1.0) * off))
    return Judged(
        name, life.law, life.form, life.number, density, share, true,
        float(median), float(low), float(high), crps, status,
    )  # fmt: skip


def judge(rows: Sequence[Judged]) -> dict[str, Any]:
    """Return the figures of predictions of one method."""
    bias = np.array([r.median - r.true for r in rows])
    return {
        "lives": len({(r.law, r.form, r.number) for r in rows}),
        "accuracy": float(np.mean([r.accuracy for r in rows])),
        "alpha_lambda": float(np.mean([r.accuracy >= 0.8 for r in rows])),
        "coverage": float(np.mean([r.covered for r in rows])),
        "width": float(np.median([r.high - r.low for r in rows])),
        "crps": float(np.mean([r.crps for r in rows])),
        "bias": float(np.mean(np.clip(bias, -1.0, 1.0))),
        "late": float(np.mean(np.clip(bias, 0.0, 1.0))),
        "early": float(np.mean(np.clip(-bias, 0.0, 1.0))),
        "off_law": float(np.mean([r.status == "off_law" for r in rows])),
    }


def by_life(rows: Iterable[Judged]) -> Mapping[tuple[str, str, int, float], float]:
    """Return the mean accuracy of each life."""
    found: dict[tuple[str, str, int, float], list[float]] = {}
    for r in rows:
        found.setdefault((r.law, r.form, r.number, r.density), []).append(r.accuracy)
    return {key: float(np.mean(values)) for key, values in found.items()}


def paired_gap(
    ours: Sequence[Judged], others: Sequence[Judged], *, draws: int = 2000
) -> tuple[float, float, float]:
    """Return by how much ours is more accurate, and the 90 % interval of a bootstrap over lives."""
    a, b = by_life(ours), by_life(others)
    gap = np.array([a[key] - b[key] for key in a if key in b])
    rng = np.random.default_rng(34)
    means = gap[rng.integers(0, len(gap), (draws, len(gap)))].mean(axis=1)
    low, high = np.quantile(means, (0.05, 0.95))
    return float(gap.mean()), float(low), float(high)
