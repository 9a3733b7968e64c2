"""Which faults explain the evidence: single faults and pairs, by a Gaussian in the evidence.

The evidence of a log is y = m + shift(severities) + r. The covariance of r sums the spread from
run to run, the noise within the log, what is not known of the healthy mean m, and the model's own
error, which grows with the shift. Integrals over severities are sums over grids, fine where the
likelihood is: with one or two severities that is exact to the grid, and no sampling is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from elevon.diagnose.bymodel.candidates import Candidate

__all__ = ["Hypothesis", "Posterior", "marginals", "posterior", "quantiles"]

Floats = npt.NDArray[np.float64]
PRIOR_FAULTY = 0.5  # ASSUMED: a log is diagnosed since somebody doubts
SECOND = 0.1  # ASSUMED: a faulty unit has a second fault
_COARSE = 401
_FINE = 121
_PAIR = 41
_REACH = 6.0  # deviations about the best point that a fine grid covers


@dataclass(frozen=True)
class Hypothesis:
    """A set of faults.

    Attributes
    ----------
    keys : tuple of str
        Faults; none for healthy.
    evidence : float
        Log of the marginal likelihood.
    prior : float
        Probability before.
    grids : tuple of ndarray
        Severities of each fault.
    weights : tuple of ndarray
        Marginal posterior of each fault's severity on its grid, summing to one.
    best : tuple of float
        Severities of the greatest posterior.
    """

    keys: tuple[str, ...]
    evidence: float
    prior: float
    grids: tuple[Floats, ...] = ()
    weights: tuple[Floats, ...] = ()
    best: tuple[float, ...] = ()


@dataclass(frozen=True)
class Posterior:
    """All hypotheses, most probable first, with their probabilities."""

    hypotheses: tuple[Hypothesis, ...]
    probabilities: tuple[float, ...]

    def of(self, key: str) -> float:
        """Return the marginal probability of a fault."""
        pairs = zip(self.hypotheses, self.probabilities, strict=True)
        return float(sum(p for h, p in pairs if key in h.keys))

    @property
    def faulty(self) -> float:
        """Probability of any fault."""
        pairs = zip(self.hypotheses, self.probabilities, strict=True)
        return float(sum(p for h, p in pairs if h.keys))


Shift = Callable[[str, Floats], Floats]


def posterior(
    rest: Floats, covariance: Floats, degrees: float, candidates: Sequence[Candidate], shift: Shift
) -> Posterior:
    """Weigh the hypotheses.

    Parameters
    ----------
    rest : ndarray, shape (k,)
        Evidence less its healthy mean.
    covariance : ndarray, shape (k, k)
        Of it, for a healthy unit.
    degrees : float
        Of freedom of Student's distribution: how well the spread is known.
    candidates : sequence of Candidate
        Faults.
    shift : callable
        Key and severities, shape (m,), to what they do to the evidence, shape (m, k).
    """
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    y = root @ rest
    whitened: Shift = lambda key, s: shift(key, s) @ root.T  # noqa: E731 - a closure of one line
    total = sum(c.rate for c in candidates)
    single = {c.key: PRIOR_FAULTY * (1.0 - SECOND) * c.rate / total for c in candidates}
    out = [Hypothesis((), float(_log_t(y[None, :], degrees)[0]), 1.0 - PRIOR_FAULTY)]
    ones = {}
    for c in candidates:
        ones[c.key] = _one(y, degrees, c, whitened, single[c.key])
        out.append(ones[c.key])
    weight = {(a.key, b.key): a.rate * b.rate for a, b in combinations(candidates, 2)}
    norm = sum(weight.values()) or 1.0
    for a, b in combinations(candidates, 2):
        prior = PRIOR_FAULTY * SECOND * weight[a.key, b.key] / norm
        out.append(_two(y, degrees, (a, b), whitened, prior))
    scores = np.array([h.evidence + np.log(h.prior) for h in out])
    probability = np.exp(scores - scores.max())
    probability /= probability.sum()
    order = np.argsort(-probability)
    return Posterior(tuple(out[k] for k in order), tuple(float(probability[k]) for k in order))


def _log_t(rest: Floats, degrees: float, *errors: Floats) -> Floats:
    """Log density of Student's distribution, shape (m,), but for a constant.

    Each fault's model error, shape (m, k), adds its outer product to the unit covariance.
    """
    square = np.sum(rest**2, axis=1)
    log_det: Floats = np.zeros(len(rest))
    if len(errors) == 1:
        own = 1.0 + np.sum(errors[0] ** 2, axis=1)
        square = square - np.sum(rest * errors[0], axis=1) ** 2 / own
        log_det = np.log(own)
    elif len(errors) == 2:
        a, b = (1.0 + np.sum(e**2, axis=1) for e in errors)
        c = np.sum(errors[0] * errors[1], axis=1)
        p, q = (np.sum(rest * e, axis=1) for e in errors)
        det = a * b - c**2
        square = square - (b * p**2 - 2.0 * c * p * q + a * q**2) / det
        log_det = np.log(det)
    power = 0.5 * (degrees + rest.shape[1])
    return np.asarray(-0.5 * log_det - power * np.log1p(square / degrees), dtype=np.float64)


def _one(y: Floats, degrees: float, c: Candidate, shift: Shift, prior: float) -> Hypothesis:
    grid = np.linspace(c.low, c.high, _COARSE)
    moved = shift(c.key, grid)
    best = float(grid[int(np.argmax(_log_t(y - moved, degrees, c.error * moved)))])
    fine = _around(best, _scale(c, shift, best), c)
    moved = shift(c.key, fine)
    log = _log_t(y - moved, degrees, c.error * moved)
    evidence, weight = _integrate(log, fine, c)
    return Hypothesis(
        (c.key,), evidence, prior, (fine,), (weight,), (float(fine[int(np.argmax(log))]),)
    )


def _scale(c: Candidate, shift: Shift, at: float) -> float:
    """Deviation of the severity at a point, by the slope of the shift; no more than the range."""
    step = 0.005 * (c.high - c.low)
    pair = np.clip(np.array([at - step, at + step]), c.low, c.high)
    low, high = shift(c.key, pair)
    slope = float(np.linalg.norm(high - low) / (pair[1] - pair[0]))
    own = c.error * float(np.linalg.norm(shift(c.key, np.array([at]))))
    return min(float(np.hypot(1.0, own)) / max(slope, 1e-12), c.high - c.low)


def _around(best: float, scale: float, c: Candidate, count: int = _FINE) -> Floats:
    low, high = max(c.low, best - _REACH * scale), min(c.high, best + _REACH * scale)
    return np.linspace(low, high, count)


def _integrate(log: Floats, grid: Floats, c: Candidate) -> tuple[float, Floats]:
    """Log of the mean likelihood over the candidate's range, and the weights on the grid."""
    width = np.gradient(grid)
    top = float(log.max())
    mass = np.exp(log - top) * width
    total = float(mass.sum())
    return top + float(np.log(total / (c.high - c.low))), mass / total


