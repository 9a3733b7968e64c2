"""A trained surrogate: what a file holds, and what it says of features. NumPy is all it needs."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.learning.archive import read_archive, write_archive
from elevon.diagnose.learning.trees import Trees
from elevon.diagnose.surrogate.boosted import Ensemble, Opinion, either, honest
from elevon.diagnose.surrogate.features import NAMES, SurrogateFeatures
from elevon.diagnose.surrogate.pack import packed, unpacked
from elevon.diagnose.surrogate.population import FAULTS
from elevon.diagnose.surrogate.view import VIEWS, View
from elevon.errors import FormatError

KIND = "surrogate"
_TEST = 0.2  # relative difference of travel and speed up to which a log is of a test
_STORED = (
    "scaling", "conformal", "healthy", "fold", "known", "low", "high", "unit_low", "unit_high",
    "named",
)  # fmt: skip


@dataclass(frozen=True)
class LogOpinion:
    """What the surrogate says of one log.

    Attributes
    ----------
    presence : ndarray, shape (f,)
        Calibrated logit of each fault.
    faulty : float
        Calibrated logit of any fault.
    chance : float
        How often a healthy unit looks as faulty.
    size, reach : ndarray, shape (f,)
        Scaled size of each fault were it there, and half its 90 % interval.
    change : ndarray, shape (k,)
        Deviations of features from the healthy unit, in its spread.
    outside : tuple of str
        What lies outside the training set; empty when nothing does.
    """

    presence: Floats
    faulty: float
    chance: float
    size: Floats
    reach: Floats
    change: Floats
    outside: tuple[str, ...]


@dataclass(frozen=True)
class Head:
    """Trees of one test and view, with what held-out units made of them.

    Attributes
    ----------
    view : View
        Features to inputs.
    ensemble : Ensemble
        Inputs to an opinion.
    scaling : ndarray, shape (f + 1, 3)
        What makes the logits honest (`honest`); the last row is for that of any fault.
    conformal : ndarray, shape (f,)
        Errors that hold 90 % of held-out sizes.
    healthy : ndarray, shape (h,)
        Logits of any fault (`either`) of healthy runs, by the members that have not seen them.
    fold : ndarray, shape (h,)
        Number of the member that has not.
    known : ndarray, shape (p, k)
        Changes of training runs, as arsinh.
    low, high : ndarray, shape (k,)
        Ends of what was trained.
    unit_low, unit_high : ndarray, shape (k,)
        Ends between which the trained units lie (`View.context`).
    named : ndarray, shape (f,)
        Least severity from which on 95 % of held-out single faults were named; NaN: none.
    reach : float
        Distance to the nearest training run that one held-out run of two hundred exceeds.
    """

    view: View
    ensemble: Ensemble
    scaling: Floats
    conformal: Floats
    healthy: Floats
    fold: Floats
    known: Floats
    low: Floats
    high: Floats
    unit_low: Floats
    unit_high: Floats
    named: Floats
    reach: float

    def says(self, values: Floats, baselines: Sequence[Floats]) -> LogOpinion:
        """Return what it says of one log's features against those of baselines."""
        row = values[None, :]
        healthy = np.mean(baselines, axis=0)[None, :] if self.view.relative else None
        inputs = self.view.inputs(row, healthy, np.array([float(max(len(baselines), 1))]))
        opinion = self.ensemble.says(inputs)
        change = self.view.change(row, healthy)[0]
        presence = honest(self.scaling[:-1], opinion.presence)[0]
        return LogOpinion(
            presence,
            float(honest(self.scaling[-1:], either(presence)[None])[0]),
            float(self.chances(opinion)[0]),
            opinion.size[0],
            self.conformal,
            change,
            self.outside(change, None if healthy is None else self.view.context(healthy)[0]),
        )

    def chances(self, opinion: Opinion) -> Floats:
        """Return how often a healthy unit looks as faulty, shape (n,).

        Each member is held against the healthy runs that it has not seen, and the ranks are
        counted together (cross-conformal prediction; Vovk, 2015).
        """
        score = either(honest(self.scaling[:-1], opinion.each))
        above = sum(
            len(scores) - np.searchsorted(np.sort(scores), score[k])
            for k, scores in ((k, self.healthy[self.fold == k]) for k in range(len(score)))
        )
        return np.asarray((above + 1.0) / (len(self.healthy) + 1.0))

    def outside(self, change: Floats, context: Floats | None) -> tuple[str, ...]:
        """Say what lies outside the training set: of changes, and of the unit, shape (k,) each."""
        out = [
            f"{name} {x:+.3g} healthy deviations (trained {a:+.3g} to {b:+.3g})"
            for name, x, a, b in zip(NAMES, change, self.low, self.high, strict=True)
            if not a <= x <= b
        ]
        if context is not None:
            rows = zip(NAMES, context, self.unit_low, self.unit_high, strict=True)
            out += [
                f"a unit whose healthy {name} lies {x:+.3g} deviations from the middle of the "
                f"trained units (trained {a:+.3g} to {b:+.3g})"
                for name, x, a, b in rows
                if not a <= x <= b
            ]
        distance = float(self.distances(change[None, :])[0])
        if distance > self.reach:
            out.append(
                f"no training run is like it (nearest at {distance:.2g}, "
                f"held-out runs within {self.reach:.2g})"
            )
        return tuple(out)

    def distances(self, change: Floats) -> Floats:
        """Return the distance of changes, shape (n, k), to the nearest training run."""
        rows = np.arcsinh(change)
        square = (rows**2).sum(axis=1)[:, None] + (self.known**2).sum(axis=1)[None, :]
        return np.asarray(np.sqrt(np.maximum(square - 2.0 * rows @ self.known.T, 0.0).min(axis=1)))


