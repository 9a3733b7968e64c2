"""Marginal likelihood of one fault or two: search on coarse grids, integration on fine ones.

A fault's model error has two parts: one that scales the whole shift (`CandidateFault.error`),
carried exactly by the matrix determinant lemma, and one of each number on its own (what the current
loop makes of a ripple, say), carried at the best severities, which are searched again with it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.engine.candidates import CandidateFault

Shift = Callable[[str, Floats], Floats]
SMALL = 0.05  # of the range: ASSUMED; severities below it are as frequent as each other
_COARSE = 401
_FINE = 121
_PAIR = 41
_REACH = 6.0  # deviations about the best point that a fine grid covers
_WIDE = (3.0, 10.0, 30.0)  # deviations by which something else moves the features. ASSUMED
_FEW = 8  # features that something else moves, at most, where it does not move all
_TURNS = 4  # of the search along one severity, then the other


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
class Frame:
    """Features less its healthy mean, and what whitens it.

    Attributes
    ----------
    residual : ndarray, shape (k,)
        As it is.
    covariance : ndarray, shape (k, k)
        Of it.
    degrees : float
        Of Student's distribution.
    raw : callable
        Key and severities, shape (m,), to shifts, shape (m, k).
    errors : ndarray, shape (k,)
        Deviation of each number's shift on its own, as a share of it.
    uncertainty : callable, optional
        Key and severity to a deviation of the features, shape (k,), beside that.
    """

    residual: Floats
    covariance: Floats
    degrees: float
    raw: Shift
    errors: Floats
    uncertainty: Callable[[str, float], Floats] | None = None
    root: Floats = field(init=False)
    y: Floats = field(init=False)
    log_det: float = field(init=False)
    lines: dict[str, tuple[Floats, Floats]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        lower = np.linalg.cholesky(self.covariance)
        object.__setattr__(self, "root", np.linalg.inv(lower))
        object.__setattr__(self, "y", self.root @ self.residual)
        object.__setattr__(self, "log_det", 2.0 * float(np.sum(np.log(np.diag(lower)))))

    def shift(self, key: str, severity: Floats) -> Floats:
        """Whitened."""
        return self.raw(key, severity) @ self.root.T

    def line(self, c: CandidateFault) -> tuple[Floats, Floats]:
        """Severities over the whole range, and their whitened shifts."""
        if c.key not in self.lines:
            grid = np.linspace(c.low, c.high, _COARSE)
            self.lines[c.key] = (grid, self.raw(c.key, grid))
        grid, raw = self.lines[c.key]
        return grid, raw @ self.root.T

    def loosened(self, faults: Sequence[tuple[CandidateFault, float]]) -> Frame:
        """Return the frame with each number's own model error at these severities."""
        extra = np.zeros(len(self.residual))
        for c, severity in faults:
            extra += (self.errors * self.raw(c.key, np.array([severity]))[0]) ** 2
            if self.uncertainty is not None:
                extra += self.uncertainty(c.key, severity) ** 2
        return replace(self, covariance=self.covariance + np.diag(extra))

    def log(self, residual: Floats, *errors: Floats) -> Floats:
        """Log density of Student's distribution, shape (m,), but for a constant.

        Each fault's model error, shape (m, k), adds its outer product to the unit covariance.
        """
        square = np.einsum("mk,mk->m", residual, residual)
        log_det: Floats = np.full(len(residual), self.log_det)
        if len(errors) == 1:
            factor = 1.0 + np.einsum("mk,mk->m", errors[0], errors[0])
            square = square - np.einsum("mk,mk->m", residual, errors[0]) ** 2 / factor
            log_det = log_det + np.log(factor)
        elif len(errors) == 2:
            a, b = (1.0 + np.einsum("mk,mk->m", e, e) for e in errors)
            c = np.einsum("mk,mk->m", *errors)
            p, q = (np.einsum("mk,mk->m", residual, e) for e in errors)
            det = a * b - c**2
            square = square - (b * p**2 - 2.0 * c * p * q + a * q**2) / det
            log_det = log_det + np.log(det)
        power = 0.5 * (self.degrees + residual.shape[1])
        return np.asarray(
            -0.5 * log_det - power * np.log1p(square / self.degrees), dtype=np.float64
        )


def healthy_alone(frame: Frame, prior: float) -> Hypothesis:
    """Return the hypothesis of no fault."""
    return Hypothesis((), float(frame.log(frame.y[None, :])[0]), prior)


