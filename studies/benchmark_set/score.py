"""Baseline scores on the benchmark set: what `elevon learn` makes of the runs."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.campaign import load_campaign
from elevon.diagnose.learning.examples import Examples, examples_of_dataset, pole_pairs_of
from elevon.diagnose.learning.fit import learned_classes
from elevon.diagnose.learning.model import LearnedClasses
from elevon.diagnose.learning.motion import KnownMotion
from elevon.errors import InputError
from elevon.files import read_regular, write_text
from elevon.report import Check, verdict
from studies.benchmark_set.make import ACTUATORS, BENCHMARK

SCORES = "scores.json"

#: A fault counts as present from this part of its severity at the end of life on.
_PRESENT = 0.2
_RESAMPLES = 200


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
        The same area of what was learnt of labels dealt at random, and of the age alone:
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
class BenchmarkScores:
    """All scores, and how many runs failed."""

    scores: tuple[Score, ...]
    failed: int

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        checks = [Check("runs that failed", float(self.failed), 0.0, "")]
        return {**verdict(checks), "rows": [vars(score) for score in self.scores]}


@dataclass(frozen=True)
class _Part:
    """Runs of one part: their numbers, severities over the largest, and ages."""

    examples: Examples
    age: Floats


def score_benchmark(
    folder: str | os.PathLike[str],
    *,
    seed: int = 0,
    progress: Callable[[float], object] | None = None,
) -> list[Score]:
    """Learn from each actuator's training units and score what was learnt on the others.

    It sees the numbers of the logs alone, without baselines. ``scores.json`` is written into the
    folder.

    Parameters
    ----------
    folder : path
        As `make_benchmark` made it.
    seed : int
        Of boosting and of the resampled units.
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
    content = {"version": about["version"], "seed": seed, "scores": rows}
    write_text(root / SCORES, json.dumps(content, indent=1) + "\n", force=True)
    return scores


def _scored(root: Path, name: str, seed: int) -> Iterator[Score]:
    parts, motion, ends = _read(root / name)
    other, _, _ = _read(root / f"{name}-shifted", parts["train"].examples, ends)
    parts["shifted"] = other["shifted"]
    train = parts["train"].examples
    generator = np.random.default_rng(seed)
    dealt = generator.permutation(len(train.values))
    shuffled = replace(train, present=train.present[dealt], severity=train.severity[dealt])
    learned, null = (learned_classes(e, motion, seed=seed)[0] for e in (train, shuffled))
    typical = train.severity.mean(axis=0)
    for part in ("validation", "test", "shifted"):
        examples, age = parts[part].examples, parts[part].age
        chance, guess = _answers(learned, examples.values)
        at_random, _ = _answers(null, examples.values)
        for k, fault in enumerate(examples.kinds):
            draws = _resampled(examples.unit, generator)
            present, truth = examples.present[:, k], examples.severity[:, k]
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
                _auc(present, at_random[:, k]),
                _auc(present, age),
                _ratio(*missed),
                _interval(_ratio, missed, draws),
            )


def _answers(learned: LearnedClasses, values: Floats) -> tuple[Floats, Floats]:
    """Return the probability of each fault and its expected severity, shape (runs, faults)."""
    says = [learned.says(row[None]) for row in values]
    chance = np.array([[o.probability[kind] for kind in learned.kinds] for o in says])
    size = np.array([[o.severity.get(kind, (0.0,))[0] for kind in learned.kinds] for o in says])
    return chance, chance * size


def _read(
    folder: Path, like: Examples | None = None, ends: Floats | None = None
) -> tuple[dict[str, _Part], KnownMotion, Floats]:
    """Return the parts of one campaign, its motion, and the severities at the end of life."""
    ds = load_campaign(folder)
    examples, motion, _, numbers = examples_of_dataset(ds, pole_pairs_of(ds))
    ends = examples.severity.max(axis=0) if ends is None else ends
    share = examples.severity / ends
    examples = replace(
        examples, present=share > _PRESENT, severity=np.where(share > 0.0, share, 0.0)
    )
    if like is not None:
        at = [examples.names.index(name) for name in like.names]
        examples = replace(examples, names=like.names, values=examples.values[:, at])
    table = ds.runs.to_pandas().set_index("run").loc[numbers]
    split, age = np.array(table["split"].tolist()), table["age"].to_numpy(dtype=np.float64)
    rows = {part: np.flatnonzero(split == part) for part in dict.fromkeys(split.tolist())}
    return {p: _Part(examples.take(r), age[r]) for p, r in rows.items()}, motion, ends


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


def _resampled(unit: npt.NDArray[np.generic], generator: np.random.Generator) -> list[Any]:
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
