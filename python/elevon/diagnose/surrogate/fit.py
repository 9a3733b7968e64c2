"""A surrogate from tables of runs: trained on some units, made honest by the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.surrogate.boosted import (
    Batch,
    Ensemble,
    Opinion,
    either,
    honest,
    trained,
)
from elevon.diagnose.surrogate.features import NAMES, SCALES, changes
from elevon.diagnose.surrogate.model import Head, Surrogate, TestModel
from elevon.diagnose.surrogate.population import ALIKE, FAULTS
from elevon.diagnose.surrogate.sampling import Rows, sizes
from elevon.diagnose.surrogate.table import TrainingTable
from elevon.diagnose.surrogate.view import VIEWS, View
from elevon.errors import Interrupted
from elevon.progress import Progress, part

FALSE_ALARM = 0.05
HIGH = 0.25  # of a batch at least are runs of the switching model
_KNOWN = 1000  # training runs kept to tell what is unlike them
_FAR = 0.995  # of held-out runs lie nearer to a training run
_ROOM = 0.1  # of the trained range beyond its ends
_LEAST = 0.2  # of the healthy median: what a share is taken of at least


@dataclass(frozen=True)
class TrainingPlan:
    """How it is trained.

    Attributes
    ----------
    folds : int
        Parts of the units, those that are built alike together; each part is held out of the
        member that is calibrated on it.
    rounds, draws, batch : int
        Trees of each fault; batches that a member is trained on, runs of a batch.
    seed : int
        Of the batches.
    """

    folds: int = 4
    rounds: int = 60
    draws: int = 100
    batch: int = 256
    seed: int = 0


def fitted(
    high: Mapping[str, TrainingTable],
    low: Mapping[str, TrainingTable],
    plan: TrainingPlan,
    report: Mapping[str, object],
    progress: Progress | None = None,
) -> Surrogate:
    """Train a surrogate.

    Parameters
    ----------
    high, low : mapping of str to TrainingTable
        Test to runs of the switching model and, beside them, of the reduced-order one. Those of the
        switching model alone are calibrated on.
    plan : TrainingPlan
        How.
    report : mapping
        Kept in the file, what calibration says beside it.
    progress : callable, optional
        Called with the done fraction; False stops.
    """
    tests, validation = {}, {}
    steps = len(high) * len(VIEWS)
    for number, (name, table) in enumerate(high.items()):
        heads = {}
        for at, view in enumerate(VIEWS, number * len(VIEWS)):
            heads[view], validation[f"{name}.{view}"] = _head(
                Rows.of(table), Rows.of(low[name]) if name in low else None, view == "relative",
                plan, part(progress, at / steps, (at + 1) / steps),
            )  # fmt: skip
        first = np.flatnonzero(table.baseline)
        travel, speed = np.median(table.about[first], axis=0)
        tests[name] = TestModel(name == "loaded", float(travel), float(speed), heads)
    return Surrogate(tests, {**report, "cross_validation": validation})


def _head(
    high: Rows, low: Rows | None, relative: bool, plan: TrainingPlan, progress: Progress | None
) -> tuple[Head, dict[str, object]]:
    rng = np.random.default_rng([plan.seed, 99])
    view = _view(high, relative, rng)
    usable = high.usable()
    fold = _folds(high.table.unit, plan.folds)[usable]
    ensembles, parts = [], []
    for k in range(plan.folds):
        train_rows = usable[fold != k]
        if progress is not None and progress(k / plan.folds) is False:
            raise Interrupted("training was interrupted")
        batches = _sampler(high, train_rows, low, view, plan.batch)
        ensembles.append(
            trained(batches, draws=plan.draws, rounds=plan.rounds, seed=plan.seed + 1000 * k)
        )
        validation = usable[fold == k]
        parts.append((validation, ensembles[-1].says(high.inputs(view, validation, rng))))
    rows = np.concatenate([validation for validation, _ in parts])
    validation = _Validation(
        rows, np.concatenate([np.full(len(numbers), k) for k, (numbers, _) in enumerate(parts)]),
        _stacked([opinion for _, opinion in parts]),
    )  # fmt: skip
    return _calibrated(high, low, view, Ensemble.of(ensembles), validation=validation, rng=rng)


def _folds(unit: npt.NDArray[np.int64], folds: int) -> npt.NDArray[np.int64]:
    """Parts of the units, shape as theirs: those built alike are of one part if they suffice."""
    alike = ALIKE if int(unit.max()) >= ALIKE * (folds - 1) else 1
    return unit // alike % folds


@dataclass(frozen=True)
class _Validation:
    """Runs, shape (n,), the part each is of, and what the member says that has not seen it."""

    rows: npt.NDArray[np.int64]
    fold: npt.NDArray[np.int64]
    opinion: Opinion

    def chances(self, union: Floats, healthy: npt.NDArray[np.bool_]) -> Floats:
        """Return the share of healthy runs of the same part that look at least as faulty."""
        out = np.empty(len(union))
        for k in set(self.fold.tolist()):
            part = self.fold == k
            scores = np.sort(union[part & healthy])
            out[part] = 1.0 - np.searchsorted(scores, union[part]) / max(len(scores), 1)
        return out


def _sampler(
    high: Rows, rows: npt.NDArray[np.int64], low: Rows | None, view: View, size: int
) -> Callable[[np.random.Generator], Batch]:
    """Batches of both models' runs, as they are; a quarter of the switching model at least."""
    others = None if low is None else low.usable()
    share = 1.0 if others is None else max(HIGH, len(rows) / (len(rows) + len(others)))

    def batch(rng: np.random.Generator) -> Batch:
        count = round(share * size)
        first = high.batch(view, rng.choice(rows, count), rng)
        if others is None or low is None:
            return first
        second = low.batch(view, rng.choice(others, size - count), rng)
        return Batch(np.vstack((first.inputs, second.inputs)), np.vstack((first.size, second.size)))

    return batch