@dataclass(frozen=True)
class TestModel:
    """One test: how it is recognised, and its heads by view."""

    __test__ = False  # not a test, whatever pytest thinks of the name

    braked: bool
    travel: float
    speed: float
    heads: Mapping[str, Head]

    def matches(self, features: SurrogateFeatures) -> bool:
        """Whether a log is of this test: brake, travel and speed alike."""
        near = abs(features.travel / self.travel - 1.0) < _TEST
        return (
            features.braked == self.braked
            and near
            and abs(features.speed / self.speed - 1.0) < _TEST
        )


@dataclass(frozen=True)
class Surrogate:
    """What was trained.

    Attributes
    ----------
    tests : mapping of str to TestModel
        By the bench's procedure.
    report : mapping
        How it was trained and what held-out units proved of it.
    """

    tests: Mapping[str, TestModel]
    report: Mapping[str, object]

    def test_of(self, features: SurrogateFeatures) -> str | None:
        """Return the name of the test a log is of, None for a test that was not trained."""
        return next((name for name, test in self.tests.items() if test.matches(features)), None)

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Write one NumPy archive: arrays, and a JSON text; nothing executable.

        Raises
        ------
        OutputExistsError, OutputError
            As `elevon.diagnose.learning.archive.write_archive`.
        """
        arrays: dict[str, npt.NDArray[Any]] = {}
        trees: dict[str, npt.NDArray[Any]] = {}
        tests: dict[str, Any] = {}
        for name, test in self.tests.items():
            tests[name] = {"braked": test.braked, "travel": test.travel, "speed": test.speed}
            for view, head in test.heads.items():
                key = f"{name}.{view}"
                tests[name][view] = head.reach
                arrays |= {f"{key}.{n}": a for n, a in _arrays(head).items()}
                stored = head.ensemble.trees.arrays()
                trees |= {f"{key}.{n}": a for n, a in stored.items()}
        values, index = packed(arrays)
        about = {
            "names": list(NAMES), "faults": list(FAULTS), "tests": tests, "arrays": index,
            "report": dict(self.report),
        }  # fmt: skip
        return write_archive(path, KIND, about, values | trees, force=force)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Surrogate:
        """Read what `save` wrote.

        Raises
        ------
        FormatError
            The file is absent, damaged, of another version or something else.
        """
        kind, about, data = read_archive(path)
        if kind != KIND:
            raise FormatError(f"{path}: holds {kind}, not a surrogate")
        try:
            return _assembled(about, data)
        except (ValueError, KeyError, TypeError) as error:
            raise FormatError(f"{path}: not a surrogate of this version: {error}") from error


def _assembled(about: Mapping[str, Any], data: Mapping[str, Any]) -> Surrogate:
    if tuple(about["names"]) != NAMES or tuple(about["faults"]) != FAULTS:
        raise ValueError("features or faults of another version; train it anew")
    arrays: dict[str, Any] = {**unpacked(data, about["arrays"])}
    arrays |= {name: a for name, a in data.items() if "." in name}
    tests = {}
    for name, item in about["tests"].items():
        heads = {
            view: _head(arrays, f"{name}.{view}", float(item[view]))
            for view in VIEWS
            if view in item
        }
        tests[name] = TestModel(
            bool(item["braked"]), float(item["travel"]), float(item["speed"]), heads
        )
    return Surrogate(tests, about["report"])


def _arrays(head: Head) -> dict[str, npt.NDArray[Any]]:
    """Return what a file holds of a head; a severity that is never named is stored as -1."""
    out = {n: a.astype(np.float32) for n, a in head.view.arrays().items()}
    out |= {n: getattr(head, n).astype(np.float32) for n in _STORED}
    out["named"] = np.nan_to_num(head.named, nan=-1.0).astype(np.float32)
    out["known"] = head.known.astype(np.float16)
    out["fold"] = head.fold.astype(np.float16)
    return out | {"start": head.ensemble.start.astype(np.float32)}


def _head(data: Mapping[str, Any], key: str, reach: float) -> Head:
    arrays = {n.removeprefix(f"{key}."): a for n, a in data.items() if n.startswith(f"{key}.")}
    view = View.build(key.endswith("relative"), arrays)
    stored = {n: arrays[n] for n in _STORED}
    stored["named"] = np.where(arrays["named"] < 0.0, np.nan, arrays["named"])
    ensemble = Ensemble(Trees.stored(arrays), arrays["start"])
    return Head(view=view, ensemble=ensemble, reach=reach, **stored)


@lru_cache(maxsize=1)
def shipped() -> Surrogate:
    """Return the surrogate that comes with the package."""
    return Surrogate.load(Path(__file__).with_name("rotary.npz"))
