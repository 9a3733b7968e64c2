"""Classes and severities from examples: trained on some units, judged on those left out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from elevon.arrays import Bools, Floats
from elevon.diagnose.learning.discriminant import SHRINKAGES, Discriminant
from elevon.diagnose.learning.examples import Examples, Rows, Strings
from elevon.diagnose.learning.labels import HEALTHY
from elevon.diagnose.learning.model import (
    ABSOLUTE,
    RELATIVE,
    ClassView,
    LearnedClasses,
    Severities,
    fault_logits,
    raw_scores,
)
from elevon.diagnose.learning.motion import KnownMotion
from elevon.diagnose.learning.trees import Trees
from elevon.errors import InputError, Interrupted
from elevon.progress import Progress

_MANY = 300  # logs from which on trees are larger and folds fewer. ASSUMED
_FOLDS, _FOLDS_OF_MANY = 10, 4  # at most: groups beyond share one
_RATE = 0.1  # of learning
#: Of boosting, for tens of logs: shallow. ASSUMED.
_FEW_TREES = {"n_estimators": 60, "max_depth": 2}
#: Of boosting, for hundreds of logs and more. ASSUMED; docs/evidence/diagnosis.md judges it.
_ROUNDS = 150
_MANY_TREES = {
    "n_estimators": _ROUNDS, "max_depth": None, "max_leaf_nodes": 8, "min_samples_leaf": 10,
}  # fmt: skip
_TEMPERATURES = np.geomspace(1.0, 30.0, 30)  # scores are flattened, never sharpened
_LEAST = 3  # logs of a class
_LEAST_SIZED = 10  # logs of a kind with a severity: below that no interval of 90 % is conformal
_COVERED = 0.9  # of errors that an interval of a severity holds
_NAMED = 0.95  # of single faults that must be named from a severity on


@dataclass(frozen=True)
class _LeftOut:
    """Logs that a group left out judged: their rows, and what was said of them."""

    rows: Rows
    scores: Floats
    distances: Floats


class _SizedKind(NamedTuple):
    """Trees of one kind's size; `error` is the median one of units left out, without logs none."""

    start: float
    trees: Trees
    low: float
    high: float
    reach: float
    logs: int
    error: float


