"""Fit of residuals: scipy's bounded least squares, robust, with what is believed before the data.

Every fit of the package that is not linear in its numbers goes through `fit_residual`, except where
the model runs in lanes (`elevon.estimate.lanes`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from elevon.arrays import Floats, Ints
from elevon.estimate.covariance import Strokes, block_covariance, numbered_strokes
from elevon.estimate.free import Free, bounds, inner, outer
from elevon.estimate.number import Determined, Estimate

Loss = Literal["linear", "soft_l1", "huber"]
Residual = Callable[[Floats], Floats]
_INSIDE = 1e-9  # of the bounds' distance, by which a start lies within them
_SOFT = 2.0  # deviations beyond which a residual of a balance weighs less
_ROUNDS = 12  # of the balance's own spread
_CLOSE = 1e-10  # relative: of cost and step of a balance
_SETTLED = 1e-6  # relative change of that spread
_COUNTED = 3  # numbers that a balance is taken to determine from the data alone
_DETERMINED = 0.15  # of what is believed: a deviation below which a number is determined
_MAD = 1.4826  # deviation over median size, of a normal distribution


@dataclass(frozen=True)
class ResidualFit:
    """The solution.

    Attributes
    ----------
    x : ndarray, shape (p,)
        Fitted variables.
    residual : ndarray, shape (n,)
        At the solution, in the caller's units.
    jacobian : ndarray, shape (n, p)
        Its derivatives.
    weight, curvature : ndarray, shape (n,)
        What the robust loss leaves of each residual, and of its square.
    cost : float
        Robust cost.
    evaluations : int
        Of the residual, by the optimiser.
    converged : bool
        Whether it met its tolerance.
    """

    x: Floats
    residual: Floats
    jacobian: Floats
    weight: Floats
    curvature: Floats
    cost: float
    evaluations: int
    converged: bool

    def covariance(
        self,
        blocks: Ints,
        *,
        prior: Floats | None = None,
        counted: int | None = None,
    ) -> tuple[Floats, float]:
        """Return the covariance of `x` from scores over blocks, and its degrees of freedom."""
        normal = (self.jacobian * self.curvature[:, None]).T @ self.jacobian
        scores = self.jacobian * (self.weight * self.residual)[:, None]
        return block_covariance(normal, scores, blocks, prior=prior, counted=counted)


def robust_weights(residual: Floats, loss: Loss, soft: float) -> tuple[Floats, Floats]:
    """Return weights of residuals, shape (n,), and of their squares' curvature."""
    size = np.abs(residual) / soft
    if loss == "soft_l1":
        weight = 1.0 / np.sqrt(1.0 + size**2)
        return weight, weight**3
    if loss == "huber":
        return 1.0 / np.maximum(1.0, size), (size <= 1.0).astype(np.float64)
    return np.ones_like(size), np.ones_like(size)


def fit_residual(
    residual: Residual,
    start: Floats | Sequence[float],
    *,
    ends: tuple[Floats, Floats] | None = None,
    jacobian: Callable[[Floats], Floats] | str = "2-point",
    loss: Loss = "linear",
    soft: float = 1.0,
    scale: Floats | float = 1.0,
    belief: Floats | None = None,
    most: int | None = None,
    tolerance: float = 1e-8,
) -> ResidualFit:
    """Fit by robust least squares.

    Parameters
    ----------
    residual : callable
        From fitted variables, shape (p,), to residuals, shape (n,).
    start : ndarray, shape (p,)
        First point; brought inside the bounds.
    ends : (ndarray, ndarray), optional
        Bounds, shape (p,) each.
    jacobian : callable or str
        Derivatives, shape (n, p), or ``2-point`` or ``3-point``.
    loss : str
        ``linear``, ``soft_l1`` or ``huber``.
    soft : float
        Residual beyond which the loss grows less than a square.
    scale : ndarray, shape (p,), or float
        Size of a step that matters.
    belief : ndarray, shape (p,), optional
        What is believed before, with a deviation of one; never robust.
    most : int, optional
        Evaluations at most.
    tolerance : float
        Relative, of cost, step and gradient.
    """
    from scipy.optimize import least_squares

    first = np.asarray(start, dtype=np.float64)
    options: dict[str, Any] = {}
    if ends is not None:
        margin = np.where(np.isfinite(ends[1] - ends[0]), _INSIDE * (ends[1] - ends[0]), 0.0)
        first = np.clip(first, ends[0] + margin, ends[1] - margin)
        options["bounds"] = ends
    whole, slopes, count = _with_belief(residual, jacobian, belief)
    jac: Any = slopes
    best = least_squares(
        whole, first, jac=jac, loss=_partly(loss, count), f_scale=soft, x_scale=scale,
        max_nfev=most, ftol=tolerance, xtol=tolerance, gtol=tolerance, **options,
    )  # fmt: skip
    rows = slice(None) if belief is None else slice(0, len(best.fun) - count)
    misfit = np.asarray(best.fun[rows], dtype=np.float64)
    weight, curvature = robust_weights(misfit, loss, soft)
    # scipy returns the derivatives of its own weighted problem: what it multiplied by is undone.
    factor = np.sqrt(np.maximum(curvature, np.finfo(np.float64).eps))
    derivatives = np.asarray(best.jac, dtype=np.float64)[rows] / factor[:, None]
    return ResidualFit(
        np.asarray(best.x, dtype=np.float64), misfit, derivatives, weight, curvature,
        float(best.cost), int(best.nfev), bool(best.success),
    )  # fmt: skip


