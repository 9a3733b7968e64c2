"""Who is trained on what: splits by load, by recording and by time; never by cycle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.learning.discriminant import Discriminant
from elevon.reproduce.cranfield.data import CranfieldData

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
