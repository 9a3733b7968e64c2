"""Classes of labelled logs: what a file holds, and what it says of a log. NumPy is all it needs."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.engine.spread import needed
from elevon.diagnose.learning.archive import read_archive, write_archive
from elevon.diagnose.learning.discriminant import Discriminant
from elevon.diagnose.learning.motion import LoggedMotion
from elevon.diagnose.learning.trees import Trees
from elevon.errors import FormatError, InputError

KIND = "classes"
HEALTHY = "healthy"
_FIELDS = {f.name for f in fields(Discriminant)} - {"classes"}


@dataclass(frozen=True)
class ClassOpinion:
    """What classes say of logs of one unit.

    Attributes
    ----------
    probability : dict of str to float
        Of each class.
    chance : float
        How often a healthy log looks as faulty as the most faulty of them.
    unlike : float
        How often a learnt log, its unit held out, is as far from every class as the furthest.
    """

    probability: dict[str, float]
    chance: float
    unlike: float


@dataclass(frozen=True)
class LearnedClasses:
    """A classifier of the logs of one motion.

    Attributes
    ----------
    features : tuple of str
        Numbers of a log that count.
    discriminant : Discriminant
        Means and scatter of the classes.
    trees : Trees or None
        What gives the probabilities, where boosting judged unseen groups better.
    temperature : float
        That the scores are divided by.
    healthy : ndarray, shape (h,)
        Logits of any fault of healthy logs, their group held out.
    distances : ndarray, shape (n,)
        Of all logs to the nearest class, their group held out.
    command : ndarray, shape (200,)
        Of the motion, as `LoggedMotion` has it.
    pace, seconds : float
        Of it.
    pole_pairs : float or None
        That the numbers were computed with.
    report : mapping
        Counts, and what groups that were left out proved.
    """

    features: tuple[str, ...]
    discriminant: Discriminant
    trees: Trees | None
    temperature: float
    healthy: Floats
    distances: Floats
    command: Floats
    pace: float
    seconds: float
    pole_pairs: float | None
    report: Mapping[str, Any]

    @property
    def classes(self) -> tuple[str, ...]:
        """Names, as labelled."""
        return self.discriminant.classes

    def values(self, motions: Sequence[LoggedMotion]) -> Floats:
        """Return the numbers of logs, shape (n, k).

        Raises
        ------
        InputError
            A log of another motion, or one that lacks a number.
        """
        for item in motions:
            if text := item.apart(self.command, self.pace, self.seconds):
                raise InputError(f"{item.name} is not of the motion that was learnt: {text}")
            lost = [name for name in self.features if name not in item.values]
            if lost:
                raise InputError(
                    f"{item.name} lacks what was learnt: {', '.join(lost[:3])}"
                    + (f" and {len(lost) - 3} more" if len(lost) > 3 else "")
                )
        return np.array([[item.values[name] for name in self.features] for item in motions])

    def says(self, motions: Sequence[LoggedMotion]) -> ClassOpinion:
        """Return what it says of logs of one unit in one condition, taken as independent."""
        values = self.values(motions)
        scores = scores_of(self.discriminant, self.trees, values) / self.temperature
        logs = scores - np.logaddexp.reduce(scores, axis=1)[:, None]
        total = logs.sum(axis=0)
        share = np.exp(total - np.logaddexp.reduce(total))
        fault = float(faulty_logit(scores, self.classes).max())
        far = float(self.discriminant.distances(values).min(axis=1).max())
        ranks = [
            (1.0 + np.count_nonzero(known >= value)) / (len(known) + 1.0)
            for known, value in ((self.healthy, fault), (self.distances, far))
        ]
        # Of several logs the most faulty one decides, so each has a part of the rate.
        chance, unlike = (min(len(motions) * float(r), 1.0) for r in ranks)
        names = zip(self.classes, share.tolist(), strict=True)
        return ClassOpinion(dict(names), chance, unlike)

    def enough(self, rate: float) -> bool:
        """Whether a conformal threshold reaches a rate of false alarms."""
        return len(self.healthy) >= needed(rate)

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Write arrays and a JSON text; as `elevon.diagnose.learning.archive.write_archive`."""
        stored = {name: np.asarray(getattr(self.discriminant, name)) for name in sorted(_FIELDS)}
        arrays = {f"discriminant.{name}": value for name, value in stored.items()}
        arrays |= {name: getattr(self, name) for name in ("healthy", "distances", "command")}
        if self.trees is not None:
            arrays |= {f"trees.{name}": value for name, value in self.trees.arrays().items()}
        about = {
            "features": list(self.features), "classes": list(self.classes),
            "temperature": self.temperature, "pace": self.pace, "seconds": self.seconds,
            "pole_pairs": self.pole_pairs, "report": dict(self.report),
        }  # fmt: skip
        return write_archive(path, KIND, about, arrays, force=force)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> LearnedClasses:
        """Read what `save` wrote.

        Raises
        ------
        FormatError
            As `elevon.diagnose.learning.archive.read_archive`; something else that was learnt.
        """
        kind, about, arrays = read_archive(path)
        if kind != KIND:
            raise FormatError(f"{path}: holds a {kind}, not classes of logs")
        try:
            return _assembled(about, arrays)
        except (KeyError, TypeError, ValueError) as error:
            raise FormatError(f"{path}: a value is missing or of another kind: {error}") from error


def _assembled(about: Mapping[str, Any], arrays: Mapping[str, npt.NDArray[Any]]) -> LearnedClasses:
    real = {n: np.asarray(a, dtype=np.float64) for n, a in arrays.items()}
    if not all(np.isfinite(a).all() for a in real.values()):
        raise ValueError("an array is not finite")
    stored = {n: real[f"discriminant.{n}"] for n in _FIELDS}
    classes = tuple(str(name) for name in about["classes"])
    count, wide = len(classes), len(about["features"])
    if stored["means"].shape != (count, wide) or stored["precision"].shape != (wide, wide):
        raise ValueError("classes and features are not those of the arrays")
    trees = {n.removeprefix("trees."): a for n, a in arrays.items() if n.startswith("trees.")}
    return LearnedClasses(
        tuple(map(str, about["features"])), _discriminant(classes, stored),
        Trees.stored(trees) if trees else None, float(about["temperature"]),
        real["healthy"], real["distances"], real["command"], float(about["pace"]),
        float(about["seconds"]),
        None if about["pole_pairs"] is None else float(about["pole_pairs"]), about["report"],
    )  # fmt: skip


def _discriminant(classes: tuple[str, ...], stored: Mapping[str, Floats]) -> Discriminant:
    return Discriminant(
        classes, stored["means"], stored["scale"], stored["precision"], stored["low"],
        stored["high"], float(stored["shrinkage"]), float(stored["temperature"]),
    )  # fmt: skip


def scores_of(discriminant: Discriminant, trees: Trees | None, values: Floats) -> Floats:
    """Return the logits of classes but for a constant, shape (n, c)."""
    return -0.5 * discriminant.distances(values) if trees is None else trees.scores(values)


def faulty_logit(scores: Floats, classes: Sequence[str]) -> Floats:
    """Return the logit that a log is of any class but the healthy one, shape (n,)."""
    healthy = np.array([name == HEALTHY for name in classes])
    others = np.logaddexp.reduce(scores[:, ~healthy], axis=1)
    return np.asarray(others - scores[:, healthy][:, 0])