def learned_classes(
    examples: Examples,
    motion: KnownMotion,
    *,
    pole_pairs: float | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[LearnedClasses, dict[str, Any]]:
    """Train a classifier; choose it and calibrate it on groups left out.

    Parameters
    ----------
    examples : Examples
        Of one motion, some of them healthy.
    motion : KnownMotion
        Of them.
    pole_pairs : float, optional
        That their numbers were computed with.
    seed : int
        Of boosting, and of the baselines that logs are held against.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Returns
    -------
    LearnedClasses, dict
        The classifier, and what was counted: ``logs``, ``classes``, ``classifier``, ``loss``,
        ``left_out`` by unit and condition, ``severities``; under ``relative`` the same of changes
        against baselines.

    Raises
    ------
    Interrupted
        `progress` returned False.
    InputError
        No healthy log, no other class, or a class of fewer than three logs; each unit has a class
        of its own.
    """
    check_labels(examples)
    views, reports = {}, {}
    changes = examples.against_baselines(seed)
    sets = {ABSOLUTE: examples}
    if _shows_every_class(changes, examples):
        sets[RELATIVE] = changes
    for number, (name, these) in enumerate(sets.items()):
        if progress is not None and not progress(number / len(sets)):
            raise Interrupted("interrupted before the training ended")
        views[name], reports[name] = _train_view(these, seed, exclusive=examples.exclusive)
    share = np.clip(examples.present.mean(axis=0), 1e-6, 1.0 - 1e-6)
    classes = LearnedClasses(
        examples.names, examples.kinds, examples.severity_units, examples.exclusive, share, motion,
        pole_pairs, views,
    )  # fmt: skip
    report = reports.pop(ABSOLUTE)
    return classes, report | reports


def check_labels(examples: Examples) -> None:
    """Refuse examples that teach no class.

    Raises
    ------
    InputError
        As `learned_classes`.
    """
    counts = _counts(examples)
    if not examples.kinds or not examples.healthy.any():
        raise InputError(
            f"labels {sorted(counts)}: one must be {HEALTHY!r}, and there must be another"
        )
    for name, count in counts.items():
        if count < _LEAST:
            raise InputError(f"label {name!r}: {count} logs; {_LEAST} are needed")


def _counts(examples: Examples) -> dict[str, int]:
    """Logs of each class; one with several kinds counts for each."""
    counts = dict(zip(examples.kinds, examples.present.sum(axis=0).tolist(), strict=True))
    healthy = int(examples.healthy.sum())
    return counts | ({HEALTHY: healthy} if healthy else {})


def _shows_every_class(changes: Examples, examples: Examples) -> bool:
    """Whether changes against baselines show every class, of more than one unit."""
    enough = changes.present.sum(axis=0) >= _LEAST
    several = len(set(changes.unit.tolist())) > 1
    most = 2 * len(changes.values) >= len(examples.values)
    return bool(several and most and changes.healthy.sum() >= _LEAST and enough.all())


def _train_view(
    examples: Examples, seed: int, *, exclusive: bool
) -> tuple[ClassView, dict[str, Any]]:
    """Train one classifier on all examples, judge it by groups that are left out."""
    methods = ("discriminant", "boosting") if exclusive else ("boosting",)
    judged = {m: _judge_left_out(examples, examples.unit, m, seed, exclusive) for m in methods}
    warmth = {m: _best_temperature(left, examples, exclusive) for m, left in judged.items()}
    best = min(warmth, key=lambda m: warmth[m][0])
    temperature = warmth[best][1]
    left = judged[best]
    scores = left.scores / temperature
    discriminant, trees = _train_classifier(examples, best, seed, exclusive, chosen=True)
    healthy = examples.healthy[left.rows]
    logits = fault_logits(scores[healthy], discriminant.classes, exclusive)
    severities, sized = _severities(examples, seed)
    named = _named_from(examples, left.rows, scores, discriminant.classes, exclusive)
    view = ClassView(discriminant, trees, temperature, logits, left.distances, named, severities)
    counted = {"unit": _counted(left, examples, exclusive)}
    if len(set(examples.condition.tolist())) > 1:
        others = _judge_left_out(examples, examples.condition, best, seed, exclusive)
        counted["condition"] = _counted(others, examples, exclusive)
    report = {
        "logs": len(examples.values), "classes": _counts(examples), "classifier": best,
        "loss": {m: row[0] for m, row in warmth.items()}, "left_out": counted,
    }  # fmt: skip
    return view, report | ({"severities": sized} if sized else {})


def _judge_left_out(
    examples: Examples, groups: Strings, method: str, seed: int, exclusive: bool
) -> _LeftOut:
    """What is said of each log by the others' groups; logs whose class they lack are left out."""
    rows, scores, distances = [], [], []
    for test in _folds(groups):
        part = examples.take(np.flatnonzero(~test))
        if not _has_every_class(part, examples):
            continue
        fit, trees = _train_classifier(part, method, seed, exclusive)
        values = examples.values[test]
        rows.append(np.flatnonzero(test))
        scores.append(raw_scores(fit, trees, values, exclusive))
        distances.append(fit.distances(values).min(axis=1))
    if not rows:
        raise InputError(
            "no unit can be left out: each has a class of its own; give logs of other units"
        )
    return _LeftOut(np.concatenate(rows), np.vstack(scores), np.concatenate(distances))


def _has_every_class(part: Examples, examples: Examples) -> bool:
    """Whether a part has every class of the whole."""
    there = part.present.any(axis=0) == examples.present.any(axis=0)
    return bool(there.all() and part.healthy.any())


def _folds(groups: Strings) -> Iterator[Bools]:
    """Yield which logs are left out together."""
    names = np.unique(groups)
    most = _FOLDS if len(groups) < _MANY else _FOLDS_OF_MANY
    for k in range(min(len(names), most)):
        yield np.isin(groups, names[k::most])


def _train_classifier(
    examples: Examples, method: str, seed: int, exclusive: bool, *, chosen: bool = False
) -> tuple[Discriminant, Trees | None]:
    """Return discriminant and trees; where `chosen`, the discriminant's shrinkage is."""
    groups = examples.unit
    if len(groups) >= _MANY:
        number = np.zeros(len(groups), dtype=np.int64)
        for k, test in enumerate(_folds(groups)):
            number[test] = k
        groups = number.astype(np.str_)
    discriminant = Discriminant.fit(
        examples.values, examples.labels.tolist(), groups,
        shrinkage=None if chosen else SHRINKAGES[1],
    )  # fmt: skip
    return discriminant, None if method == "discriminant" else _train_trees(
        examples, seed, exclusive
    )


def _train_trees(examples: Examples, seed: int, exclusive: bool) -> Trees:
    from sklearn.ensemble import GradientBoostingClassifier

    values = examples.values.astype(np.float32)
    model = GradientBoostingClassifier(**_boosting_options(len(values), seed))
    if exclusive:
        return Trees.of(model.fit(values, examples.labels))
    return Trees.joined([Trees.of(model.fit(values, there)) for there in examples.present.T])


def _boosting_options(count: int, seed: int) -> dict[str, Any]:
    return {
        "init": "zero", "learning_rate": _RATE, "subsample": 0.7, "max_features": "sqrt",
        "random_state": seed, **(_FEW_TREES if count < _MANY else _MANY_TREES),
    }  # fmt: skip


def _best_temperature(left: _LeftOut, examples: Examples, exclusive: bool) -> tuple[float, float]:
    """Log loss of what groups left out say, and the temperature at which it is least."""
    labels = examples.labels
    right = np.searchsorted(np.unique(labels), labels[left.rows])
    there = examples.present[left.rows]
    losses = []
    for t in _TEMPERATURES:
        scores = left.scores / t
        if exclusive:
            logs = scores - np.logaddexp.reduce(scores, axis=1)[:, None]
            logs = logs[np.arange(len(right)), right]
        else:
            logs = -np.logaddexp(0.0, np.where(there, -scores, scores)).sum(axis=1)
        losses.append(float(-np.mean(np.maximum(logs, -12.0))))
    best = int(np.argmin(losses))
    return losses[best], float(_TEMPERATURES[best])


def _named_kinds(
    scores: Floats, kinds: tuple[str, ...], exclusive: bool, classes: Strings
) -> Bools:
    """Return which kinds are said to be there, shape (n, f)."""
    if not exclusive:
        return np.asarray(scores > 0.0)
    return np.asarray(classes[scores.argmax(axis=1)][:, None] == np.array(kinds)[None, :])


def _counted(left: _LeftOut, examples: Examples, exclusive: bool) -> dict[str, Any]:
    """Counts of what groups left out say, by the most probable class or kinds above one half."""
    there, healthy = examples.present[left.rows], examples.healthy[left.rows]
    kinds = _named_kinds(left.scores, examples.kinds, exclusive, np.unique(examples.labels))
    right, alarm = np.all(kinds == there, axis=1), np.any(kinds, axis=1)
    return {
        "logs": len(there), "right": int(right.sum()),
        "interval": share_interval(int(right.sum()), len(there)),
        "healthy": int(healthy.sum()), "false_alarms": int(alarm[healthy].sum()),
        "faulty": int((~healthy).sum()), "missed": int((~alarm[~healthy]).sum()),
    }  # fmt: skip


def _named_from(
    examples: Examples, rows: Rows, scores: Floats, classes: tuple[str, ...], exclusive: bool
) -> Floats:
    """Return the least severity from which on single faults are named, shape (f,)."""
    there, severity = examples.present[rows], np.abs(examples.severity[rows])
    kinds = _named_kinds(scores, examples.kinds, exclusive, np.array(classes))
    right, single = np.all(kinds == there, axis=1), np.sum(there, axis=1) == 1
    out = np.full(len(examples.kinds), math.nan)
    for k in range(len(out)):
        of = np.flatnonzero(single & there[:, k] & np.isfinite(severity[:, k]))
        of = of[np.argsort(-severity[of, k])]
        share = np.cumsum(right[of]) / np.arange(1, len(of) + 1)
        good = np.flatnonzero(share >= _NAMED)
        if good.size and len(of) >= _LEAST_SIZED:
            out[k] = severity[of[good[-1]], k]
    return out


def _severities(examples: Examples, seed: int) -> tuple[Severities | None, dict[str, Any]]:
    """Return trees of the severities that enough logs state, and how well they hold."""
    sized = [_sized_kind(examples, k, seed) for k in range(len(examples.kinds))]
    if not any(item.logs for item in sized):
        return None, {}
    severities = Severities(
        Trees.joined([item.trees for item in sized]),
        *(
            np.array([getattr(item, n) for item in sized])
            for n in ("start", "low", "high", "reach")
        ),
    )
    report = {
        kind: {"logs": item.logs, "low": item.low, "high": item.high, "error": item.error,
               "interval": item.reach}
        for kind, item in zip(examples.kinds, sized, strict=True) if item.logs
    }  # fmt: skip
    return severities, report


def _sized_kind(examples: Examples, number: int, seed: int) -> _SizedKind:
    """Fit the sizes of one kind, where enough logs of several units state its severity."""
    severity = examples.severity[:, number]
    part = examples.take(np.flatnonzero(examples.present[:, number] & np.isfinite(severity)))
    severity = part.severity[:, number]
    if len(severity) < _LEAST_SIZED or len(set(part.unit.tolist())) < 2:
        return _SizedKind(0.0, Trees.constant(_ROUNDS), 0.0, 0.0, 0.0, 0, math.nan)
    sizes = np.sign(severity) * np.sqrt(np.abs(severity) / np.abs(severity).max())
    errors = np.abs(_sizes_left_out(part, sizes, seed) - sizes)
    start, trees = _size_trees(part.values, sizes, seed)
    low, high = min(float(severity.min()), 0.0), max(float(severity.max()), 0.0)
    return _SizedKind(
        start, trees, low, high, _conformal_error(errors), len(severity), float(np.median(errors))
    )


def _size_trees(values: Floats, sizes: Floats, seed: int) -> tuple[float, Trees]:
    """Return what trees of a size are added to, and the trees."""
    from sklearn.ensemble import GradientBoostingRegressor

    start = float(sizes.mean())
    options = _boosting_options(len(sizes), seed) | {"n_estimators": _ROUNDS}
    model = GradientBoostingRegressor(**options)
    return start, Trees.of(model.fit(values.astype(np.float32), sizes - start))


def _sizes_left_out(part: Examples, sizes: Floats, seed: int) -> Floats:
    """Return the size of each log by the other groups' units."""
    out = np.empty(len(sizes))
    for test in _folds(part.unit):
        start, trees = _size_trees(part.values[~test], sizes[~test], seed)
        out[test] = start + trees.scores(part.values[test])[:, 0]
    return out


def _conformal_error(errors: Floats) -> float:
    """Return the error whose rank holds `_COVERED` of the next ones."""
    rank = min(math.ceil(_COVERED * (len(errors) + 1)), len(errors))
    return float(np.sort(errors)[rank - 1])


def share_interval(hits: int, count: int) -> tuple[float, float]:
    """Return the exact 95 % interval of a share (Clopper and Pearson, Biometrika 26, 1934)."""
    from scipy.special import betaincinv

    if count == 0:
        return 0.0, 1.0
    low = float(betaincinv(hits, count - hits + 1, 0.025)) if hits else 0.0
    high = float(betaincinv(hits + 1, count - hits, 0.975)) if hits < count else 1.0
    return low, high
