"""Gradient-boosted trees as plain arrays: trained by scikit-learn, read by NumPy alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats

if TYPE_CHECKING:
    from sklearn.ensemble import GradientBoostingClassifier, GradientBoostingRegressor

_NAMES = ("feature", "threshold", "left", "right", "value", "roots")
_WAYS = ("left", "right")


@dataclass(frozen=True)
class Trees:
    """Trees of all classes, their nodes in one row.

    Attributes
    ----------
    feature : ndarray of int, shape (n,)
        That a node asks.
    threshold : ndarray, shape (n,)
        At most this goes left.
    left, right : ndarray of int, shape (n,)
        Nodes; a leaf leads to itself.
    value : ndarray, shape (n,)
        Of leaves.
    roots : ndarray of int, shape (r, c)
        First nodes, by round and column.
    """

    feature: npt.NDArray[np.int64]
    threshold: Floats
    left: npt.NDArray[np.int64]
    right: npt.NDArray[np.int64]
    value: Floats
    roots: npt.NDArray[np.int64]

    def scores(self, values: Floats) -> Floats:
        """Return the sums of the trees of each column: rows of shape (n, k) to (n, c)."""
        values = values.astype(np.float32)  # as the library compares them
        at = np.broadcast_to(self.roots.ravel(), (len(values), self.roots.size))
        rows = np.arange(len(values))[:, None]
        while True:
            low = values[rows, self.feature[at]] <= self.threshold[at]
            following = np.where(low, self.left[at], self.right[at])
            if np.array_equal(following, at):
                break
            at = following
        return np.asarray(self.value[at].reshape(len(values), *self.roots.shape).sum(axis=1))

    def arrays(self) -> dict[str, npt.NDArray[np.generic]]:
        """Return what a file holds of it: children by how far behind their node they stand."""
        at = np.arange(len(self.feature))
        out = {"feature": self.feature, "roots": self.roots}
        out |= {f"to_{way}": getattr(self, way) - at for way in _WAYS}
        small = {n: a.astype(np.min_scalar_type(int(a.max()))) for n, a in out.items()}
        return small | {n: getattr(self, n).astype(np.float32) for n in ("threshold", "value")}

    @classmethod
    def stored(cls, data: Mapping[str, npt.NDArray[np.generic]]) -> Trees:
        """Return the trees of a file's arrays; errors as `build`."""
        at = np.arange(len(data["feature"]))
        ways = {way: at + np.asarray(data[f"to_{way}"], dtype=np.int64) for way in _WAYS}
        return cls.build({**data, **ways})

    @classmethod
    def build(cls, data: Mapping[str, npt.NDArray[np.generic]]) -> Trees:
        """Return trees of arrays by name.

        Raises
        ------
        ValueError
            A node that is none, a value that is not finite.
        """
        names = ("feature", "left", "right", "roots")
        whole = {n: np.asarray(data[n], dtype=np.int64) for n in names}
        real = {n: np.asarray(data[n], dtype=np.float64) for n in ("threshold", "value")}
        count = len(whole["feature"])
        nodes = np.concatenate([whole[n].ravel() for n in ("left", "right", "roots")])
        if count == 0 or nodes.min() < 0 or nodes.max() >= count or whole["feature"].min() < 0:
            raise ValueError("a tree has a node that is none")
        after = np.maximum(whole["left"], whole["right"])
        leaf = (whole["left"] == np.arange(count)) & (whole["right"] == np.arange(count))
        before = np.minimum(whole["left"], whole["right"])
        if not (leaf | (before > np.arange(count))).all() or (after < np.arange(count)).any():
            raise ValueError("a tree leads back to where it came from")
        if not all(np.isfinite(a).all() for a in real.values()):
            raise ValueError("an array is not finite")
        return cls(
            whole["feature"], real["threshold"], whole["left"], whole["right"], real["value"],
            whole["roots"],
        )  # fmt: skip

    @classmethod
    def of(cls, model: GradientBoostingClassifier | GradientBoostingRegressor) -> Trees:
        """Return the trees of a model that was fitted with ``init="zero"``.

        A classifier of two classes has one column: the logit of the second.

        Raises
        ------
        ValueError
            As `build`.
        """
        nodes: dict[str, list[npt.NDArray[np.generic]]] = {n: [] for n in _NAMES[:5]}
        first, roots = 0, np.zeros(model.estimators_.shape, dtype=np.int64)
        for place in np.ndindex(roots.shape):
            tree = model.estimators_[place].tree_
            leaf, at = tree.children_left < 0, np.arange(tree.node_count)
            nodes["feature"].append(np.where(leaf, 0, tree.feature))
            nodes["threshold"].append(np.where(leaf, 0.0, tree.threshold))
            nodes["left"].append(first + np.where(leaf, at, tree.children_left))
            nodes["right"].append(first + np.where(leaf, at, tree.children_right))
            nodes["value"].append(np.where(leaf, model.learning_rate * tree.value[:, 0, 0], 0.0))
            roots[place] = first
            first += tree.node_count
        return cls.build({n: np.concatenate(rows) for n, rows in nodes.items()} | {"roots": roots})

    @classmethod
    def constant(cls, rounds: int) -> Trees:
        """Return so many trees of one column that are nought everywhere."""
        none = np.zeros(1)
        whole = dict.fromkeys(_NAMES[:5], none) | {"roots": np.zeros((rounds, 1))}
        return cls.build(whole)

    @classmethod
    def joined(cls, parts: Sequence[Trees]) -> Trees:
        """Return trees of equally many rounds as one, their columns side by side."""
        ends = np.cumsum([0, *(len(p.feature) for p in parts)])
        moved = [
            {n: getattr(p, n) + (end if n in (*_WAYS, "roots") else 0) for n in _NAMES}
            for p, end in zip(parts, ends, strict=False)
        ]
        rows = {n: np.concatenate([m[n] for m in moved]) for n in _NAMES[:5]}
        return cls.build(rows | {"roots": np.hstack([m["roots"] for m in moved])})