def _stacked(opinions: Sequence[Opinion]) -> Opinion:
    axes = {"presence": 0, "size": 0, "each": 1}
    return Opinion(
        *(np.concatenate([getattr(o, n) for o in opinions], axis=a) for n, a in axes.items())
    )


def _view(high: Rows, relative: bool, rng: np.random.Generator) -> View:
    """Scales of the features, from the healthy days of all units."""
    table = high.table
    healthy = table.values[table.baseline]
    centre = np.nan_to_num(np.nanmedian(np.where(np.isfinite(healthy), healthy, 0.0), axis=0))
    floor = np.where([n in SCALES for n in NAMES], _LEAST * np.abs(centre) + 1e-12, 1.0)
    over = np.nan_to_num(changes(healthy, centre, floor))
    view = View(relative, centre, floor, *(np.ones(len(NAMES)) for _ in range(4)))
    rows = high.usable()
    baselines = rows[table.baseline[rows]]
    spread = _changes(high, view, baselines, rng).std(axis=0)
    spread = np.where(spread > 0.0, spread, 1.0)
    wide = _changes(high, view, rows, rng).std(axis=0)
    return View(
        relative, centre, floor, spread, np.where(wide > 0.0, wide, 1.0),
        over.mean(axis=0), np.where(over.std(axis=0) > 0.0, over.std(axis=0), 1.0),
    )  # fmt: skip


def _calibrated(
    high: Rows,
    low: Rows | None,
    view: View,
    ensemble: Ensemble,
    *,
    validation: _Validation,
    rng: np.random.Generator,
) -> tuple[Head, dict[str, object]]:
    rows, opinion = validation.rows, validation.opinion
    severity = high.table.severity[rows]
    there = severity != 0.0
    faulty = there.any(axis=1)
    calibrations = [
        _calibration(opinion.presence[:, k], there[:, k]) for k in range(there.shape[1])
    ]
    union = either(honest(np.array(calibrations), opinion.presence))
    scaling = np.array([*calibrations, _calibration(union, faulty)])
    score = np.abs(sizes(severity) - opinion.size)
    conformal = np.array([_quantile(score[there[:, k], k]) for k in range(there.shape[1])])
    change = _changes(high, view, rows, rng)
    known = _known(high, low, view, rng)
    head = Head(
        view, ensemble, scaling, conformal, union[~faulty], validation.fold[~faulty].astype(float),
        known,
        *_ends(np.vstack((change, np.sinh(known)))), *_unit_ends(high, low, view),
        np.full(len(FAULTS), np.nan), np.inf,
    )  # fmt: skip
    named = _named(opinion, scaling, severity)
    reach = float(np.quantile(_to_neighbour(head, change), _FAR))
    head = Head(**{**vars(head), "named": named, "reach": reach})
    return head, scores(head, opinion, severity, validation.chances(union, ~faulty))


def _changes(
    rows_of: Rows, view: View, rows: npt.NDArray[np.int64], rng: np.random.Generator
) -> Floats:
    healthy = rows_of.references(rows, rng)[0] if view.relative else None
    return view.change(rows_of.values(rows, rng), healthy)


