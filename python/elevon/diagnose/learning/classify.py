"""Classes from labelled logs: trained on some units, judged on those left out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.learning.classes import HEALTHY, LearnedClasses, faulty_logit, scores_of
from elevon.diagnose.learning.discriminant import SHRINKAGES, Discriminant
from elevon.diagnose.learning.motion import motions
from elevon.diagnose.learning.trees import Trees
from elevon.errors import InputError, Interrupted
from elevon.progress import Progress

if TYPE_CHECKING:
    from elevon.logs.log import Log

_FOLDS = 10  # at most: groups beyond share one
_ROUNDS, _DEPTH, _RATE = 60, 2, 0.1  # of boosting. ASSUMED: shallow, for tens of logs
_TEMPERATURES = np.geomspace(1.0, 30.0, 30)  # scores are flattened, never sharpened
_LEAST = 3  # logs of a class
Strings = npt.NDArray[np.str_]


@dataclass(frozen=True)
class LabelledLog:
    """What is known of a log: its class, of which unit, in which condition."""

    label: str
    unit: str = ""
    condition: str = ""


@dataclass(frozen=True)
class _Left:
    """Logs that a group left out judged: their numbers, and what was said of them."""

    rows: npt.NDArray[np.intp]
    scores: Floats
    distances: Floats


def learned_classes(
    logs: Sequence[Log],
    known: Sequence[LabelledLog],
    *,
    pole_pairs: float | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> LearnedClasses:
    """Train a classifier; choose it and calibrate it on groups left out.

    Parameters
    ----------
    logs : sequence of Log
        Of one motion.
    known : sequence of LabelledLog
        Of each; one class is ``healthy``.
    pole_pairs : float, optional
        Of the motor, for what turns with the electrical angle.
    seed : int
        Of boosting.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    Interrupted
        `progress` returned False.
    InputError
        No class ``healthy``, fewer than two classes, or a class of fewer than three logs; logs of
        different motions; a log that cannot be read.
    """
    _check(known)
    items = motions(logs, pole_pairs)
    if progress is not None and not progress(0.5):
        raise Interrupted("interrupted before the training")
    names = [n for n in items[0].values if all(n in item.values for item in items)]
    values = np.array([[item.values[n] for n in names] for item in items])
    varied = np.ptp(values, axis=0) > 0.0
    values, names = values[:, varied], [n for n, there in zip(names, varied, strict=True) if there]
    labels = np.array([k.label for k in known])
    groups = _groups(known)
    judged: dict[str, _Left] = {}
    for kind in ("discriminant", "boosting"):
        judged[kind] = _left_out(values, labels, groups["unit"], kind, seed)
    warmth = {kind: _warmth(left, labels) for kind, left in judged.items()}
    best = min(warmth, key=lambda kind: warmth[kind][0])
    left, classes = judged[best], np.unique(labels)
    healthy = labels[left.rows] == HEALTHY
    scores = left.scores / warmth[best][1]
    report = {
        "logs": len(logs), "classes": {str(c): int((labels == c).sum()) for c in classes},
        "classifier": best, "loss": {kind: row[0] for kind, row in warmth.items()},
        "left_out": {
            name: _judged(_left_out(values, labels, group, best, seed), labels)
            for name, group in groups.items()
        },
    }  # fmt: skip
    discriminant = Discriminant.fit(values, labels.tolist(), groups["unit"])
    trees = _boosted(values, labels, seed) if best == "boosting" else None
    return LearnedClasses(
        tuple(names), discriminant, trees, warmth[best][1],
        faulty_logit(scores[healthy], classes.tolist()), left.distances, items[0].command,
        items[0].pace, items[0].seconds, pole_pairs, report,
    )  # fmt: skip


def _check(known: Sequence[LabelledLog]) -> None:
    labels = [k.label for k in known]
    if HEALTHY not in labels or len(set(labels)) < 2:
        raise InputError(
            f"labels {sorted(set(labels))}: one must be {HEALTHY!r}, and there must be another"
        )
    for name in set(labels):
        if labels.count(name) < _LEAST:
            raise InputError(f"label {name!r}: {labels.count(name)} logs; {_LEAST} are needed")


def _groups(known: Sequence[LabelledLog]) -> dict[str, Strings]:
    """What is left out together; logs of which nothing is known each by itself."""
    units = np.array([k.unit or f"log {n}" for n, k in enumerate(known)])
    out = {"unit": units}
    if len({k.condition for k in known}) > 1:
        out["condition"] = np.array([k.condition for k in known])
    return out


def _left_out(values: Floats, labels: Strings, groups: Strings, kind: str, seed: int) -> _Left:
    """What is said of each log by the others' groups; logs whose class they lack are left out."""
    classes = np.unique(labels)
    rows, scores, distances = [], [], []
    for test in _folds(groups):
        if set(labels[~test].tolist()) != set(classes.tolist()):
            continue
        fit = Discriminant.fit(
            values[~test], labels[~test].tolist(), groups[~test], shrinkage=SHRINKAGES[1]
        )
        trees = _boosted(values[~test], labels[~test], seed) if kind == "boosting" else None
        rows.append(np.flatnonzero(test))
        scores.append(scores_of(fit, trees, values[test]))
        distances.append(fit.distances(values[test]).min(axis=1))
    if not rows:
        raise InputError(
            "no unit can be left out: each has a class of its own; give logs of other units"
        )
    return _Left(np.concatenate(rows), np.vstack(scores), np.concatenate(distances))


