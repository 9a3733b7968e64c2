"""The dynamic fit: bounded robust least squares on model runs, and its covariance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.blocks import block_covariance, block_length
from elevon.calibrate.candidates import ParameterCandidate
from elevon.calibrate.problem import Problem, values_of
from elevon.parameters.relations import TORQUE_PER_FLUX

__all__ = ["DynamicFit", "blocks_of", "fit_dynamic", "refresh_scales", "step_sizes"]

_SOFT = 3.0  # deviations beyond which residuals weigh less
_AGREE = 0.1  # relative difference up to which exact derivatives hold
_CLOUD = 32  # starts tried where the first values explain too little
_EXPLAINED = 0.5  # share of the current's variance the first values must explain
_CLOSE = 1e-5  # relative: switching instants leave the cost no smoother
_STEP = 0.01  # of the meaningful change ... of a logarithm


@dataclass(frozen=True)
class DynamicFit:
    """Result of the dynamic fit.

    Attributes
    ----------
    free : tuple of Candidate
        What was fitted.
    x : ndarray, shape (p,)
        Solution, logarithms where the candidate says so.
    covariance : ndarray, shape (p, p)
        Of `x`, for coloured residuals.
    degrees : float
        Degrees of freedom of the covariance.
    cost : float
        Mean robust cost a sample.
    exact : tuple of str
        Parameters whose exact derivatives held and were used.
    evaluations : int
        Model evaluations of the optimiser.
    converged : bool
        Whether it met its tolerance.
    at_bound : tuple of str
        Parameters that ended at a bound.
    """

    free: tuple[ParameterCandidate, ...]
    x: Floats
    covariance: Floats
    degrees: float
    cost: float
    exact: tuple[str, ...]
    evaluations: int
    converged: bool
    at_bound: tuple[str, ...]

    @property
    def values(self) -> dict[str, float]:
        """Fitted values by path."""
        return values_of(self.free, self.x)


def step_sizes(free: Sequence[ParameterCandidate]) -> Floats:
    """Return the steps of central differences: wide enough to average over switching instants."""
    return np.array([_STEP if item.log_scale else 0.1 * item.size for item in free])


def blocks_of(problem: Problem, residual: Sequence[Floats]) -> list[npt.NDArray[np.int64]]:
    """Number the blocks of each log's samples, longer than the residual's memory."""
    blocks = []
    for log, misfit, mask in zip(problem.logs, residual, problem.masks, strict=True):
        used = misfit[mask]
        lengths = [block_length(np.clip(used[:, c], -_SOFT, _SOFT), log.period) for c in range(2)]
        blocks.append(np.floor(log.time / max(lengths)).astype(np.int64))
    return blocks


def refresh_scales(problem: Problem, values: dict[str, float]) -> None:
    """Set each signal's deviation to the spread its residual really has."""
    runs = problem.simulate([values])[0]
    for k, (run, log, mask) in enumerate(zip(runs, problem.logs, problem.masks, strict=True)):
        if run is None:
            continue
        pairs = ((run.speed, log.speed), (run.current, log.current))
        spread = []
        for (model, data), old in zip(pairs, problem.scales[k], strict=True):
            misfit = (model - data)[mask]
            value = 1.4826 * float(np.median(np.abs(misfit - np.median(misfit))))
            spread.append(max(value, 1e-6 * float(np.abs(data).max()), 1e-12) if value else old)
        problem.scales[k] = (spread[0], spread[1])


