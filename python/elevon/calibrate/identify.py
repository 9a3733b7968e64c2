"""What the logs can determine, before anything is fitted: sensitivities ranked, pairs named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.blocks import block_covariance
from elevon.calibrate.candidates import ParameterCandidate
from elevon.errors import InputError

__all__ = ["Identifiability", "choose", "rank"]

_CORRELATED = 0.95
_LOOSEST = 0.25  # relative deviation (or of the size of an offset's meaning) still worth freeing
_HOPELESS = 1.0  # the same, above which a requested parameter is refused
_SAME = 0.995  # correlation at which two parameters are one


@dataclass(frozen=True)
class Identifiability:
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
    pairs: tuple[tuple[str, str, float], ...]
    dropped: dict[str, str]

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain types."""
        return {
            "singular_values": self.singular_values.tolist(),
            "condition": float(self.singular_values[0] / max(self.singular_values[-1], 1e-300)),
            "weakest": [list(item) for item in self.weakest],
            "predicted": self.predicted,
            "correlated": [list(pair) for pair in self.pairs],
            "dropped": self.dropped,
        }


def rank(
    free: Sequence[ParameterCandidate],
    jac: Sequence[Floats],
    residual: Sequence[Floats],
    blocks: Sequence[npt.NDArray[np.int64]],
    dropped: dict[str, str] | None = None,
) -> Identifiability:
    """Rank candidates by the sensitivities `jac`, (n, 2, p) a log, at residuals (n, 2)."""
    sizes = np.array([item.size for item in free])
    stacked = np.vstack([part.reshape(-1, len(free)) for part in jac]) * sizes
    _, singular, directions = np.linalg.svd(stacked, full_matrices=False)
    covariance = _covariance(jac, residual, blocks)
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    names = [item.path for item in free]
    order = np.argsort(-np.abs(directions[-1]))[:4]
    return Identifiability(
        singular_values=singular,
        weakest=tuple((names[k], float(directions[-1][k])) for k in order),
        predicted=dict(zip(names, map(float, std), strict=True)),
        pairs=_pairs(names, covariance, std),
        dropped=dict(dropped or {}),
    )


def choose(
    free: Sequence[ParameterCandidate],
    jac: Sequence[Floats],
    residual: Sequence[Floats],
    blocks: Sequence[npt.NDArray[np.int64]],
    required: Sequence[str],
) -> tuple[list[int], Identifiability]:
    """Drop, one by one, what the logs cannot determine; return the indices kept, maybe none.

    Parameters
    ----------
    free, jac, residual, blocks
        As `rank`.
    required : sequence of str
        Paths requested: never dropped.

    Raises
    ------
    InputError
        A required parameter that nothing in the logs excites, or that cannot be determined from
        others.
    """
    left = list(range(len(free)))
    dropped: dict[str, str] = {}
    whole = np.vstack([part.reshape(-1, len(free)) for part in jac])
    strength = np.linalg.norm(whole, axis=0) * [item.size for item in free]
    for k in list(left):
        if not strength[k] > 1e-6 * np.sqrt(len(whole)):
            if free[k].path in required:
                raise InputError(
                    f"--free {free[k].path}: nothing in the logs excites it (a change of "
                    f"{free[k].size:g} moves no signal); leave it out or add a log that does"
                )
            dropped[free[k].path] = "nothing in the logs excites it"
            left.remove(k)
    while left:
        covariance = _covariance([part[:, :, left] for part in jac], residual, blocks)
        loose = _looseness([free[k] for k in left], covariance)
        optional = [j for j, k in enumerate(left) if free[k].path not in required]
        # Of two that cannot be determined apart, the looser one goes, even where both look tight.
        blind = np.array([_twin(covariance, j) > _SAME for j in range(len(left))])
        worst = max(optional, key=lambda j: (blind[j], loose[j]), default=None)
        if worst is None or not (blind[worst] or loose[worst] > _LOOSEST):
            break
        index = left[worst]
        dropped[free[index].path] = _reason(
            [free[k] for k in left], covariance, worst, loose[worst]
        )
        left.remove(index)
    if not left:
        return [], Identifiability(np.empty(0), (), {}, (), dropped)
    _refuse(free, left, jac, residual, blocks, required=required)
    chosen = [free[k] for k in left]
    ranking = rank(chosen, [part[:, :, left] for part in jac], residual, blocks, dropped)
    return left, ranking


def _refuse(
    free: Sequence[ParameterCandidate],
    left: Sequence[int],
    jac: Sequence[Floats],
    residual: Sequence[Floats],
    blocks: Sequence[npt.NDArray[np.int64]],
    *,
    required: Sequence[str],
) -> None:
    """Raise where a required parameter is hopeless, or the twin of another one."""
    covariance = _covariance([part[:, :, list(left)] for part in jac], residual, blocks)
    items = [free[k] for k in left]
    loose = _looseness(items, covariance)
    for j, item in enumerate(items):
        if item.path in required and (loose[j] > _HOPELESS or _twin(covariance, j) > _SAME):
            why = _reason(items, covariance, j, loose[j])
            raise InputError(f"--free {item.path}: the logs cannot determine it: {why}")


def _twin(covariance: Floats, j: int) -> float:
    """Largest correlation with any other parameter."""
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if not np.isfinite(std).all() or not std.all():
        return 1.0
    correlation = np.abs(covariance[j] / (std[j] * std))
    correlation[j] = 0.0
    return float(correlation.max())


def _looseness(free: Sequence[ParameterCandidate], covariance: Floats) -> Floats:
    """Relative deviation; offsets and delays count in ten meaningful changes."""
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    unit = np.array([1.0 if item.log_scale else 10.0 * item.size for item in free])
    return np.asarray(np.where(np.isfinite(std), std / unit, np.inf), dtype=np.float64)


def _reason(free: Sequence[ParameterCandidate], covariance: Floats, j: int, loose: float) -> str:
    text = f"its deviation would be {100.0 * loose:.0f} %" if np.isfinite(loose) else "no effect"
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if not np.isfinite(std).all() or std[j] == 0.0:
        return "it cannot be determined from the others"
    correlation = covariance[j] / (std[j] * np.where(std > 0.0, std, 1.0))
    correlation[j] = 0.0
    other = int(np.argmax(np.abs(correlation)))
    if abs(correlation[other]) > _CORRELATED:
        text += f", and it cannot be determined from {free[other].path} ({correlation[other]:+.3f})"
    return text


def _covariance(
    jac: Sequence[Floats],
    residual: Sequence[Floats],
    blocks: Sequence[npt.NDArray[np.int64]],
) -> Floats:
    size = jac[0].shape[2]
    normal = np.zeros((size, size))
    scores = []
    for part, misfit in zip(jac, residual, strict=True):
        flat = part.reshape(-1, size)
        normal += flat.T @ flat
        bounded = np.clip(misfit, -3.0, 3.0)
        scores.append(np.einsum("ncp,nc->np", part, bounded))
    return block_covariance(normal, scores, blocks)[0]


def _pairs(
    names: Sequence[str], covariance: Floats, std: Floats
) -> tuple[tuple[str, str, float], ...]:
    if not np.isfinite(std).all():
        return ()
    correlation = covariance / np.outer(np.where(std > 0, std, 1.0), np.where(std > 0, std, 1.0))
    pairs = [
        (names[i], names[j], float(correlation[i, j]))
        for i in range(len(names))
        for j in range(i)
        if abs(correlation[i, j]) > _CORRELATED
    ]
    return tuple(sorted(pairs, key=lambda item: -abs(item[2])))