def _folds(groups: Strings) -> Iterator[npt.NDArray[np.bool_]]:
    names = np.unique(groups)
    for k in range(min(len(names), _FOLDS)):
        yield np.isin(groups, names[k::_FOLDS])


def _boosted(values: Floats, labels: Strings, seed: int) -> Trees:
    from sklearn.ensemble import GradientBoostingClassifier

    model = GradientBoostingClassifier(
        init="zero", n_estimators=_ROUNDS, max_depth=_DEPTH, learning_rate=_RATE, subsample=0.7,
        max_features="sqrt", random_state=seed,
    )  # fmt: skip
    return Trees.of(model.fit(values.astype(np.float32), labels))


def _warmth(left: _Left, labels: Strings) -> tuple[float, float]:
    """Log loss of what groups left out say, and the temperature at which it is least."""
    truth = np.searchsorted(np.unique(labels), labels[left.rows])
    losses = []
    for t in _TEMPERATURES:
        scores = left.scores / t
        logs = scores - np.logaddexp.reduce(scores, axis=1)[:, None]
        losses.append(float(-np.mean(np.maximum(logs[np.arange(len(truth)), truth], -12.0))))
    best = int(np.argmin(losses))
    return losses[best], float(_TEMPERATURES[best])


def _judged(left: _Left, labels: Strings) -> Mapping[str, Any]:
    """Counts of what groups left out say, by the most probable class."""
    truth = labels[left.rows]
    answer = np.unique(labels)[left.scores.argmax(axis=1)]
    right, healthy = answer == truth, truth == HEALTHY
    return {
        "logs": len(truth), "right": int(right.sum()),
        "interval": share_interval(int(right.sum()), len(truth)),
        "healthy": int(healthy.sum()), "false_alarms": int((answer[healthy] != HEALTHY).sum()),
        "faulty": int((~healthy).sum()), "missed": int((answer[~healthy] == HEALTHY).sum()),
    }  # fmt: skip


def share_interval(hits: int, count: int) -> tuple[float, float]:
    """Return the exact 95 % interval of a share (Clopper and Pearson, Biometrika 26, 1934)."""
    from scipy.special import betaincinv

    if count == 0:
        return 0.0, 1.0
    low = float(betaincinv(hits, count - hits + 1, 0.025)) if hits else 0.0
    high = float(betaincinv(hits + 1, count - hits, 0.975)) if hits < count else 1.0
    return low, high
