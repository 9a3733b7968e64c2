"""Levenberg and Marquardt from several starts at once: the runs of a step are one batch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.closed_loop.objective import Objective

__all__ = ["Point", "jacobian", "solve"]

_LADDER = (0.03, 0.5, 10.0, 300.0)  # damping tried in each step, over the last one
_STEP = 0.03  # of a logarithm, or of an offset's tenth of a spread: over the switching instants
_SETTLED = 1e-4  # relative fall of the cost below which a start rests


@dataclass
class Point:
    """One start on its way."""

    x: Floats
    residual: Floats
    cost: float
    damping: float = 1.0
    slow: bool = False
    settled: bool = False


def steps(objective: Objective) -> Floats:
    """Return the steps of differences in fitted variables."""
    return np.array(
        [_STEP / f.spread if f.log_scale else _STEP for f in objective.free], dtype=np.float64
    )


def jacobian(objective: Objective, points: list[Point], *, central: bool = False) -> list[Floats]:
    """Return derivatives of the residuals by differences over a batch, one array (n, p) a point."""
    h = steps(objective)
    size = len(h)
    # Away from a bound that is near.
    rows, signs = [], []
    for point in points:
        sign = np.where(point.x + h > objective.high, -1.0, 1.0)
        signs.append(sign)
        moved = point.x + np.diag(h * sign)
        rows.append(moved)
        if central:
            rows.append(point.x - np.diag(h * sign))
    residuals = objective.residual(np.vstack(rows))
    width = size * (2 if central else 1)
    jacs = []
    for k, (point, sign) in enumerate(zip(points, signs, strict=True)):
        part = residuals[k * width : (k + 1) * width]
        if central:
            jacs.append(((part[:size] - part[size:]) / (2.0 * h * sign)[:, None]).T)
        else:
            jacs.append(((part - point.residual) / (h * sign)[:, None]).T)
    return jacs


def solve(
    objective: Objective,
    starts: Floats,
    *,
    rounds: int,
    keep: int | None = None,
    central: bool = False,
    advance: Callable[[float], object] = lambda _f: None,
) -> list[Point]:
    """Return the starts after some rounds, best first; shape of `starts` (m, p).

    After two rounds only the best `keep` go on.
    """
    starts = np.clip(np.atleast_2d(starts), objective.low, objective.high)
    first = objective.residual(starts)
    points = [Point(x, r, objective.cost(r, x)) for x, r in zip(starts, first, strict=True)]
    points.sort(key=lambda point: point.cost)
    if keep is not None:
        points = points[: 3 * keep]
    for number in range(rounds):
        if keep is not None and number == 2:
            points = points[:keep]
        going = [point for point in points if not point.settled]
        if not going:
            break
        _round(objective, going, central)
        points.sort(key=lambda point: point.cost)
        advance((number + 1) / rounds)
    return points


def _round(objective: Objective, points: list[Point], central: bool) -> None:
    """One step of every point: the best of a ladder of dampings."""
    jacs = jacobian(objective, points, central=central)
    trials = np.vstack(
        [_trials(objective, point, jac) for point, jac in zip(points, jacs, strict=True)]
    )
    residuals = objective.residual(trials)
    width = len(_LADDER)
    for k, point in enumerate(points):
        part = slice(k * width, (k + 1) * width)
        costs = [objective.cost(r, x) for r, x in zip(residuals[part], trials[part], strict=True)]
        best = int(np.argmin(costs))
        if not costs[best] < point.cost:
            point.settled = point.damping >= 1e6
            point.damping = min(point.damping * 100.0, 1e6)
            continue
        # One small step is a narrow valley, two are the end.
        small = point.cost - costs[best] < _SETTLED * point.cost
        point.settled = small and point.slow
        point.slow = small
        point.damping = min(max(point.damping * _LADDER[best] * 0.3, 1e-8), 1e6)
        point.x, point.residual = trials[part][best], residuals[part][best]
        point.cost = costs[best]


def _trials(objective: Objective, point: Point, jac: Floats) -> Floats:
    """Steps under each damping, from the weighted normal equations; shape (len(_LADDER), p)."""
    weight = objective.weight(point.residual)
    normal = jac.T @ (weight[:, None] * jac) + objective.belief**2 * np.eye(len(point.x))
    slope = jac.T @ (weight * point.residual) + objective.belief * objective.prior(point.x)
    diagonal = np.diag(np.diag(normal))
    out = []
    for factor in _LADDER:
        step = np.linalg.solve(normal + point.damping * factor * diagonal, -slope)
        out.append(np.clip(point.x + np.clip(step, -1.0, 1.0), objective.low, objective.high))
    return np.array(out)