def _with_belief(
    residual: Residual, jacobian: Callable[[Floats], Floats] | str, belief: Floats | None
) -> tuple[Residual, Callable[[Floats], Floats] | str, int]:
    """Residual and derivatives with one row more a parameter, and how many rows that is."""
    if belief is None:
        return residual, jacobian, 0
    count = len(belief)

    def whole(x: Floats) -> Floats:
        return np.concatenate((residual(x), x - belief))

    if isinstance(jacobian, str):
        return whole, jacobian, count
    slopes = jacobian
    return whole, lambda x: np.vstack((slopes(x), np.eye(count))), count


def _partly(loss: Loss, count: int) -> Any:
    """Return scipy's loss, but linear in the last rows."""
    if count == 0 or loss == "linear":
        return loss

    def rho(z: Floats) -> Floats:
        values = np.stack((z, np.ones_like(z), np.zeros_like(z)))
        body = z[:-count]
        if loss == "soft_l1":
            root = np.sqrt(1.0 + body)
            values[:, :-count] = 2.0 * root - 2.0, 1.0 / root, -0.5 / root**3
        else:
            root = np.sqrt(np.maximum(body, 1.0))
            beyond = np.stack((2.0 * root - 1.0, 1.0 / root, -0.5 / root**3))
            values[:, :-count] = np.where(body > 1.0, beyond, values[:, :-count])
        return values

    return rho


@dataclass(frozen=True)
class BalanceFit:
    """A balance fitted: numbers, their deviations and degrees of freedom, the residual's RMS."""

    free: tuple[Free, ...]
    x: Floats
    covariance: Floats
    degrees: float
    residual: float

    @property
    def values(self) -> Floats:
        """SI, shape (p,)."""
        return np.array(list(outer(self.free, self.x).values()))

    @property
    def std(self) -> Floats:
        """Deviations, in spreads of what is believed before, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))

    def widened(self, *moved: Floats) -> BalanceFit:
        """Return it with what other choices would move, each shape (p,), in spreads."""
        more = np.diag(np.sum([np.square(row) for row in moved], axis=0))
        return replace(self, covariance=self.covariance + more)

    def judged(self, why: Callable[[str], str], paths: Sequence[str] | None = None) -> Determined:
        """Return what is known far better than before, of some paths, and why the rest is not."""
        levels, reasons = {}, {}
        for item, x, std in zip(self.free, self.x, self.std, strict=True):
            if paths is not None and item.path not in paths:
                continue
            if std > _DETERMINED:
                reasons[item.path] = why(item.path)
            else:
                spread = item.spread * float(std)
                levels[item.path] = Estimate(item.outer(float(x)), spread, self.degrees)
        return levels, reasons


def fit_balance(
    free: Sequence[Free],
    data: Floats,
    model: Callable[[Floats], Floats],
    strokes: Sequence[Strokes],
    *,
    scale: float,
) -> BalanceFit:
    """Fit ``model(values)`` to `data`, outliers and a weak belief in the first values aside.

    The spread of the residuals, beyond which they weigh less, is their own.

    Parameters
    ----------
    free : sequence of Free
        First values, and spreads of what is believed before.
    data : ndarray, shape (n,)
        What the balance must give.
    model : callable
        From SI values, shape (p,), to shape (n,).
    strokes : sequence of (ndarray, ndarray, float)
        Instants and speeds of each log's samples in their order, and its period.
    scale : float
        First deviation of the residual.
    """
    spreads = np.array([item.spread for item in free])
    first = x = inner(free)
    for _ in range(_ROUNDS):
        fit = fit_residual(
            lambda point, scale=scale: (data - model(point * spreads)) / scale,  # type: ignore[misc]
            x, ends=bounds(free), jacobian="3-point", loss="huber", soft=_SOFT, belief=first,
            tolerance=_CLOSE,
        )  # fmt: skip
        x, spread = fit.x, scale * _MAD * float(np.median(np.abs(fit.residual)))
        if abs(spread - scale) < _SETTLED * scale:
            break
        scale = max(spread, 1e-12)
    blocks = numbered_strokes(strokes, fit.residual)
    covariance, degrees = fit.covariance(blocks, prior=np.eye(len(free)), counted=_COUNTED)
    rms = float(np.std(data - model(x * spreads)))
    return BalanceFit(tuple(free), x, covariance, max(degrees, 2.0), rms)
