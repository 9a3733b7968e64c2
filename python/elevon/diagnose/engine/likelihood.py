"""Marginal likelihood of one fault or two: search on coarse grids, integration on fine ones.

A fault's model error has three parts: one that scales the whole shift (`CandidateFault.error`),
carried exactly by the matrix determinant lemma, one of each number on its own (what the current
loop makes of a ripple, say), and strays: a few numbers that the fault moves although the model does
not, or not so, by a share of its whole shift. The latter two are carried at the best severities,
which are searched again with them: a short's interval is 15 % wider than with errors that grow with
its severity, and its upper end half a deviation higher.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.engine.candidates import CandidateFault

Shift = Callable[[str, Floats], Floats]
_COARSE = 401
#: Deviation of a stray, as a share of a fault's whole shift; probability that there is one, one as
#: likely as more together. ASSUMED: an output that flies in its backlash or a load that swings
#: back with it is not in the reduced-order model; what it knows of one number it errs by as much.
STRAY = 0.15
_STRAYED = 0.1
_MOST = 4


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
        from scipy.linalg.lapack import dtrtri

        lower = np.linalg.cholesky(self.covariance)
        object.__setattr__(self, "root", dtrtri(lower, lower=1)[0])
        object.__setattr__(self, "y", self.root @ self.residual)
        object.__setattr__(self, "log_det", 2.0 * float(np.sum(np.log(np.diag(lower)))))

    def shift(self, key: str, severity: Floats) -> Floats:
        """Whitened."""
        return self.raw(key, severity) @ self.root.T

    def line(self, c: CandidateFault) -> tuple[Floats, Floats]:
        """Severities over the whole range, and their whitened shifts."""
        if c.key not in self.lines:
            grid = c.range(_COARSE)
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

    def strayed(self, left: Floats, wide: Floats) -> tuple[Frame, float] | None:
        """Return the frame with the strays that explain best what is left, and their log prior.

        Parameters
        ----------
        left : ndarray, shape (k,)
            Whitened.
        wide : ndarray, shape (k,)
            Deviations of a stray.
        """
        square = np.log1p(float(left @ left) / self.degrees)
        top = -0.5 * self.log_det - 0.5 * (self.degrees + len(left)) * float(square)
        places, best = [], []
        prior = float(np.log(_STRAYED))
        for at, log, sets in greedy(self, left, wide, _MOST):
            places.append(at)
            rare = prior - len(places) * float(np.log(2.0)) - sets
            if log + rare > top:
                top, best, chosen_prior = log + rare, list(places), rare
        if not best:
            return None
        extra = np.zeros(len(left))
        extra[best] = wide[best] ** 2
        return replace(self, covariance=self.covariance + np.diag(extra)), chosen_prior

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


def greedy(
    frame: Frame, left: Floats, wide: Floats, most: int
) -> Iterator[tuple[int, float, float]]:
    """Give features a deviation, shape (k,), one after the other, the best first.

    Yields each one's place, the log density with all so far, and the log of how many sets of as
    many there are.
    """
    count, power = len(left), 0.5 * (frame.degrees + len(left))
    y, log_det = left.copy(), frame.log_det
    moved = frame.root * wide
    free, sets = np.ones(count, dtype=np.bool_), 0.0
    for n in range(1, min(count, most) + 1):
        norm = 1.0 + np.sum(moved**2, axis=0)
        square = float(y @ y) - (y @ moved) ** 2 / norm
        log = -0.5 * (log_det + np.log(norm)) - power * np.log1p(square / frame.degrees)
        at = int(np.argmax(np.where(free, log, -np.inf)))
        sets += float(np.log((count - n + 1) / n))
        yield at, float(log[at]), sets
        # Whitened again, with this one's deviation in the covariance.
        way, size = moved[:, at].copy(), float(norm[at])
        if size > 1.0:
            share = (1.0 / np.sqrt(size) - 1.0) / (size - 1.0)
            y, moved = y + share * way * (way @ y), moved + share * np.outer(way, way @ moved)
        log_det, free[at] = log_det + float(np.log(size)), False


def stray_of(covariance: Floats, shifts: Sequence[Floats]) -> Floats:
    """Return a stray's deviation of each feature beside shifts of shape (k,): shape (k,)."""
    moved = np.sum(shifts, axis=0)
    size = np.sqrt(float(moved @ np.linalg.solve(covariance, moved)))
    return np.asarray(STRAY * size * np.sqrt(np.diag(covariance)), dtype=np.float64)


SMALL = 0.05  # of the range: ASSUMED; severities below it are as frequent as each other
_FINE = 121
_PAIR = 41
_REACH = 6.0  # deviations about the best point that a fine grid covers
_WIDE = (3.0, 10.0, 30.0)  # deviations by which something else moves the features. ASSUMED
_FEW = 8  # features that something else moves, at most, where it does not move all
_NEAR = 5.0  # log density below the best one up to which a severity of the other sign counts
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
    std = wide * np.sqrt(np.diag(frame.covariance))
    steps = enumerate(greedy(frame, frame.y, std, _FEW), 1)
    return float(np.logaddexp.reduce([log - n * np.log(2.0) - sets for n, (_, log, sets) in steps]))


