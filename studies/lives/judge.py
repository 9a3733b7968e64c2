"""Predictions against what came: coverage, the transform of the truth, a proper score."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from elevon.arrays import Floats
from elevon.prognose import GrowthFilter, Inspection, Process, ResponseTables, Seen
from elevon.prognose.future import look_ahead
from elevon.prognose.mission import Usage
from elevon.prognose.value_history import VALUE, ValueHistory, value_tables
from studies.lives.baselines import BASELINES, Rows
from studies.lives.truth import DrawnLife

OURS = "Elevon"
_FAR = 20.0  # expected lives that no end in sight counts as, for every method
_LEVELS = (np.arange(199) + 0.5) / 199.0
_SAMPLES = 1000
_DRAWS = 2000  # of a bootstrap


@dataclass(frozen=True)
class Scored:
    """One prediction against what came.

    Attributes
    ----------
    method, group : str
        Who predicted; of what.
    number : int
        Of the life.
    true, median, width : float
        Remaining life, its median, and the width of the 90 % interval; in lives.
    within90, within50, below1 : bool
        Whether the truth lies in the intervals, and below the 1 % quantile.
    pit : float
        Share of the futures that end before the truth.
    crps : float
        Continuous ranked probability score, in lives.
    looks, changes : int
        Inspections, and changes of the rate.
    curvature : float
        As `DrawnLife`.
    """

    method: str
    group: str
    number: int
    true: float
    median: float
    width: float
    within90: bool
    within50: bool
    below1: bool
    pit: float
    crps: float
    looks: int
    changes: int = 0
    curvature: float = 0.0

    @property
    def accuracy(self) -> float:
        """Relative accuracy, 0 at least."""
        return max(1.0 - abs(self.true - self.median) / self.true, 0.0)


def scored(
    method: str, group: str, number: int, left: Floats, *, true: float, life: float, far: float,
    looks: int, curvature: float = 0.0, changes: int = 0,
) -> Scored:  # fmt: skip
    """Score drawn remaining lives.

    Parameters
    ----------
    method, group, number, looks, curvature, changes
        As `Scored`.
    left : ndarray, shape (n,)
        Drawn remaining lives.
    true, life : float
        The remaining life that came, and the whole one.
    far : float
        What no end in sight counts as.
    """
    left = np.clip(np.nan_to_num(left, posinf=far), 0.0, far)
    low, early, middle, late, high = np.quantile(left, (0.05, 0.25, 0.5, 0.75, 0.95))
    off = (true - np.quantile(left, _LEVELS)) / life
    return Scored(
        method, group, number, true / life, float(middle) / life, float(high - low) / life,
        bool(low <= true <= high), bool(early <= true <= late),
        bool(true < np.quantile(left, 0.01)), float(np.mean(left < true)),
        2.0 * float(np.mean(np.where(off > 0.0, _LEVELS, _LEVELS - 1.0) * off)),
        looks, changes, curvature,
    )  # fmt: skip


def remaining(
    tables: ResponseTables, seen: Sequence[Inspection], seed: int, **priors: Any
) -> Floats:
    """Return remaining lives as `elevon.predict` draws them, where the model has no error."""
    flt = GrowthFilter(Process(tables), seed=seed, **priors)
    for item in seen:
        flt.update(item)
    rng = np.random.default_rng([64, seed])
    units = flt.drawn(_SAMPLES, rng)
    future = look_ahead(flt.process, units, Usage(), rng, course=False)
    return future.remaining


def relative_tables() -> ResponseTables:
    """Return tables of a value whose limit is 1 and whose expected life is 1."""
    return value_tables(ValueHistory("drawn", (), 0.0, 1.0, "", "lives"), 1.0)


def inspections_of(life: DrawnLife) -> list[Inspection]:
    """Return a drawn life's inspections as the filter takes them."""
    return [
        Inspection(
            look.usage,
            {
                VALUE: Seen(
                    look.severity, look.deviation, look.deviation,
                    life.bias * (look.severity or 0.0), look.probability, life.detectable,
                )
            },
            reset=(VALUE,) if look.renewed else (),
        )
        for look in life.looks
    ]  # fmt: skip


def drawn_rows(life: DrawnLife, seed: int) -> list[dict[str, Any]]:
    """Predict a drawn life by all methods."""
    answers = {OURS: remaining(relative_tables(), inspections_of(life), life.number)}
    rows, since = _rows(life)
    for k, (name, method) in enumerate(BASELINES.items()):
        rng = np.random.default_rng([65, seed, life.number, k])
        answers[name] = method(rows, rng) - since
    return [
        asdict(
            scored(
                name, "drawn", life.number, left, true=life.remaining, life=life.end, far=_FAR,
                looks=len(life.looks), curvature=life.curvature, changes=life.changes,
            )
        )
        for name, left in answers.items()
    ]  # fmt: skip


def _rows(life: DrawnLife) -> tuple[Rows, float]:
    """Return what the other methods take, since the last recorded renewal, and how long ago."""
    last = max((k for k, look in enumerate(life.looks) if look.renewed), default=-1)
    begin = life.looks[last].usage if last >= 0 else 0.0
    rows = [
        (look.usage - begin, look.severity, look.deviation)
        for look in life.looks[last + 1 :]
        if look.severity is not None and look.probability >= 0.5
    ]
    table = np.array(rows, dtype=np.float64).reshape(-1, 3)
    return table, life.at - begin - (float(table[-1, 0]) if len(table) else 0.0)


def figures(rows: Sequence[Scored]) -> dict[str, Any]:
    """Return the figures of predictions, with 90 % intervals of a bootstrap over lives."""
    columns = {
        "coverage90": [r.within90 for r in rows],
        "coverage50": [r.within50 for r in rows],
        "below1": [r.below1 for r in rows],
        "crps": [r.crps for r in rows],
        "accuracy": [r.accuracy for r in rows],
    }
    rng = np.random.default_rng(66)
    out: dict[str, Any] = {"lives": len(rows), "width": float(np.median([r.width for r in rows]))}
    index = rng.integers(0, len(rows), (_DRAWS, len(rows)))
    for name, values in columns.items():
        each = np.array(values, dtype=np.float64)
        low, high = np.quantile(each[index].mean(axis=1), (0.05, 0.95))
        out[name] = float(each.mean())
        out[f"{name}_interval"] = [float(low), float(high)]
    out["pit"] = np.histogram([r.pit for r in rows], 10, (0.0, 1.0))[0].tolist()
    return out


def by_thirds(rows: Sequence[Scored], key: Callable[[Scored], float]) -> list[list[Scored]]:
    """Return predictions in three parts of as many lives."""
    values = sorted({(key(r), r.number) for r in rows})
    cuts = [values[int(len(values) * share)][0] for share in (1 / 3, 2 / 3)]
    parts: list[list[Scored]] = [[], [], []]
    for r in rows:
        parts[int(np.searchsorted(cuts, key(r), side="right"))].append(r)
    return [part for part in parts if part]


def flatness(rows: Sequence[Scored]) -> float:
    """Return how likely a histogram of the truth's shares as uneven as this is, if it were flat."""
    rng = np.random.default_rng(67)
    counts = np.histogram([r.pit for r in rows], 10, (0.0, 1.0))[0]
    even = len(rows) / 10.0
    drawn = rng.multinomial(len(rows), [0.1] * 10, size=20_000)
    distance = ((drawn - even) ** 2).sum(axis=1)
    return float(np.mean(distance >= ((counts - even) ** 2).sum()))