def outside(frame: Frame) -> float:
    """Log of the marginal likelihood of something else: it moves all features, or a few of them."""
    ways = [log for wide in _WIDE for log in (_everywhere(frame, wide), _somewhere(frame, wide))]
    return float(np.logaddexp.reduce(ways) - np.log(len(ways)))


def _everywhere(frame: Frame, wide: float) -> float:
    """Every feature deviates by so much."""
    power = 0.5 * (frame.degrees + len(frame.y))
    square = float(frame.y @ frame.y) / wide**2 / frame.degrees
    return (
        -0.5 * frame.log_det - len(frame.y) * float(np.log(wide)) - power * float(np.log1p(square))
    )


def _somewhere(frame: Frame, wide: float) -> float:
    """A few features deviate by so much: one as likely as more together, any of them alike.

    Of each number of features only the best set counts, found one after the other: less than the
    sum over all sets, so something else is never favoured.
    """
    count, power = len(frame.y), 0.5 * (frame.degrees + len(frame.y))
    y, log_det = frame.y.copy(), frame.log_det
    moved = frame.root * (wide * np.sqrt(np.diag(frame.covariance)))
    free, logs, sets = np.ones(count, dtype=np.bool_), [], 0.0
    for n in range(1, min(count, _FEW) + 1):
        norm = 1.0 + np.sum(moved**2, axis=0)
        square = float(y @ y) - (y @ moved) ** 2 / norm
        log = -0.5 * (log_det + np.log(norm)) - power * np.log1p(square / frame.degrees)
        at = int(np.argmax(np.where(free, log, -np.inf)))
        sets += float(np.log((count - n + 1) / n))
        logs.append(float(log[at]) - n * np.log(2.0) - sets)
        # Whitened again, with this one's deviation in the covariance.
        way, size = moved[:, at].copy(), float(norm[at])
        share = (1.0 / np.sqrt(size) - 1.0) / (size - 1.0)
        y, moved = y + share * way * (way @ y), moved + share * np.outer(way, way @ moved)
        log_det, free[at] = log_det + float(np.log(size)), False
    return float(np.logaddexp.reduce(logs))


def one_fault(frame: Frame, c: CandidateFault, prior: float) -> Hypothesis:
    """Return the hypothesis of one fault."""
    at, local = 0.0, frame
    for _ in range(2):
        grid, moved = local.line(c)
        at = float(grid[int(np.argmax(local.log(local.y - moved, c.error * moved)))])
        local = frame.loosened([(c, at)])
    fine = _around(at, _joint(local, [c], [at])[0], c, _FINE)
    moved = local.shift(c.key, fine)
    log = local.log(local.y - moved, c.error * moved)
    top = float(log.max())
    mass = np.exp(log - top) * np.gradient(fine) * prior_density(c, fine)
    total = float(mass.sum())
    evidence = top + float(np.log(total))
    best = float(fine[int(np.argmax(log))])
    return Hypothesis((c.key,), evidence, prior, (fine,), (mass / total,), (best,))


def two_faults(
    frame: Frame, pair: tuple[CandidateFault, CandidateFault], prior: float
) -> Hypothesis:
    """Return the hypothesis of two faults; their shifts add."""
    first, second = pair
    at = _start(frame, pair)
    local = frame.loosened(list(zip(pair, at, strict=True)))
    at = _along(local, pair, at)
    local = frame.loosened(list(zip(pair, at, strict=True)))
    widths = _joint(local, pair, at)
    grids = [_around(b, 1.5 * w, c, _PAIR) for b, w, c in zip(at, widths, pair, strict=True)]
    log = _of_both(local, pair, local.shift(first.key, grids[0]), local.shift(second.key, grids[1]))
    top = float(log.max())
    sides = [np.gradient(g) * prior_density(c, g) for g, c in zip(grids, pair, strict=True)]
    mass = np.exp(log - top) * np.outer(*sides)
    total = float(mass.sum())
    peak = np.unravel_index(int(np.argmax(log)), log.shape)
    return Hypothesis(
        (first.key, second.key),
        top + float(np.log(total)),
        prior,
        tuple(grids),
        (mass.sum(axis=1) / total, mass.sum(axis=0) / total),
        (float(grids[0][peak[0]]), float(grids[1][peak[1]])),
    )


def second_faults(
    frame: Frame, first: CandidateFault, at: float, candidates: Sequence[CandidateFault]
) -> dict[str, float]:
    """Return the best log density of each other fault beside a first one, by key; coarse."""
    local = frame.loosened([(first, at)])
    moved = local.shift(first.key, np.array([at]))
    out = {}
    for c in candidates:
        if c.key == first.key:
            continue
        grid, raw = frame.lines[c.key]
        row = raw[_dense(grid)] @ local.root.T
        fixed_error = np.broadcast_to(first.error * moved, row.shape)
        out[c.key] = float(local.log(local.y - moved - row, c.error * row, fixed_error).max())
    return out