def fit_dynamic(
    problem: Problem,
    free: Sequence[ParameterCandidate],
    x0: Floats,
    *,
    most: int = 25,
    finite: Sequence[Floats] | None = None,
    advance: Callable[[float], object] = lambda _f: None,
) -> DynamicFit:
    """Fit the free candidates from a start.

    Parameters
    ----------
    problem : Problem
        Logs, masks, scales.
    free : sequence of Candidate
        What is fitted.
    x0 : ndarray, shape (p,)
        Start.
    most : int
        Evaluations of the optimiser at most.
    finite : sequence of ndarray, optional
        Central differences at the start, one (n, 2, p) a log, where the caller has them.
    advance : callable
        Told the done fraction.

    Returns
    -------
    DynamicFit
        With the covariance at the solution, from central differences.
    """
    from scipy.optimize import least_squares

    low = np.array([_bound(item, item.low) for item in free])
    high = np.array([_bound(item, item.high) for item in free])
    start = np.clip(x0, low + 1e-9 * (high - low), high - 1e-9 * (high - low))
    moved = _global_start(problem, free, start, low, high)
    exact = _exact_columns(problem, free, moved, finite if moved is start else None)
    start = moved
    calls = 0

    def residual(x: Floats) -> Floats:
        return np.concatenate(
            [p.ravel() for p in problem.residual(problem.simulate([values_of(free, x)])[0])]
        )

    def jacobian(x: Floats) -> Floats:
        nonlocal calls
        calls += 1
        advance(min(calls / most, 0.95))
        parts = _mixed(problem, free, x, exact)
        return np.vstack([part.reshape(-1, len(free)) for part in parts])

    best = least_squares(
        residual,
        start,
        jac=jacobian,
        bounds=(low, high),
        loss="soft_l1",
        f_scale=_SOFT,
        x_scale=np.array([item.size for item in free]),
        max_nfev=most,
        ftol=_CLOSE,
        xtol=_CLOSE,
        gtol=1e-9,
    )
    x = np.asarray(best.x, dtype=np.float64)
    covariance, degrees = _covariance(problem, free, x)
    count = 2 * sum(int(mask.sum()) for mask in problem.masks)
    advance(1.0)
    return DynamicFit(
        free=tuple(free),
        x=x,
        covariance=covariance,
        degrees=degrees,
        cost=2.0 * float(best.cost) / max(count, 1),
        exact=tuple(free[k].path for k in exact),
        evaluations=int(best.nfev),
        converged=bool(best.success),
        at_bound=_at_bound(free, x, low, high),
    )


def _at_bound(
    free: Sequence[ParameterCandidate], x: Floats, low: Floats, high: Floats
) -> tuple[str, ...]:
    """Paths that ended at a bound."""
    close = 1e-3 * np.array([item.size for item in free])
    ends = (x - low < close) | (high - x < close)
    return tuple(item.path for item, end in zip(free, ends, strict=True) if end)


def _bound(item: ParameterCandidate, value: float) -> float:
    return item.inner(max(value, 1e-300) if item.log_scale else value)


def _explains(problem: Problem, values: dict[str, float]) -> float:
    """Share of the current's variance that a point explains, over all logs."""
    misfit = total = 0.0
    for run, log, mask in zip(
        problem.simulate([values])[0], problem.logs, problem.masks, strict=True
    ):
        if run is None:
            return -np.inf
        misfit += float(np.sum((run.current - log.current)[mask] ** 2))
        total += float(np.sum((log.current - log.current[mask].mean())[mask] ** 2))
    return 1.0 - misfit / total if total > 0.0 else -np.inf


def _global_start(
    problem: Problem, free: Sequence[ParameterCandidate], start: Floats, low: Floats, high: Floats
) -> Floats:
    """Keep the start where it explains the current; else try a cloud around it, in one batch."""
    if _explains(problem, values_of(free, start)) > _EXPLAINED:
        return start
    from scipy.stats import qmc

    cloud = qmc.Sobol(len(free), seed=0).random(_CLOUD)
    reach = np.array([np.log(10.0) if item.log_scale else 0.0 for item in free])
    points = np.clip(start + (2.0 * cloud - 1.0) * reach, low, high)
    points = np.vstack((start, points))
    runs = problem.simulate([values_of(free, p) for p in points])
    costs = [
        sum(
            float(np.sum(2.0 * (np.sqrt(1.0 + r**2 / _SOFT**2) - 1.0)))
            for r in problem.residual(item)
        )
        for item in runs
    ]
    return np.asarray(points[int(np.argmin(costs))], dtype=np.float64)