def _two(
    y: Floats, degrees: float, pair: tuple[Candidate, Candidate], shift: Shift, prior: float
) -> Hypothesis:
    first, second = pair
    best = _start(y, degrees, pair, shift)
    grids = [_around(b, 1.5 * _joint(pair, shift, best)[k], c, _PAIR)
             for k, (b, c) in enumerate(zip(best, pair, strict=True))]  # fmt: skip
    left, right = shift(first.key, grids[0]), shift(second.key, grids[1])
    log = _of_both(y, degrees, pair, left, right)
    top = float(log.max())
    mass = np.exp(log - top) * np.outer(np.gradient(grids[0]), np.gradient(grids[1]))
    total = float(mass.sum())
    range_ = (first.high - first.low) * (second.high - second.low)
    at = np.unravel_index(int(np.argmax(log)), log.shape)
    return Hypothesis(
        (first.key, second.key),
        top + float(np.log(total / range_)),
        prior,
        tuple(grids),
        (mass.sum(axis=1) / total, mass.sum(axis=0) / total),
        (float(grids[0][at[0]]), float(grids[1][at[1]])),
    )


def _of_both(
    y: Floats, degrees: float, pair: tuple[Candidate, Candidate], left: Floats, right: Floats
) -> Floats:
    """Log density at every pair of two faults' shifts, shape (m, n)."""
    shape = (len(left), len(right), len(y))
    first = np.broadcast_to(left[:, None, :], shape).reshape(-1, len(y))
    second = np.broadcast_to(right[None, :, :], shape).reshape(-1, len(y))
    rest = y - first - second
    log = _log_t(rest, degrees, pair[0].error * first, pair[1].error * second)
    return log.reshape(shape[:2])