def one_fault(frame: Frame, c: CandidateFault, prior: float) -> Hypothesis:
    """Return the hypothesis of one fault."""
    at, local = 0.0, frame
    for _ in range(2):
        at = _best_of(local, c)
        local = frame.loosened([(c, at)])
    plain = _one(local, c, at, prior)
    looser = _with_strays(frame, local, [c], [at])
    if looser is None:
        return plain
    other = _one(looser[0], c, _best_of(looser[0], c), prior, looser[1])
    return max(plain, other, key=lambda h: h.evidence)


def _best_of(frame: Frame, c: CandidateFault) -> float:
    """Severity of the greatest density on the line of the whole range."""
    grid, moved = frame.line(c)
    return float(grid[int(np.argmax(frame.log(frame.y - moved, c.error * moved)))])


def _one(local: Frame, c: CandidateFault, at: float, prior: float, rare: float = 0.0) -> Hypothesis:
    """Integrate about a severity; `rare` is the log prior of what else is assumed.

    Where the logs hardly tell the sign, about the best one of the other sign, too.
    """
    fine = _around(at, _joint(local, [c], [at])[0], c, _FINE)
    mirrored = _other_sign(local, c, at)
    if mirrored is not None:
        other = _around(mirrored, _joint(local, [c], [mirrored])[0], c, _FINE)
        fine = np.unique(np.concatenate((fine, other)))
    moved = local.shift(c.key, fine)
    log = local.log(local.y - moved, c.error * moved)
    top = float(log.max())
    mass = np.exp(log - top) * _steps(fine) * prior_density(c, fine)
    total = float(mass.sum())
    evidence = top + float(np.log(total)) + rare
    best = float(fine[int(np.argmax(log))])
    return Hypothesis((c.key,), evidence, prior, (fine,), (mass / total,), (best,))


def _other_sign(frame: Frame, c: CandidateFault, at: float) -> float | None:
    """Best severity of the other sign, where it is not much less likely."""
    if c.low >= 0.0 or at == 0.0:
        return None
    grid, moved = frame.line(c)
    log = frame.log(frame.y - moved, c.error * moved)
    across = np.where(grid * at < 0.0, log, -np.inf)
    k = int(np.argmax(across))
    inside = 0 < k < len(grid) - 1 and abs(grid[k]) > SMALL * abs(at)
    return float(grid[k]) if inside and across[k] > log.max() - _NEAR else None


def _with_strays(
    frame: Frame, local: Frame, faults: Sequence[CandidateFault], at: Sequence[float]
) -> tuple[Frame, float] | None:
    """Return the local frame with strays of faults at these severities, and their log prior."""
    pairs = list(zip(faults, at, strict=True))
    wide = stray_of(frame.covariance, [frame.raw(c.key, np.array([b]))[0] for c, b in pairs])
    left = local.y - sum(local.shift(c.key, np.array([b]))[0] for c, b in pairs)
    return local.strayed(left, wide)


def two_faults(
    frame: Frame, pair: tuple[CandidateFault, CandidateFault], prior: float
) -> Hypothesis:
    """Return the hypothesis of two faults; their shifts add."""
    at = _start(frame, pair)
    local = frame.loosened(list(zip(pair, at, strict=True)))
    at = _along(local, pair, at)
    local = frame.loosened(list(zip(pair, at, strict=True)))
    plain = _two(local, pair, at, prior)
    looser = _with_strays(frame, local, pair, at)
    if looser is None:
        return plain
    other = _two(looser[0], pair, _along(looser[0], pair, at), prior, looser[1])
    return max(plain, other, key=lambda h: h.evidence)


def _two(
    local: Frame,
    pair: tuple[CandidateFault, CandidateFault],
    at: tuple[float, float],
    prior: float,
    rare: float = 0.0,
) -> Hypothesis:
    """Integrate about two severities."""
    first, second = pair
    widths = _joint(local, pair, at)
    grids = [_around(b, 1.5 * w, c, _PAIR) for b, w, c in zip(at, widths, pair, strict=True)]
    log = _of_both(local, pair, local.shift(first.key, grids[0]), local.shift(second.key, grids[1]))
    top = float(log.max())
    sides = [_steps(g) * prior_density(c, g) for g, c in zip(grids, pair, strict=True)]
    mass = np.exp(log - top) * np.outer(*sides)
    total = float(mass.sum())
    peak = np.unravel_index(int(np.argmax(log)), log.shape)
    return Hypothesis(
        (first.key, second.key),
        top + float(np.log(total)) + rare,
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
    if c.whole:  # counts; of what is there or not the likelihood is a step without a width
        return c.range(count)
    low, high = max(c.low, best - _REACH * scale), min(c.high, best + _REACH * scale)
    return np.linspace(low, high, count)


def _steps(grid: Floats) -> Floats:
    """Width of each severity's part of a grid; a single count has one."""
    return np.gradient(grid) if len(grid) > 1 else np.ones(1)


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
