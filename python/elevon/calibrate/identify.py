"""What the logs can determine, before anything is fitted: sensitivities ranked, pairs named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from elevon.arrays import Bools, Floats, Ints
from elevon.errors import InputError
from elevon.estimate import Free
from elevon.estimate.covariance import block_covariance
from elevon.plain import Plain, key

_CORRELATED = 0.95
_LOOSEST = 0.25  # relative deviation (or of ten meaningful changes) still worth freeing
_HOPELESS = 1.0  # the same, above which a requested parameter is refused
_SAME = 0.995  # correlation at which two parameters are one
_BOUND = 3.0  # deviations beyond which a residual counts no more
_OFFSETS = 10.0  # meaningful changes of an offset or a delay that count as one of a number's size


@dataclass(frozen=True)
class SensitivityTable:
    """What changes of the free parameters do to the residuals.

    Attributes
    ----------
    free : tuple of Free
        Candidates.
    jacobian : ndarray, shape (n, p)
        Deviations of the residual a meaningful change.
    residual : ndarray, shape (n,)
        In deviations.
    blocks : ndarray of int, shape (n,)
        Of each sample.
    """

    free: tuple[Free, ...]
    jacobian: Floats
    residual: Floats
    blocks: Ints

    def only(self, left: Sequence[int]) -> SensitivityTable:
        """Return that of some candidates."""
        chosen = tuple(self.free[k] for k in left)
        return replace(self, free=chosen, jacobian=self.jacobian[:, list(left)])

    def covariance(self) -> Floats:
        """Covariance that a fit would have, shape (p, p), in meaningful changes."""
        scores = self.jacobian * np.clip(self.residual, -_BOUND, _BOUND)[:, None]
        return block_covariance(self.jacobian.T @ self.jacobian, scores, self.blocks)[0]


@dataclass(frozen=True)
class _Spread:
    """Deviations and correlations of candidates, from their covariance."""

    free: tuple[Free, ...]
    std: Floats
    correlation: Floats

    @classmethod
    def of(cls, table: SensitivityTable) -> _Spread:
        covariance = table.covariance()
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        if not np.isfinite(std).all() or not std.all():
            return cls(table.free, std, np.ones_like(covariance))
        correlation = covariance / np.outer(std, std)
        np.fill_diagonal(correlation, 0.0)
        return cls(table.free, std, correlation)

    @property
    def finite(self) -> bool:
        return bool(np.isfinite(self.std).all() and self.std.all())

    @property
    def loose(self) -> Floats:
        """Relative deviation; offsets and delays count in ten meaningful changes."""
        sizes = [item.spread if item.log_scale else 1.0 / _OFFSETS for item in self.free]
        return np.asarray(np.where(np.isfinite(self.std), self.std * sizes, np.inf))

    @property
    def blind(self) -> Bools:
        """Which cannot be told from another one, even where both look tight."""
        return np.asarray(np.abs(self.correlation).max(axis=0) > _SAME)

    def reason(self, j: int) -> str:
        """Why one is not determined."""
        loose = float(self.loose[j])
        if not self.finite:
            return "it cannot be determined from the others"
        text = f"its deviation would be {100.0 * loose:.0f} %"
        other = int(np.argmax(np.abs(self.correlation[j])))
        if abs(self.correlation[j, other]) > _CORRELATED:
            name, size = self.free[other].path, self.correlation[j, other]
            text += f", and it cannot be determined from {name} ({size:+.3f})"
        return text


@dataclass(frozen=True)
class Identifiability(Plain):
    """Ranking of the candidates at the first values.

    Attributes
    ----------
    singular_values : ndarray, shape (p,)
        Of the scaled sensitivity matrix (deviations of the residual per meaningful change).
    weakest : tuple of (str, float)
        Components of the direction of the smallest singular value, largest first.
    predicted : dict of str to float
        Deviation each would have: relative for positive numbers, in SI else.
    pairs : tuple of (str, str, float)
        Pairs correlated by more than 0.95.
    dropped : dict of str to str
        Candidates left out, and why.
    """

    singular_values: Floats
    weakest: tuple[tuple[str, float], ...]
    predicted: dict[str, float]
    pairs: Annotated[tuple[tuple[str, str, float], ...], key("correlated")]
    dropped: dict[str, str]

    COMPUTED: ClassVar = ("condition",)

    @property
    def condition(self) -> float:
        """Largest over least singular value."""
        return float(self.singular_values[0] / max(self.singular_values[-1], 1e-300))


def rank(table: SensitivityTable, dropped: dict[str, str] | None = None) -> Identifiability:
    """Rank candidates by what they do to the residuals."""
    names = [item.path for item in table.free]
    _, singular, directions = np.linalg.svd(table.jacobian, full_matrices=False)
    spread = _Spread.of(table)
    order = np.argsort(-np.abs(directions[-1]))[:4]
    pairs = [
        (names[i], names[j], float(spread.correlation[i, j]))
        for i in range(len(names))
        for j in range(i)
        if spread.finite and abs(spread.correlation[i, j]) > _CORRELATED
    ]
    sizes = spread.std * [item.spread for item in table.free]
    return Identifiability(
        singular_values=singular,
        weakest=tuple((names[k], float(directions[-1][k])) for k in order),
        predicted=dict(zip(names, map(float, sizes), strict=True)),
        pairs=tuple(sorted(pairs, key=lambda item: -abs(item[2]))),
        dropped=dict(dropped or {}),
    )


def choose(table: SensitivityTable, required: Sequence[str]) -> tuple[list[int], Identifiability]:
    """Drop, one by one, what the logs cannot determine; return the indices kept, maybe none.

    Parameters
    ----------
    table : SensitivityTable
        Of all candidates.
    required : sequence of str
        Paths requested: never dropped.

    Raises
    ------
    InputError
        A required parameter that nothing in the logs excites, or that cannot be determined from
        others.
    """
    free = table.free
    dropped = _unexcited(table, required)
    left = [k for k, item in enumerate(free) if item.path not in dropped]
    while left:
        spread = _Spread.of(table.only(left))
        optional = [j for j, item in enumerate(spread.free) if item.path not in required]
        # Of two that cannot be determined apart, the looser one goes.
        worst = max(optional, key=lambda j: (spread.blind[j], spread.loose[j]), default=None)
        if worst is None or not (spread.blind[worst] or spread.loose[worst] > _LOOSEST):
            break
        dropped[spread.free[worst].path] = spread.reason(worst)
        del left[worst]
    if not left:
        return [], Identifiability(np.empty(0), (), {}, (), dropped)
    for j, item in enumerate(spread.free):
        if item.path in required and (spread.loose[j] > _HOPELESS or spread.blind[j]):
            why = spread.reason(j)
            raise InputError(f"--free {item.path}: the logs cannot determine it: {why}")
    return left, rank(table.only(left), dropped)


def _unexcited(table: SensitivityTable, required: Sequence[str]) -> dict[str, str]:
    """Candidates that move no signal."""
    strength = np.linalg.norm(table.jacobian, axis=0)
    weak = [
        item for item, size in zip(table.free, strength, strict=True)
        if not size > 1e-6 * np.sqrt(len(table.jacobian))
    ]  # fmt: skip
    for item in weak:
        if item.path in required:
            raise InputError(
                f"--free {item.path}: nothing in the logs excites it (a change of "
                f"{item.spread:g} moves no signal); leave it out or add a log that does"
            )
    return {item.path: "nothing in the logs excites it" for item in weak}