def _start(
    y: Floats, degrees: float, pair: tuple[Candidate, Candidate], shift: Shift
) -> tuple[float, float]:
    """Coarse search on a grid that is dense near zero, then along each severity in turn."""
    grids = [_dense(c) for c in pair]
    tables = [shift(c.key, g) for c, g in zip(pair, grids, strict=True)]
    log = _of_both(y, degrees, pair, *tables)
    at = np.unravel_index(int(np.argmax(log)), log.shape)
    best = [float(grids[0][at[0]]), float(grids[1][at[1]])]
    for _ in range(6):
        for k in (0, 1):
            line = np.linspace(pair[k].low, pair[k].high, _COARSE)
            other = shift(pair[1 - k].key, np.array([best[1 - k]]))
            row = shift(pair[k].key, line)
            still = np.broadcast_to(pair[1 - k].error * other, row.shape)
            log = _log_t(y - row - other, degrees, pair[k].error * row, still)
            best[k] = float(line[int(np.argmax(log))])
    return best[0], best[1]


def _dense(c: Candidate) -> Floats:
    steps = np.linspace(0.0, 1.0, 21) ** 2
    low = c.low * steps[:0:-1] if c.low < 0.0 else np.zeros(0)
    return np.concatenate((low, c.high * steps))


def _joint(
    pair: tuple[Candidate, Candidate], shift: Shift, best: tuple[float, float]
) -> tuple[float, float]:
    """Deviations of the two severities when both are free."""
    columns, own = [], 0.0
    for c, b in zip(pair, best, strict=True):
        step = 0.005 * (c.high - c.low)
        ends = np.clip(np.array([b - step, b + step]), c.low, c.high)
        low, high = shift(c.key, ends)
        columns.append((high - low) / (ends[1] - ends[0]))
        own += c.error**2 * float(np.sum(shift(c.key, np.array([b])) ** 2))
    design = np.column_stack(columns)
    scale = np.maximum(np.linalg.norm(design, axis=0), 1e-12)
    inverse = np.linalg.pinv((design / scale).T @ (design / scale), rcond=1e-6, hermitian=True)
    size = np.sqrt(np.maximum(np.diag(inverse), 1.0) * (1.0 + own)) / scale
    widths = [c.high - c.low for c in pair]
    return min(float(size[0]), widths[0]), min(float(size[1]), widths[1])


def marginals(result: Posterior, key: str) -> tuple[Floats, Floats]:
    """Severities and weights of one fault, over all hypotheses that hold it."""
    grids, weights = [], []
    for h, p in zip(result.hypotheses, result.probabilities, strict=True):
        if key in h.keys:
            k = h.keys.index(key)
            grids.append(h.grids[k])
            weights.append(p * h.weights[k])
    grid, weight = np.concatenate(grids), np.concatenate(weights)
    order = np.argsort(grid)
    return grid[order], weight[order] / max(float(weight.sum()), 1e-300)


def quantiles(grid: Floats, weight: Floats, at: Sequence[float]) -> list[float]:
    """Quantiles of weighted points."""
    below = np.cumsum(weight) - 0.5 * weight
    return [float(np.interp(q, below, grid)) for q in at]