def _known(high: Rows, low: Rows | None, view: View, rng: np.random.Generator) -> Floats:
    parts = []
    for source in (high, low):
        if source is not None:
            rows = source.usable()
            rows = rng.choice(rows, min(_KNOWN // 2, len(rows)), replace=False)
            parts.append(np.arcsinh(_changes(source, view, rows, rng)))
    return np.vstack(parts)


def _to_neighbour(head: Head, change: Floats) -> Floats:
    """Distance to the second nearest of the known runs: the nearest may be the run itself."""
    scaled = np.arcsinh(change)
    square = (scaled**2).sum(axis=1)[:, None] + (head.known**2).sum(axis=1)[None, :]
    square = np.maximum(square - 2.0 * scaled @ head.known.T, 0.0)
    return np.asarray(np.sqrt(np.partition(square, 1, axis=1))[:, 1])


def _unit_ends(high: Rows, low: Rows | None, view: View) -> tuple[Floats, Floats]:
    """Return between what ends the trained units lie, by single healthy days of theirs."""
    if not view.relative:  # units are held against the middle: what is unlike them has changed
        return np.zeros(len(NAMES)), np.zeros(len(NAMES))
    healthy = [s.table.values[s.table.baseline] for s in (high, low) if s is not None]
    return _ends(view.context(np.vstack(healthy)))


def _ends(change: Floats) -> tuple[Floats, Floats]:
    low, high = change.min(axis=0), change.max(axis=0)
    return low - _ROOM * (high - low) - 1e-9, high + _ROOM * (high - low) + 1e-9


def _calibration(logit: Floats, truth: npt.NDArray[np.bool_]) -> tuple[float, float, float]:
    """Slopes and offset of `honest`, by likelihood, with Platt's smoothed targets."""
    from scipy.optimize import minimize

    count = float(truth.sum())
    target = np.where(truth, (count + 1.0) / (count + 2.0), 1.0 / (len(truth) - count + 2.0))

    def loss(x: Floats) -> float:
        z = honest(x[None, :], logit[:, None])[:, 0]
        return float(np.mean(np.logaddexp(0.0, z) - target * z)) + 1e-3 * float(
            np.sum((x[:2] - 1.0) ** 2)
        )

    best = minimize(loss, np.array([1.0, 1.0, 0.0]), bounds=[(0.05, 5.0)] * 2 + [(-5.0, 5.0)]).x
    return float(best[0]), float(best[1]), float(best[2])


def _quantile(score: Floats, level: float = 0.9) -> float:
    """Conformal quantile: the rank that holds `level` of the next one."""
    if not len(score):
        return 3.0
    rank = min(int(np.ceil(level * (len(score) + 1))), len(score))
    return float(np.sort(score)[rank - 1])


def _named(opinion: Opinion, scaling: Floats, severity: Floats) -> Floats:
    """Least severity from which on 95 % of the single faults are the most probable one."""
    logit = honest(scaling[:-1], opinion.presence)
    single = (severity != 0.0).sum(axis=1) == 1
    out = np.full(severity.shape[1], np.nan)
    for k in range(severity.shape[1]):
        rows = np.flatnonzero(single & (severity[:, k] != 0.0))
        rows = rows[np.argsort(-np.abs(severity[rows, k]))]
        right = (logit[rows].argmax(axis=1) == k) & (logit[rows, k] > 0.0)
        share = np.cumsum(right) / np.arange(1, len(rows) + 1)
        good = np.flatnonzero(share >= 0.95)
        if good.size:
            out[k] = abs(severity[rows[good[-1]], k])
    return out


def scores(head: Head, opinion: Opinion, severity: Floats, chance: Floats) -> dict[str, object]:
    """Return what an opinion of held-out runs is worth.

    `chance`, shape (n,), is how often a healthy unit looks as faulty.
    """
    there = severity != 0.0
    faulty = there.any(axis=1)
    logit = honest(head.scaling[:-1], opinion.presence)
    probability = 1.0 / (1.0 + np.exp(-logit))
    alarm = chance <= FALSE_ALARM
    inside = np.abs(sizes(severity) - opinion.size) <= head.conformal
    single = there.sum(axis=1) == 1
    best = probability.argmax(axis=1) == there.argmax(axis=1)
    named = ((probability > 0.5) == there).all(axis=1)
    return {
        "runs": len(severity),
        "healthy": int((~faulty).sum()),
        "false_alarms": int(alarm[~faulty].sum()),
        "faulty": int(faulty.sum()),
        "alarms": int(alarm[faulty].sum()),
        "singles": int(single.sum()),
        "singles_first": int(best[single].sum()),
        "exactly_named": int(named.sum()),
        "covered": int(inside[there].sum()),
        "severities": int(there.sum()),
        "brier": float(np.mean((probability - there) ** 2)),
        "brier_by_rate": float(np.mean((there.mean(axis=0) - there) ** 2)),
        "reliability": _reliability(probability.ravel(), there.ravel()),
    }


def _reliability(probability: Floats, there: npt.NDArray[np.bool_]) -> list[dict[str, float]]:
    """Given and true shares in bins of the probability."""
    edges = np.array([0.0, 0.02, 0.1, 0.3, 0.7, 0.9, 0.98, 1.0])
    at = np.clip(np.searchsorted(edges, probability, side="right") - 1, 0, len(edges) - 2)
    return [
        {
            "given": float(probability[at == k].mean()),
            "true": float(there[at == k].mean()),
            "count": int((at == k).sum()),
        }
        for k in range(len(edges) - 1)
        if (at == k).any()
    ]