def _exact_columns(
    problem: Problem, free: Sequence[ParameterCandidate], x: Floats, finite: Sequence[Floats] | None
) -> tuple[int, ...]:
    """Candidates whose exact derivatives agree with differences over the switching instants."""
    if problem.fidelity != "low":
        return ()
    chosen = [k for k, item in enumerate(free) if item.kind == "parameter"]
    if not chosen:
        return ()
    if finite is None:
        finite = problem.jacobian(free, x, step_sizes(free))
    dual = _exact(problem, free, x, chosen)
    agreeing = []
    for j, k in enumerate(chosen):
        a = np.concatenate([part[:, :, k].ravel() for part in finite])
        b = np.concatenate([part[:, :, j].ravel() for part in dual])
        if float(np.linalg.norm(a - b)) <= _AGREE * float(np.linalg.norm(a)):
            agreeing.append(k)
    return tuple(agreeing)


def _exact(
    problem: Problem, free: Sequence[ParameterCandidate], x: Floats, chosen: Sequence[int]
) -> list[Floats]:
    """Exact derivatives of the residual by the chosen candidates, (n, 2, len(chosen)) a log."""
    values = values_of(free, x)
    paths = [free[k].path for k in chosen]
    tied = "control.torque_constant"
    wanted = [*paths, tied] if problem.tied and "motor.emf_constant" in paths else paths
    jacobians = []
    for index, (log, scale, mask) in enumerate(
        zip(problem.logs, problem.scales, problem.masks, strict=True)
    ):
        by = problem.exact(index, values, wanted)
        part = np.empty((len(log.time), 2, len(paths)))
        for j, path in enumerate(paths):
            column = by[path] + (
                TORQUE_PER_FLUX * by[tied] if path == "motor.emf_constant" and tied in by else 0
            )
            inner = values[path] if free[chosen[j]].log_scale else 1.0
            part[:, :, j] = column * inner / np.array(scale)
        part[~mask] = 0.0
        jacobians.append(part)
    return jacobians


def _mixed(
    problem: Problem, free: Sequence[ParameterCandidate], x: Floats, exact: Sequence[int]
) -> list[Floats]:
    """Exact columns where they hold, differences over a batch for the others."""
    others = [k for k in range(len(free)) if k not in exact]
    parts = [np.empty((len(log.time), 2, len(free))) for log in problem.logs]
    if exact:
        for part, dual in zip(parts, _exact(problem, free, x, exact), strict=True):
            part[:, :, list(exact)] = dual
    if others:
        steps = step_sizes(free)
        for part, finite in zip(parts, _partial(problem, free, x, others, steps), strict=True):
            part[:, :, others] = finite
    return parts


def _partial(
    problem: Problem,
    free: Sequence[ParameterCandidate],
    x: Floats,
    others: Sequence[int],
    steps: Floats,
) -> list[Floats]:
    points = []
    for k in others:
        for sign in (1.0, -1.0):
            moved = x.copy()
            moved[k] += sign * steps[k]
            points.append(values_of(free, moved))
    runs = problem.simulate(points)
    parts = [np.empty((len(log.time), 2, len(others))) for log in problem.logs]
    for j, k in enumerate(others):
        up, down = problem.residual(runs[2 * j]), problem.residual(runs[2 * j + 1])
        for part, a, b in zip(parts, up, down, strict=True):
            part[:, :, j] = (a - b) / (2.0 * steps[k])
    return parts


def _covariance(
    problem: Problem, free: Sequence[ParameterCandidate], x: Floats
) -> tuple[Floats, float]:
    jac = problem.jacobian(free, x, step_sizes(free))
    residual = problem.residual(problem.simulate([values_of(free, x)])[0])
    blocks = blocks_of(problem, residual)
    size = len(free)
    normal = np.zeros((size, size))
    scores: list[Floats] = []
    inner: list[Any] = []
    for part, misfit, block, mask in zip(jac, residual, blocks, problem.masks, strict=True):
        weight = 1.0 / np.sqrt(1.0 + (misfit / _SOFT) ** 2)
        normal += np.einsum("ncp,nc,ncq->pq", part, weight**3, part)
        scores.append(np.einsum("ncp,nc->np", part, weight * misfit)[mask])
        inner.append(block[mask] - block[mask].min())
    return block_covariance(normal, scores, inner)
