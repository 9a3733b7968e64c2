"""Healthy or not: false alarms on healthy recordings left out, detections by fault stage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import stdtr

from elevon.arrays import Floats
from elevon.diagnose.learning.discriminant import Discriminant
from elevon.diagnose.learning.fit import share_interval
from elevon.errors import InputError, RangeError, did_you_mean
from elevon_cases.cranfield.data import CONDITIONS, TRANSFER, CranfieldData

DETECTION = (*TRANSFER, "current_assisted", "current_opposed")
FALSE_ALARM = 0.05
UNSEEN = tuple(f"spalling{stage}" for stage in range(1, 6))
"""Stages that the published detection does not see in this motion."""


@dataclass(frozen=True, slots=True)
class Detection:
    """How often one condition was called faulty.

    Attributes
    ----------
    condition : str
        ``normal``: each recording against the other healthy ones.
    hits, count : int
        Recordings called faulty, and all of them.
    hits_sessions : int or None
        The same when a difference between two sessions is allowed for.
    """

    condition: str
    hits: int
    count: int
    hits_sessions: int | None

    def to_dict(self) -> dict[str, Any]:
        """Return the row with its exact 95 % interval."""
        seen = self.hits_sessions
        return {
            "condition": self.condition, "rate": self.hits / self.count,
            "interval": list(share_interval(self.hits, self.count)), "recordings": self.count,
            "rate_between_sessions": None if seen is None else seen / self.count,
        }  # fmt: skip


def detect(data: CranfieldData, *, false_alarm: float = FALSE_ALARM) -> list[Detection]:
    """Hold every recording against the healthy ones at its load, itself left out.

    Parameters
    ----------
    data : CranfieldData
        All recordings.
    false_alarm : float
        Share of healthy recordings that may be called faulty.

    Returns
    -------
    list of Detection
        One for each condition that has recordings at a load with two healthy ones.
    """
    x, healthy = data.table.select(DETECTION), data.condition == "normal"
    rows: dict[str, list[tuple[bool, bool | None]]] = {}
    for index in range(len(x)):
        others = healthy.copy()
        others[index] = False
        here = others & (data.load == data.load[index])
        if here.sum() < 2:
            continue
        baseline = HealthyBaseline.fit(DETECTION, x[others], data.load[others])
        p = float(baseline.p_values(x[index], data.load[index])[0])
        sessions = _session_p(data, x, baseline, index)
        condition = str(data.condition[index])
        rows.setdefault(condition, []).append(
            (p < false_alarm, None if sessions is None else sessions < false_alarm)
        )
    return [_row(name, rows[name]) for name in CONDITIONS if name in rows]


def _row(condition: str, answers: list[tuple[bool, bool | None]]) -> Detection:
    sessions = [seen for _, seen in answers]
    known = None if None in sessions else sum(bool(seen) for seen in sessions)
    return Detection(condition, sum(hit for hit, _ in answers), len(answers), known)


def _session_p(
    data: CranfieldData, x: Floats, baseline: HealthyBaseline, index: int
) -> float | None:
    """Return the probability of a deviation when sessions differ as the unseen stages do.

    The scatter of their means, the stage in question left out, stands for the scatter between
    sessions. It holds what these faults do as well, so it errs towards seeing too little.
    """
    names = [name for name in UNSEEN if name != data.condition[index]]
    squares = []
    for load in np.unique(data.load):
        cells = [(data.condition == name) & (data.load == load) for name in names]
        means = [x[cell].mean(axis=0) for cell in cells if cell.any()]
        if len(means) < 3:
            return None
        squares.append(np.var(means, axis=0, ddof=1))
    at = int(np.flatnonzero(baseline.loads == data.load[index])[0])
    variance = baseline.spread**2 * (1.0 + 1.0 / baseline.counts[at])
    # Twice: the baseline is one session, the tested recording another.
    width = np.sqrt(variance + 2.0 * np.mean(squares, axis=0))
    largest = float(np.abs((x[index] - baseline.means[at]) / width).max())
    single = min(2.0 * float(stdtr(len(names) - 1, -largest)), 1.0 - 1e-15)
    return float(-np.expm1(len(DETECTION) * np.log1p(-single)))


@dataclass(frozen=True, slots=True)
class HealthyBaseline:
    """Mean at each load, and one scatter for all loads.

    Attributes
    ----------
    names : tuple of str
        Features.
    loads : array, (loads,)
        Loads with healthy recordings [N].
    means : array, (loads, features)
        Healthy means.
    counts : array, (loads,)
        Healthy recordings of each load.
    spread : array, (features,)
        Deviation from recording to recording about the load's mean.
    freedom : int
        Degrees of freedom of `spread`.
    """

    names: tuple[str, ...]
    loads: Floats
    means: Floats
    counts: npt.NDArray[np.int64]
    spread: Floats
    freedom: int

    @classmethod
    def fit(
        cls, names: tuple[str, ...], values: npt.ArrayLike, load: npt.ArrayLike
    ) -> HealthyBaseline:
        """Fit means and scatter to healthy recordings.

        Parameters
        ----------
        names : tuple of str
            Features, the columns of `values`.
        values : array, (recordings, features)
            Of healthy recordings only.
        load : array, (recordings,)
            Load of each [N].

        Raises
        ------
        InputError
            No load has two recordings: there is no scatter.
        """
        x, at = np.atleast_2d(np.asarray(values, dtype=np.float64)), np.asarray(load, np.float64)
        loads, index, counts = np.unique(at, return_inverse=True, return_counts=True)
        freedom = len(x) - len(loads)
        if freedom < 1:
            raise InputError(
                f"healthy baseline: {len(x)} recordings at {len(loads)} loads; at least one load "
                "needs two, or the scatter from recording to recording is unknown"
            )
        means = np.array([x[at == value].mean(axis=0) for value in loads])
        spread = np.sqrt(((x - means[index]) ** 2).sum(axis=0) / freedom)
        return cls(names, loads, means, counts.astype(np.int64), spread, freedom)

    def deviations(self, values: npt.ArrayLike, load: npt.ArrayLike) -> Floats:
        """Return features in units of healthy spread, the uncertainty of the mean included.

        Raises
        ------
        InputError
            A load has no healthy recording.
        """
        x, at = np.atleast_2d(np.asarray(values, dtype=np.float64)), np.atleast_1d(load)
        rows = [self._row(float(value)) for value in at]
        width = self.spread * np.sqrt(1.0 + 1.0 / self.counts[rows])[:, None]
        return np.asarray((x - self.means[rows]) / np.where(width > 0.0, width, np.inf))

    def p_values(self, values: npt.ArrayLike, load: npt.ArrayLike) -> Floats:
        """Return the probability that a healthy recording deviates as much in any feature.

        The largest deviation follows Student's distribution; over all features the bound of
        Sidak holds for any positive dependence between them and errs to the safe side.
        """
        largest = np.abs(self.deviations(values, load)).max(axis=1)
        single = 2.0 * stdtr(self.freedom, -largest)
        return np.asarray(-np.expm1(len(self.names) * np.log1p(-np.minimum(single, 1.0 - 1e-15))))

    def is_faulty(
        self, values: npt.ArrayLike, load: npt.ArrayLike, *, false_alarm: float = 0.05
    ) -> npt.NDArray[np.bool_]:
        """Tell which recordings deviate too much, at most `false_alarm` of the healthy ones."""
        if not 0.0 < false_alarm < 1.0:
            raise RangeError(f"false-alarm rate {false_alarm:g} is not between 0 and 1")
        return np.asarray(self.p_values(values, load) < false_alarm)

    def _row(self, load: float) -> int:
        near = np.flatnonzero(np.abs(self.loads - load) <= 1.0)
        if not near.size:
            known = [f"{value:g}" for value in self.loads]
            raise InputError(
                f"no healthy recording at a load of {load:g} N{did_you_mean(f'{load:g}', known)}"
            )
        return int(near[0])


Groups = npt.NDArray[np.float64] | npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]
SHRINKAGE = {"transfer": 0.2, "full": 0.6}
"""Many features of few recordings need a scatter close to its diagonal."""


@dataclass(frozen=True, slots=True)
class Answers:
    """What a classifier named of recordings that it was not trained on.

    Attributes
    ----------
    truth, named : array of str
        Condition of each, as it was and as the most probable one.
    probability : array
        That the classifier gave to what it named.
    load : array
        Load of each [kgf].
    """

    truth: npt.NDArray[np.str_]
    named: npt.NDArray[np.str_]
    probability: Floats
    load: Floats

    @classmethod
    def joined(cls, parts: Sequence[Answers]) -> Answers:
        """Put the answers of several splits together."""
        return cls(
            np.concatenate([part.truth for part in parts]),
            np.concatenate([part.named for part in parts]),
            np.concatenate([part.probability for part in parts]),
            np.concatenate([part.load for part in parts]),
        )


def leave_load_out(
    data: CranfieldData, conditions: Sequence[str], names: Sequence[str], *,
    values: Floats | None = None, shrinkage: float = SHRINKAGE["transfer"],
) -> Answers | None:  # fmt: skip
    """Train on every load but one, answer at that one.

    Nothing of the load in question is used unless `values` were made with it.

    Parameters
    ----------
    data : CranfieldData
        All recordings.
    conditions : sequence of str
        The classes.
    names : sequence of str
        Features.
    values : array, optional
        Instead of the features themselves.
    shrinkage : float
        Of the classifier.

    Returns
    -------
    Answers or None
        None where a condition is absent, or present at a single load.
    """
    x = data.table.select(names) if values is None else values
    used = np.isin(data.condition, list(conditions))
    parts = []
    for load in np.unique(data.load[used]):
        test, train = used & (data.load == load), used & (data.load != load)
        if set(conditions) - set(data.condition[train]) or not test.any():
            return None
        parts.append(_answer(data, x, train, test, (data.load, shrinkage)))
    return Answers.joined(parts) if len(parts) > 1 else None


def leave_run_out(
    data: CranfieldData, names: Sequence[str], *, shrinkage: float = SHRINKAGE["full"]
) -> Answers | None:
    """Within each load, train on every run but one, answer for that one; all conditions.

    A condition with a single run at a load cannot be left out there and does not take part.
    """
    x = data.table.select(names)
    parts = []
    for load in np.unique(data.load):
        at = _repeated(data, data.load == load)
        if len(np.unique(data.condition[at])) < 2:
            continue
        for run in np.unique(data.run[at]):
            test = at & (data.run == run)
            parts.append(_answer(data, x, at & ~test, test, (data.run, shrinkage)))
    return Answers.joined(parts) if parts else None


def chronological(
    data: CranfieldData, names: Sequence[str], *, shrinkage: float = SHRINKAGE["full"]
) -> Answers | None:
    """Within each load, train on the first runs, answer for the later ones: what drift does."""
    x = data.table.select(names)
    runs = np.unique(data.run)
    early = np.isin(data.run, runs[: (len(runs) + 1) // 2])
    parts = []
    for load in np.unique(data.load):
        train = (data.load == load) & early
        test = (data.load == load) & ~early & np.isin(data.condition, data.condition[train])
        if test.any() and len(np.unique(data.condition[train])) > 1:
            parts.append(_answer(data, x, train, test, (data.run, shrinkage)))
    return Answers.joined(parts) if parts else None


def relative_to_healthy(data: CranfieldData, names: Sequence[str]) -> Floats | None:
    """Return the features less the healthy mean at the same load; the same run is not in it."""
    x = data.table.select(names)
    result = np.empty_like(x)
    for index in range(len(x)):
        healthy = (data.condition == "normal") & (data.load == data.load[index])
        healthy &= data.run != data.run[index]
        if not healthy.any():
            return None
        result[index] = x[index] - x[healthy].mean(axis=0)
    return result


def _repeated(data: CranfieldData, at: Mask) -> Mask:
    names, counts = np.unique(data.condition[at], return_counts=True)
    return np.asarray(at & np.isin(data.condition, names[counts > 1]))


def _answer(
    data: CranfieldData, x: Floats, train: Mask, test: Mask, how: tuple[Groups, float]
) -> Answers:
    labels = data.condition[train].tolist()
    fitted = Discriminant.fit(x[train], labels, how[0][train], shrinkage=how[1])
    probability = fitted.predict_proba(x[test])
    return Answers(
        data.condition[test],
        np.array(fitted.predict(x[test])),
        probability.max(axis=1),
        data.load[test],
    )
