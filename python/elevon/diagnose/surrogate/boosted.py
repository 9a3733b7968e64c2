"""Boosted trees, several times over: what they say, and how they are trained (scikit-learn).

Each member has two sets of trees for every fault: the logit of its presence, and its size were it
there. What is read needs NumPy alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.learning.trees import Trees

if TYPE_CHECKING:
    import numpy.typing as npt

_LEAVES, _RATE, _LEAST = 8, 0.15, 20  # of a tree; of learning; runs of a leaf
_SIZES = 2.0 / 3.0  # rounds of a size over those of a presence: it has a tenth of the runs


@dataclass(frozen=True)
class Batch:
    """What a member is trained on.

    Attributes
    ----------
    inputs : ndarray, shape (n, m)
        Normalised.
    size : ndarray, shape (n, f)
        Of each fault, scaled to its range; zero where absent.
    """

    inputs: Floats
    size: Floats


@dataclass(frozen=True)
class Opinion:
    """What an ensemble says of n inputs.

    Attributes
    ----------
    presence : ndarray, shape (n, f)
        Logit of each fault, not yet calibrated.
    size : ndarray, shape (n, f)
        Of each fault, were it there.
    each : ndarray, shape (e, n, f)
        Of every member: logit of each fault.
    """

    presence: Floats
    size: Floats
    each: Floats


@dataclass(frozen=True)
class Ensemble:
    """Members that were trained on different units.

    Attributes
    ----------
    trees : Trees
        Of all members: presence of each fault, then its size.
    start : ndarray, shape (e, 2 f)
        What the trees are added to.
    """

    trees: Trees
    start: Floats

    def says(self, inputs: Floats) -> Opinion:
        """Return the ensemble's opinion of inputs, shape (n, m): the members' means."""
        out = self.start + self.trees.scores(inputs).reshape(-1, *self.start.shape)
        count = self.start.shape[1] // 2
        each = out[..., :count].swapaxes(0, 1)
        return Opinion(each.mean(axis=0), out[..., count:].mean(axis=1), each)

    @classmethod
    def of(cls, members: Sequence[Ensemble]) -> Ensemble:
        """Return several as one."""
        return cls(Trees.joined([m.trees for m in members]), np.vstack([m.start for m in members]))


def trained(
    batches: Callable[[np.random.Generator], Batch], *, draws: int, rounds: int, seed: int
) -> Ensemble:
    """Train one member.

    Parameters
    ----------
    batches : callable
        Random generator to a batch.
    draws : int
        Batches that are drawn.
    rounds : int
        Trees of a fault's presence.
    seed : int
        Of the batches.
    """
    rng = np.random.default_rng([seed, 0])
    drawn = [batches(rng) for _ in range(draws)]
    inputs = np.concatenate([batch.inputs for batch in drawn])
    size = np.concatenate([batch.size for batch in drawn])
    columns = [_presence(inputs, x != 0.0, rounds) for x in size.T]
    columns += [
        _size(inputs[x != 0.0], x[x != 0.0], max(round(_SIZES * rounds), 1)) for x in size.T
    ]
    start = np.array([[first for _, first in columns]])
    return Ensemble(Trees.of_histograms([nodes for nodes, _ in columns]), start)


def _presence(
    inputs: Floats, there: npt.NDArray[np.bool_], rounds: int
) -> tuple[list[npt.NDArray[Any]], float]:
    """Trees of a fault's presence; none where all runs or no run have it."""
    from sklearn.ensemble import HistGradientBoostingClassifier

    if there.all() or not there.any():
        share = (there.sum() + 0.5) / (len(there) + 1.0)
        return [], math.log(share / (1.0 - share))
    model = HistGradientBoostingClassifier(**_options(rounds)).fit(inputs, there)
    return _nodes(model)


def _size(inputs: Floats, size: Floats, rounds: int) -> tuple[list[npt.NDArray[Any]], float]:
    """Trees of a fault's size, by the runs that have it."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    if len(size) < _LEAST:
        return [], float(size.mean()) if len(size) else 0.0
    return _nodes(HistGradientBoostingRegressor(**_options(rounds)).fit(inputs, size))


def _options(rounds: int) -> dict[str, Any]:
    return {
        "max_iter": rounds, "max_leaf_nodes": _LEAVES, "learning_rate": _RATE,
        "min_samples_leaf": _LEAST, "l2_regularization": 1.0, "early_stopping": False,
        "random_state": 0,
    }  # fmt: skip


def _nodes(model: Any) -> tuple[list[npt.NDArray[Any]], float]:
    """The trees of a model of one output, and what they are added to."""
    start = float(np.ravel(model._baseline_prediction)[0])
    return [row[0].nodes for row in model._predictors], start


def honest(scaling: Floats, logit: Floats) -> Floats:
    """Return calibrated logits, shape (..., k): one slope for each side, and an offset.

    Parameters
    ----------
    scaling : ndarray, shape (k, 3)
        Slope where the logit is negative, where it is positive, offset (beta calibration; Kull,
        Silva Filho and Flach, 2017).
    logit : ndarray, shape (..., k)
        As the trees give it.
    """
    absent, there = -np.logaddexp(0.0, -logit), np.logaddexp(0.0, logit)
    return np.asarray(scaling[:, 0] * absent + scaling[:, 1] * there + scaling[:, 2])


def either(logit: Floats) -> Floats:
    """Return the logit, shape (...), that any of independent faults, shape (..., f), is there."""
    none = np.logaddexp(0.0, logit).sum(axis=-1)  # -log of the product of all absences
    return np.asarray(none + np.log(-np.expm1(-none)))
