"""Features less their healthy mean, whitened; what a fault's model error adds to their spread."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

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