def prior_density(c: CandidateFault, severity: Floats) -> Floats:
    """Density of a severity before the log: it grows, so each passes the small ones first.

    Proportional to 1/(|s| + s0) over the range, s0 a part of it: as often in each octave, but for
    the smallest.
    """
    low, high = abs(c.low), c.high
    least = SMALL * max(low, high)
    norm = float(np.log1p(high / least) + (np.log1p(low / least) if low else 0.0))
    return 1.0 / ((np.abs(severity) + least) * norm)


def _around(best: float, scale: float, c: CandidateFault, count: int) -> Floats:
    if c.switched:  # its likelihood is a step, which no width describes
        return np.linspace(c.low, c.high, count)
    low, high = max(c.low, best - _REACH * scale), min(c.high, best + _REACH * scale)
    return np.linspace(low, high, count)


def _of_both(
    frame: Frame, pair: tuple[CandidateFault, CandidateFault], left: Floats, right: Floats
) -> Floats:
    """Log density at every pair of two faults' whitened shifts, shape (m, n)."""
    shape = (len(left), len(right), len(frame.y))
    first = np.broadcast_to(left[:, None, :], shape).reshape(-1, len(frame.y))
    second = np.broadcast_to(right[None, :, :], shape).reshape(-1, len(frame.y))
    residual = frame.y - first - second
    log = frame.log(residual, pair[0].error * first, pair[1].error * second)
    return log.reshape(shape[:2])


def _start(frame: Frame, pair: tuple[CandidateFault, CandidateFault]) -> tuple[float, float]:
    """Coarse search on a grid that is dense near zero, then along each severity in turn."""
    lines = [frame.line(c) for c in pair]
    picks = [_dense(grid) for grid, _ in lines]
    log = _of_both(frame, pair, lines[0][1][picks[0]], lines[1][1][picks[1]])
    at = np.unravel_index(int(np.argmax(log)), log.shape)
    first, second = (float(lines[k][0][picks[k][at[k]]]) for k in (0, 1))
    return _along(frame, pair, (first, second))


def _along(
    frame: Frame, pair: tuple[CandidateFault, CandidateFault], start: tuple[float, float]
) -> tuple[float, float]:
    """Search along each severity in turn."""
    best = list(start)
    lines = [frame.line(c) for c in pair]
    for _ in range(_TURNS):
        before = tuple(best)
        for k in (0, 1):
            grid, row = lines[k]
            other = frame.shift(pair[1 - k].key, np.array([best[1 - k]]))
            fixed_error = np.broadcast_to(pair[1 - k].error * other, row.shape)
            log = frame.log(frame.y - row - other, pair[k].error * row, fixed_error)
            best[k] = float(grid[int(np.argmax(log))])
        if tuple(best) == before:
            break
    return best[0], best[1]


def _dense(grid: Floats) -> npt.NDArray[np.intp]:
    """Points of a line that lie denser near zero."""
    steps = np.linspace(0.0, 1.0, 21) ** 2
    low = grid[0] * steps[:0:-1] if grid[0] < 0.0 else np.zeros(0)
    wanted = np.concatenate((low, grid[-1] * steps))
    return np.unique(np.searchsorted(grid, wanted).clip(0, len(grid) - 1))


def _joint(frame: Frame, faults: Sequence[CandidateFault], at: Sequence[float]) -> list[float]:
    """Deviations of the severities when all are free; no more than each range."""
    columns, error = [], 0.0
    for c, b in zip(faults, at, strict=True):
        step = 0.005 * (c.high - c.low)
        ends = np.clip(np.array([b - step, b + step]), c.low, c.high)
        low, high = frame.shift(c.key, ends)
        columns.append((high - low) / (ends[1] - ends[0]))
        error += c.error**2 * float(np.sum(frame.shift(c.key, np.array([b])) ** 2))
    design = np.column_stack(columns)
    scale = np.maximum(np.linalg.norm(design, axis=0), 1e-12)
    inverse = np.linalg.pinv((design / scale).T @ (design / scale), rcond=1e-6, hermitian=True)
    size = np.sqrt(np.maximum(np.diag(inverse), 1.0) * (1.0 + error)) / scale
    return [min(float(s), c.high - c.low) for s, c in zip(size, faults, strict=True)]
