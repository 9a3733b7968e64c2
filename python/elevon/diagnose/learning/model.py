"""What `elevon learn` makes, its file, and what it says of a log. NumPy is all that it needs."""

from __future__ import annotations

import io
import json
import math
import os
import tokenize
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Bools, Floats
from elevon.diagnose.engine.spread import LearnedSpread, needed
from elevon.diagnose.learning.discriminant import Discriminant
from elevon.diagnose.learning.labels import HEALTHY
from elevon.diagnose.learning.motion import KnownMotion, LoggedMotion
from elevon.diagnose.learning.trees import Trees
from elevon.errors import FormatError, InputError
from elevon.files import write_bytes

ABSOLUTE, RELATIVE = "absolute", "relative"
_FORMAT, _VERSION = "elevon-learned", 2
_MOST_BYTES = 200_000_000
#: What a damaged archive raises, its members' headers included: they are Python literals.
_DAMAGED = (
    OSError, ValueError, KeyError, TypeError, EOFError, RuntimeError, MemoryError, SyntaxError,
    AttributeError, IndexError, OverflowError, tokenize.TokenError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
Arrays = dict[str, npt.NDArray[Any]]


@dataclass(frozen=True)
class Severities:
    """Trees that say how large each kind is, were it there.

    A size is the root of the share of a severity in the largest learnt one, with its sign.

    Attributes
    ----------
    trees : Trees
        A column for each kind.
    start : ndarray, shape (f,)
        Size that the trees are added to.
    low, high : ndarray, shape (f,)
        Ends of the learnt severities, SI; both zero where a kind's severity was not learnt.
    reach : ndarray, shape (f,)
        Errors of sizes that hold 90 % of those of units that were left out.
    """

    trees: Trees
    start: Floats
    low: Floats
    high: Floats
    reach: Floats

    @property
    def known(self) -> Bools:
        """Of which kinds the severity was learnt."""
        return np.asarray((self.low != 0.0) | (self.high != 0.0))

    def sizes(self, values: Floats) -> Floats:
        """Return the size of each kind, rows of shape (n, k) to (n, f)."""
        return np.asarray(self.start + self.trees.scores(values))

    def severity(self, size: Floats) -> Floats:
        """Return the severity of sizes, SI, within what was learnt; NaN where it was not."""
        inside = np.sign(size) * np.minimum(size**2, 1.0)
        value = inside * np.maximum(np.abs(self.low), np.abs(self.high))
        return np.where(self.known, np.clip(value, self.low, self.high), math.nan)


@dataclass(frozen=True)
class ClassOpinion:
    """What is said of logs of one unit.

    Attributes
    ----------
    probability : dict of str to float
        Of each kind.
    p_fault : float
        That there is any.
    chance : float
        How often a healthy log, its unit left out, looks as faulty as the most faulty of them.
    unlike : float
        How often a learnt log, its unit left out, is as far from every class as the furthest.
    severity : dict of str to (float, float, float)
        SI, were the kind there: middle and 90 % interval; of kinds whose severity was learnt.
    """

    probability: dict[str, float]
    p_fault: float
    chance: float
    unlike: float
    severity: dict[str, tuple[float, float, float]]


@dataclass(frozen=True)
class ClassView:
    """A classifier of numbers as they are, or of their changes against a healthy unit.

    Attributes
    ----------
    discriminant : Discriminant
        Means and scatter of what logs have, each combination of kinds a class.
    trees : Trees or None
        What gives the probabilities, where boosting judged unseen groups better.
    temperature : float
        That the scores are divided by.
    healthy : ndarray, shape (h,)
        Logits of any fault of healthy logs, their group left out.
    distances : ndarray, shape (n,)
        Of all logs to the nearest class, their group left out.
    named : ndarray, shape (f,)
        Least severity from which on 95 % of single faults were named by other units; NaN: none.
    severities : Severities or None
        Where severities were given.
    """

    discriminant: Discriminant
    trees: Trees | None
    temperature: float
    healthy: Floats
    distances: Floats
    named: Floats
    severities: Severities | None

    def scores(self, values: Floats, *, exclusive: bool) -> Floats:
        """Return `raw_scores` over the temperature."""
        return raw_scores(self.discriminant, self.trees, values, exclusive) / self.temperature


@dataclass(frozen=True)
class LearnedClasses:
    """A classifier of the logs of one motion.

    Attributes
    ----------
    features : tuple of str
        Numbers of a log that count.
    kinds : tuple of str
        Faults and other classes, without ``healthy``.
    severity_units : tuple of str
        SI unit of each kind's severity.
    exclusive : bool
        Whether a log has one kind at most; else each may be there beside the others.
    share : ndarray, shape (f,)
        Of the learnt logs that have each kind.
    motion : KnownMotion
        That was learnt.
    pole_pairs : float or None
        That the numbers were computed with.
    views : mapping of str to ClassView
        ``absolute``, and ``relative`` where units had several healthy logs.
    """

    features: tuple[str, ...]
    kinds: tuple[str, ...]
    severity_units: tuple[str, ...]
    exclusive: bool
    share: Floats
    motion: KnownMotion
    pole_pairs: float | None
    views: Mapping[str, ClassView]

    def view(self, baselines: Sequence[object]) -> ClassView:
        """Return the classifier that serves with such baselines.

        Raises
        ------
        InputError
            Baselines, but units with several healthy logs were not learnt.
        """
        if baselines and RELATIVE not in self.views:
            raise InputError(
                "--baseline: the model was not learnt from units with several healthy logs each; "
                "leave the baselines out"
            )
        return self.views[RELATIVE if baselines else ABSOLUTE]

    def values(
        self, motions: Sequence[LoggedMotion], baselines: Sequence[LoggedMotion] = ()
    ) -> Floats:
        """Return the numbers of logs, less the mean of the baselines', shape (n, k).

        Raises
        ------
        InputError
            A log of another motion, or one that lacks a number.
        """
        for item in (*motions, *baselines):
            if text := self.motion.refusal(item):
                raise InputError(f"{item.name} is not of the motion that was learnt: {text}")
            lost = [name for name in self.features if name not in item.values]
            if lost:
                raise InputError(
                    f"{item.name} lacks what was learnt: {', '.join(lost[:3])}"
                    + (f" and {len(lost) - 3} more" if len(lost) > 3 else "")
                )
        rows, healthy = (
            np.array([[item.values[name] for name in self.features] for item in items])
            for items in (motions, baselines)
        )
        return rows - healthy.mean(axis=0) if baselines else rows

    def says(self, values: Floats, *, relative: bool = False) -> ClassOpinion:
        """Return what it says of logs of one unit in one condition, taken as independent.

        Parameters
        ----------
        values : ndarray, shape (n, k)
            As `values` gives them.
        relative : bool
            Whether they are changes against baselines.
        """
        view = self.views[RELATIVE if relative else ABSOLUTE]
        scores = view.scores(values, exclusive=self.exclusive)
        probability, p_fault = self._join_logs(scores, view.discriminant.classes)
        fault = float(fault_logits(scores, view.discriminant.classes, self.exclusive).max())
        far = float(view.discriminant.distances(values).min(axis=1).max())
        ranks = [
            (1.0 + np.count_nonzero(known >= value)) / (len(known) + 1.0)
            for known, value in ((view.healthy, fault), (view.distances, far))
        ]
        # Of several logs the most faulty one decides, so each has a part of the rate.
        chance, unlike = (min(len(values) * float(rank), 1.0) for rank in ranks)
        return ClassOpinion(
            probability, p_fault, chance, unlike, self._join_severities(view, values)
        )

    def _join_logs(self, scores: Floats, classes: Sequence[str]) -> tuple[dict[str, float], float]:
        """Return the probability of each kind and of any, by all logs together."""
        if self.exclusive:
            total = (scores - np.logaddexp.reduce(scores, axis=1)[:, None]).sum(axis=0)
            shares = np.exp(total - np.logaddexp.reduce(total))
            every = dict(zip(classes, shares.tolist(), strict=True))
            return {kind: every[kind] for kind in self.kinds}, 1.0 - every[HEALTHY]
        prior = np.log(self.share / (1.0 - self.share))
        logits = scores.sum(axis=0) - (len(scores) - 1) * prior
        there = 1.0 / (1.0 + np.exp(-logits))
        p_fault = 1.0 - float(np.prod(1.0 - there))
        return dict(zip(self.kinds, there.tolist(), strict=True)), p_fault

    def _join_severities(
        self, view: ClassView, values: Floats
    ) -> dict[str, tuple[float, float, float]]:
        """Return severities by the mean size of the logs."""
        if view.severities is None:
            return {}
        size = view.severities.sizes(values).mean(axis=0)
        reach = view.severities.reach / math.sqrt(len(values))
        rows = [view.severities.severity(size + k * reach) for k in (0.0, -1.0, 1.0)]
        known = zip(self.kinds, np.array(rows).T.tolist(), strict=True)
        return {kind: (m, low, high) for kind, (m, low, high) in known if math.isfinite(m)}


@dataclass(frozen=True)
class LearnedModel:
    """What was learnt: the spread of healthy days, classes, or both.

    Attributes
    ----------
    spread : LearnedSpread or None
        How healthy days differ, and the model from the machine.
    classes : LearnedClasses or None
        What logs of each kind look like.
    report : mapping
        Counts, and what groups that were left out proved.
    """

    spread: LearnedSpread | None = None
    classes: LearnedClasses | None = None
    report: Mapping[str, Any] = field(default_factory=dict)

    @property
    def holds(self) -> list[str]:
        """Which of ``spread``, ``classes`` and ``severities`` it has."""
        sized = self.classes is not None and any(
            view.severities is not None for view in self.classes.views.values()
        )
        there = {"spread": self.spread, "classes": self.classes, "severities": sized or None}
        return [name for name, part in there.items() if part is not None]

    def to_dict(self) -> dict[str, Any]:
        """Return what it holds and the report."""
        return {"holds": self.holds, **self.report}

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Write one NumPy archive of arrays and a JSON text; nothing in it is executable.

        Raises
        ------
        OutputExistsError, OutputError
            As `elevon.files.write_bytes`.
        """
        about: dict[str, Any] = {"format": _FORMAT, "version": _VERSION, "report": {**self.report}}
        arrays: Arrays = {}
        if self.spread is not None:
            about["spread"] = self.spread.to_dict()
        if self.classes is not None:
            about["classes"], arrays = _classes_to_archive(self.classes)
        arrays["about"] = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
        stream = io.BytesIO()
        np.savez_compressed(stream, **arrays)  # type: ignore[arg-type]
        return write_bytes(path, stream.getvalue(), force=force)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> LearnedModel:
        """Read what `save` wrote.

        Raises
        ------
        FormatError
            The file is absent, damaged, of another version or something else.
        """
        try:
            about, arrays = _read_archive(Path(path))
            spread, classes = about.get("spread"), about.get("classes")
            return cls(
                None if spread is None else LearnedSpread.from_dict(spread),
                None if classes is None else _read_classes(classes, arrays),
                dict(about["report"]),
            )
        except _DAMAGED as error:
            raise FormatError(f"{path}: is no model of elevon learn: {error}") from error


def _read_archive(path: Path) -> tuple[dict[str, Any], Arrays]:
    if not path.is_file():
        raise ValueError("is no regular file")
    with zipfile.ZipFile(path) as archive:
        if sum(item.file_size for item in archive.infolist()) > _MOST_BYTES:
            raise ValueError(f"more than {_MOST_BYTES} bytes")
    with np.load(path, allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored.files}
    about = json.loads(bytes(arrays.pop("about")))
    if about.get("format") != _FORMAT:
        raise ValueError(f"format {about.get('format')!r}")
    if about.get("version") != _VERSION:
        raise ValueError(f"version {about.get('version')!r} of its form, not {_VERSION}: learn it "
                         "again")  # fmt: skip
    if not all(np.isfinite(values).all() for values in arrays.values()):
        raise ValueError("an array is not finite")
    return about, arrays


_OF_DISCRIMINANT = sorted({f.name for f in fields(Discriminant)} - {"classes"})
_OF_VIEW = ("healthy", "distances")
_OF_SEVERITIES = ("start", "low", "high", "reach")
_OF_MOTION = ("pace", "seconds", "off", "faster", "longer")


def _classes_to_archive(classes: LearnedClasses) -> tuple[dict[str, Any], Arrays]:
    """Return the JSON part and the arrays of a classifier."""
    arrays: Arrays = {"command": classes.motion.command, "share": classes.share}
    for name, view in classes.views.items():
        members: Arrays = {
            f"discriminant.{n}": np.asarray(getattr(view.discriminant, n)) for n in _OF_DISCRIMINANT
        }
        members |= {n: getattr(view, n) for n in _OF_VIEW}
        members["named"] = np.nan_to_num(view.named, nan=-1.0)
        if view.trees is not None:
            members |= {f"trees.{n}": a for n, a in view.trees.arrays().items()}
        if view.severities is not None:
            members |= {f"severities.{n}": getattr(view.severities, n) for n in _OF_SEVERITIES}
            stored = view.severities.trees.arrays()
            members |= {f"severities.trees.{n}": a for n, a in stored.items()}
        arrays |= {f"{name}.{n}": a for n, a in members.items()}
    about = {
        "features": list(classes.features), "kinds": list(classes.kinds),
        "severity_units": list(classes.severity_units), "exclusive": classes.exclusive,
        "pole_pairs": classes.pole_pairs,
        "motion": {n: getattr(classes.motion, n) for n in _OF_MOTION},
        "views": {
            name: {"classes": list(view.discriminant.classes), "temperature": view.temperature}
            for name, view in classes.views.items()
        },
    }  # fmt: skip
    return about, arrays


def _read_classes(about: Mapping[str, Any], arrays: Arrays) -> LearnedClasses:
    features, kinds, units = (
        tuple(map(str, about[name])) for name in ("features", "kinds", "severity_units")
    )
    share = np.asarray(arrays["share"], dtype=np.float64)
    command = np.asarray(arrays["command"], dtype=np.float64)
    if len(units) != len(kinds) or share.shape != (len(kinds),) or np.ptp(command) <= 0.0:
        raise ValueError("the kinds are not those of the arrays")
    motion = KnownMotion(command, *(float(about["motion"][n]) for n in _OF_MOTION))
    pole_pairs = None if about["pole_pairs"] is None else float(about["pole_pairs"])
    exclusive = bool(about["exclusive"])
    views = {}
    for name, entry in about["views"].items():
        head = f"{name}."
        members = {n.removeprefix(head): a for n, a in arrays.items() if n.startswith(head)}
        views[name] = _read_view(entry, members, len(features), len(kinds))
        _check_columns(views[name], exclusive, len(kinds))
    if ABSOLUTE not in views or not views.keys() <= {ABSOLUTE, RELATIVE}:
        raise ValueError(f"views {sorted(views)}")
    return LearnedClasses(features, kinds, units, exclusive, share, motion, pole_pairs, views)


def _read_view(about: Mapping[str, Any], members: Arrays, features: int, kinds: int) -> ClassView:
    real = {n: np.asarray(a, dtype=np.float64) for n, a in members.items()}
    stored = {n: real[f"discriminant.{n}"] for n in _OF_DISCRIMINANT}
    classes = tuple(str(name) for name in about["classes"])
    shapes = {
        "means": (len(classes), features), "precision": (features, features), "scale": (features,),
        "low": (features,), "high": (features,),
    }  # fmt: skip
    wrong = [n for n, shape in shapes.items() if stored[n].shape != shape]
    if wrong or HEALTHY not in classes or real["named"].shape != (kinds,):
        raise ValueError("classes and features are not those of the arrays")
    discriminant = Discriminant(
        classes, stored["means"], stored["scale"], stored["precision"], stored["low"],
        stored["high"],
        float(stored["shrinkage"]), float(stored["temperature"]),
    )  # fmt: skip
    severities = None
    if "severities.start" in members:
        parts = [real[f"severities.{n}"] for n in _OF_SEVERITIES]
        if any(part.shape != (kinds,) for part in parts):
            raise ValueError("severities are not those of the kinds")
        severities = Severities(_read_trees(members, "severities.trees.", features), *parts)
    return ClassView(
        discriminant,
        _read_trees(members, "trees.", features) if "trees.roots" in members else None,
        float(about["temperature"]), real["healthy"], real["distances"],
        np.where(real["named"] < 0.0, math.nan, real["named"]), severities,
    )  # fmt: skip


def _read_trees(members: Arrays, head: str, features: int) -> Trees:
    trees = Trees.stored(
        {n.removeprefix(head): a for n, a in members.items() if n.startswith(head)}
    )
    if trees.feature.max() >= features:
        raise ValueError("a tree asks for a number that is none")
    return trees


def _check_columns(view: ClassView, exclusive: bool, kinds: int) -> None:
    """Refuse trees whose columns are not the classes or the kinds."""
    classes = len(view.discriminant.classes)
    columns = (1 if classes == 2 else classes) if exclusive else kinds
    sized = None if view.severities is None else view.severities.trees
    for trees, wanted in ((view.trees, columns), (sized, kinds)):
        if trees is not None and (trees.roots.ndim != 2 or trees.roots.shape[1] != wanted):
            raise ValueError("the columns of the trees are not those of the classes")
    if not exclusive and view.trees is None:
        raise ValueError("there are no trees")


def raw_scores(
    discriminant: Discriminant, trees: Trees | None, values: Floats, exclusive: bool
) -> Floats:
    """Return the scores of logs, shape (n, c).

    Exclusive: logits of classes but for a constant, in the order of the discriminant. Else the
    logit of each kind.
    """
    if trees is None:
        return np.asarray(-0.5 * discriminant.distances(values))
    total = trees.scores(values)
    if exclusive and total.shape[1] == 1:  # of two classes the first has nought
        return np.hstack((np.zeros_like(total), total))
    return total


def fault_logits(scores: Floats, classes: Sequence[str], exclusive: bool) -> Floats:
    """Return the logit that a log has any fault, shape (n,), of `raw_scores`."""
    if exclusive:
        healthy = np.array([name == HEALTHY for name in classes])
        others = np.logaddexp.reduce(scores[:, ~healthy], axis=1)
        return np.asarray(others - scores[:, healthy][:, 0])
    none = np.logaddexp(0.0, scores).sum(axis=-1)  # -log of the product of all absences
    return np.asarray(none + np.log(-np.expm1(-none)))


def enough(view: ClassView, rate: float) -> bool:
    """Return whether a conformal threshold reaches a rate of false alarms."""
    return len(view.healthy) >= needed(rate)
