"""Baseline scores on the benchmark set: what a forest of trees makes of the features."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.benchmark.make import ACTUATORS, BENCHMARK
from elevon.errors import InputError
from elevon.files import read_regular, write_text

SCORES = "scores.json"

#: A fault counts as present from this part of its severity at the end of life on.
_PRESENT = 0.2
_TREES, _RESAMPLES = 200, 200


@dataclass(frozen=True)
class Score:
    """The baseline on one fault of one part of the set.

    Attributes
    ----------
    actuator, part, fault : str
        Part: ``validation``, ``test`` or ``shifted``.
    runs, present : int
        Runs, and those in which the fault is present.
    auc, auc_interval : float, list of float, or None
        Area under the receiver's curve of the detection, and 95 % interval over resampled units;
        None where all runs are of one kind.
    null, age : float or None
        The same area of a forest whose training labels were dealt at random, and of the age alone:
        what grows late goes with everything else that does.
    error, error_interval : float, list of float, or None
        Root mean square error of the severity over that of the training runs' mean: below 1 is
        better than no look at the features.
    """

    actuator: str
    part: str
    fault: str
    runs: int
    present: int
    auc: float | None
    auc_interval: list[float] | None
    null: float | None
    age: float | None
    error: float | None
    error_interval: list[float] | None


@dataclass(frozen=True)
class _Part:
    """Features, severities over the largest, units and ages of some runs."""

    features: Floats
    severity: Floats
    unit: npt.NDArray[np.int64]
    age: Floats

    @property
    def present(self) -> npt.NDArray[np.bool_]:
        return np.asarray(self.severity > _PRESENT)


def score_benchmark(
    folder: str | os.PathLike[str],
    *,
    seed: int = 0,
    progress: Callable[[float], object] | None = None,
) -> list[Score]:
    """Train a random forest on each actuator's training units and score it on the others.

    The forests see the features alone (those that at least nine of ten training runs have; what is
    missing is the median of the training runs). Nothing is tuned. ``scores.json`` is written into
    the folder.

    Parameters
    ----------
    folder : path
        As `make_benchmark` made it.
    seed : int
        Of the forests and the resampled units.
    progress : callable, optional
        Called with the done fraction.

    Raises
    ------
    InputError
        No benchmark set.
    """
    root = Path(folder).expanduser()
    if not (root / BENCHMARK).is_file():
        raise InputError(f"{root}: is not a benchmark set (no {BENCHMARK})")
    scores: list[Score] = []
    for place, name in enumerate(ACTUATORS):
        scores += _scored(root, name, seed)
        if progress is not None:
            progress((place + 1) / len(ACTUATORS))
    rows = [vars(score) for score in scores]
    about = json.loads(read_regular(root / BENCHMARK, 2**24))
    content = {"version": about["version"], "seed": seed, "trees": _TREES, "scores": rows}
    write_text(root / SCORES, json.dumps(content, indent=1) + "\n", force=True)
    return scores


def _scored(root: Path, name: str, seed: int) -> Iterator[Score]:
    faults, ends, parts = _read(root / name)
    parts["shifted"] = _read(root / f"{name}-shifted", faults, ends)[2]["shifted"]
    train = parts["train"]
    able = np.isfinite(train.features).mean(axis=0) >= 0.9
    middle = np.nanmedian(train.features[:, able], axis=0)
    generator = np.random.default_rng(seed)
    models = _models(train, able, middle, seed, generator)
    typical = train.severity.mean(axis=0)
    for part in ("validation", "test", "shifted"):
        data = parts[part]
        inputs = _filled(data.features[:, able], middle)
        chance, null = (_chances(model, inputs) for model in models[:2])
        guess = np.asarray(models[2].predict(inputs)).reshape(len(inputs), -1)
        for k, fault in enumerate(faults):
            draws = _resampled(data.unit, generator)
            present, truth = data.present[:, k], data.severity[:, k]
            ranked = (present, chance[:, k])
            missed = ((guess[:, k] - truth) ** 2, (typical[k] - truth) ** 2)
            yield Score(
                name,
                part,
                fault,
                len(truth),
                int(present.sum()),
                _auc(*ranked),
                _interval(_auc, ranked, draws),
                _auc(present, null[:, k]),
                _auc(present, data.age),
                _ratio(*missed),
                _interval(_ratio, missed, draws),
            )


def _read(
    folder: Path, faults: list[str] | None = None, ends: Floats | None = None
) -> tuple[list[str], Floats, dict[str, _Part]]:
    """Return the faults, their severities at the end of life, and the parts of one campaign."""
    from elevon.campaign import load_campaign

    ds = load_campaign(folder)
    runs, features = ds.runs.to_arrow(), ds.features.to_arrow()
    faults = faults or [fault["name"] for fault in ds.manifest.faults]
    severity = np.column_stack([runs[name].to_numpy() for name in faults])
    ends = severity.max(axis=0) if ends is None else ends
    names = [name for name in features.column_names if name != "run"]
    values = np.column_stack([features[name].to_numpy() for name in names])
    split, unit = np.array(runs["split"].to_pylist()), runs["unit"].to_numpy()
    age = runs["age"].to_numpy()
    ended = np.isin(runs["status"].to_pylist(), ["ok", "tripped"])
    parts = {}
    for part in dict.fromkeys(split.tolist()):
        rows = (split == part) & ended
        parts[part] = _Part(values[rows], severity[rows] / ends, unit[rows], age[rows])
    return faults, ends, parts


def _models(
    train: _Part, able: Any, middle: Floats, seed: int, generator: np.random.Generator
) -> list[Any]:
    """Return the classifier, one trained on labels dealt at random, and the regressor."""
    from sklearn.ensemble import RandomForestClassifier, RandomForestRegressor

    inputs = _filled(train.features[:, able], middle)
    dealt = generator.permutation(len(inputs))
    options = {"n_estimators": _TREES, "random_state": seed, "min_samples_leaf": 2}
    return [
        RandomForestClassifier(**options).fit(inputs, train.present),
        RandomForestClassifier(**options).fit(inputs, train.present[dealt]),
        RandomForestRegressor(**options).fit(inputs, train.severity),
    ]


def _filled(values: Floats, middle: Floats) -> Floats:
    return np.where(np.isfinite(values), values, middle)


def _chances(model: Any, inputs: Floats) -> Floats:
    """Return the probability of each fault, shape (runs, faults)."""
    columns = []
    for chance, classes in zip(model.predict_proba(inputs), model.classes_, strict=True):
        columns.append(chance[:, 1] if len(classes) == 2 else np.full(len(inputs), classes[0]))
    return np.column_stack(columns).astype(np.float64)


def _auc(present: Any, chance: Any) -> float | None:
    """Return the area under the receiver's curve: the chance that a faulty run ranks higher."""
    from scipy.stats import rankdata

    count = int(present.sum())
    if count in {0, len(present)}:
        return None
    ranks = rankdata(chance)[present].sum()
    return float((ranks - 0.5 * count * (count + 1)) / (count * (len(present) - count)))


def _ratio(missed: Any, typical: Any) -> float | None:
    scale = float(np.mean(typical))
    return float(np.sqrt(np.mean(missed) / scale)) if scale > 0.0 else None


def _resampled(unit: npt.NDArray[np.int64], generator: np.random.Generator) -> list[Any]:
    """Return rows of units drawn with replacement: runs of one unit are not independent."""
    units = np.unique(unit)
    rows = {number: np.flatnonzero(unit == number) for number in units}
    return [
        np.concatenate([rows[u] for u in generator.choice(units, len(units))])
        for _ in range(_RESAMPLES)
    ]


def _interval(
    measure: Callable[[Any, Any], float | None], pair: tuple[Any, Any], draws: list[Any]
) -> list[float] | None:
    values = [measure(pair[0][rows], pair[1][rows]) for rows in draws]
    known = [value for value in values if value is not None]
    if len(known) < 0.5 * len(draws):
        return None
    low, high = np.quantile(known, [0.025, 0.975])
    return [float(low), float(high)]
