"""Two clocks brought together: the drive's trace and the load cell.

The trigger edge in the drive's trace marks the load cell's zero. Where there is no edge the two are
aligned by what they both saw. Either way the load cell's clock runs at its own speed, so a drift is
fitted too, with the uncertainty of both:

    time on the drive's clock = offset + (1 + drift) * time on the load cell's clock
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.bench.covariance import robust_covariance
from elevon.errors import InputError

__all__ = ["ClockFit", "TriggerEdge", "align_clocks", "find_trigger"]

FloatArray = npt.NDArray[np.float64]
_MOST_DRIFT = 0.02  # an RC oscillator's worst; a ceramic resonator is within 0.005
_LEAST_R2 = 0.25  # of the centred load-cell value explained by the drive's signals
_RIVAL = 1.5  # an offset that leaves less than this times the best one's variance is a rival
_SMOOTHING = 3.0  # periods of the slower clock
_LEAST_OVERLAP = 0.5  # of the shorter log


@dataclass(frozen=True, slots=True)
class TriggerEdge:
    """The first change of the trigger.

    Attributes
    ----------
    time : float
        Best estimate [s]: the middle of the sampling interval in which it happened.
    std : float
        Standard deviation [s]: uniform in that interval.
    later : int
        Changes after the first (bounces, or the trigger's end).
    """

    time: float
    std: float
    later: int


@dataclass(frozen=True, slots=True)
class ClockFit:
    """Relation of a second clock to the first.

    Attributes
    ----------
    offset, offset_std : float
        Seconds: where the second clock's zero lies on the first.
    drift, drift_std : float
        Relative: 1e-3 is a second clock that loses 1 ms a second. The drift is 0 with an infinite
        standard deviation where nothing determines it.
    method : str
        ``trigger``, ``correlation`` or ``trigger and correlation``.
    explained : float
        Share of the second log's variance explained by the first's signals; NaN for the trigger
        alone.
    """

    offset: float
    offset_std: float
    drift: float
    drift_std: float
    method: str
    explained: float

    def to_first(self, time: npt.ArrayLike) -> FloatArray:
        """Return times of the second clock on the first one."""
        second = np.asarray(time, dtype=np.float64)
        return np.asarray(self.offset + (1.0 + self.drift) * second, dtype=np.float64)


def find_trigger(time: npt.ArrayLike, trigger: npt.ArrayLike) -> TriggerEdge | None:
    """Find the first change of a trigger channel, whichever its levels and polarity.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds.
    trigger : array_like, shape (n,)
        The digital inputs' word; NaN where missing.

    Returns
    -------
    TriggerEdge or None
        None when the trigger never changes.
    """
    t, level = (np.asarray(a, dtype=np.float64) for a in (time, trigger))
    good = np.isfinite(level)
    t, level = t[good], level[good]
    changes = np.flatnonzero(np.diff(level) != 0.0)
    if not changes.size:
        return None
    before, after = float(t[changes[0]]), float(t[changes[0] + 1])
    std = (after - before) / math.sqrt(12.0)
    return TriggerEdge(0.5 * (before + after), std, int(changes.size) - 1)


def align_clocks(
    time: npt.ArrayLike,
    signals: npt.ArrayLike,
    second_time: npt.ArrayLike,
    value: npt.ArrayLike,
    *,
    edge: TriggerEdge | None = None,
) -> ClockFit:
    """Relate the load cell's clock to the drive's.

    Parameters
    ----------
    time : array_like, shape (n,)
        Drive's clock [s].
    signals : array_like, shape (n,) or (n, m)
        What the drive recorded of the same thing (torque current, speed, ...): the load cell's
        value is taken as a linear combination of these and a constant.
    second_time : array_like, shape (k,)
        Load cell's clock [s].
    value : array_like, shape (k,)
        Load cell's value.
    edge : TriggerEdge, optional
        From `find_trigger`: holds the offset to within its uncertainty.

    Returns
    -------
    ClockFit
        The drift is undetermined (infinite standard deviation) where the two logs share no motion.

    Raises
    ------
    InputError
        Too few samples, or neither an edge nor anything the two logs share.
    """
    t, x, s, y = _smoothed(*_arrays(time, signals, second_time, value))
    guess = _coarse(t, x, s, y, edge)
    fit = None if guess is None else _refine(t, x, s, y, guess=guess, edge=edge)
    if fit is not None and fit.explained >= _LEAST_R2:
        return fit
    if edge is None:
        seen = 0.0 if fit is None else fit.explained
        raise InputError(
            "synchronisation: the trigger never changes, and the drive's signals explain only "
            f"{100 * seen:.0f} % of the load cell's variance ({100 * _LEAST_R2:.0f} % needed)"
        )
    return ClockFit(edge.time, edge.std, 0.0, math.inf, "trigger", math.nan)


def _arrays(
    time: npt.ArrayLike, signals: npt.ArrayLike, second_time: npt.ArrayLike, value: npt.ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    t, s, y = (np.asarray(a, dtype=np.float64) for a in (time, second_time, value))
    x = np.asarray(signals, dtype=np.float64)
    x = x[:, None] if x.ndim == 1 else x
    if len(t) != len(x) or len(s) != len(y):
        raise InputError(
            f"synchronisation: {len(t)} instants for {len(x)} signal samples, "
            f"{len(s)} for {len(y)} values"
        )
    good, fine = np.isfinite(x).all(axis=1), np.isfinite(y)
    t, x, s, y = t[good], x[good], s[fine], y[fine]
    if min(len(t), len(s)) < 20:
        raise InputError(f"synchronisation: {len(t)} and {len(s)} samples; 20 of each are needed")
    spread = np.std(x, axis=0)
    return t, (x - x.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0), s, y


def _smoothed(
    t: FloatArray, x: FloatArray, s: FloatArray, y: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Pass both logs through one Gaussian filter of a few of the slower one's periods.

    Interpolated noise would make the misfit jagged in the offset; one filter on both sides leaves
    their linear relation as it is.
    """
    from scipy.ndimage import gaussian_filter1d

    steps = float(np.median(np.diff(t))), float(np.median(np.diff(s)))
    width = _SMOOTHING * max(steps)
    smooth_x = gaussian_filter1d(x, width / steps[0], axis=0, mode="nearest")
    return t, smooth_x, s, gaussian_filter1d(y, width / steps[1], mode="nearest")


def _coarse(
    t: FloatArray, x: FloatArray, s: FloatArray, y: FloatArray, edge: TriggerEdge | None
) -> float | None:
    """Offset that explains most, on a grid of the slower log's period; None without variation."""
    if np.std(y) == 0.0 or not np.any(np.std(x, axis=0) > 0.0):
        return None
    if edge is not None:
        return edge.time
    least = _LEAST_OVERLAP * min(float(np.ptp(t)), float(np.ptp(s)))
    step = max(float(np.median(np.diff(t))), float(np.median(np.diff(s))))
    offsets = np.arange(t[0] - s[-1] + least, t[-1] - s[0] - least, step)
    if not offsets.size:
        return None
    scores = np.array([_explained(t, x, s + offset, y) for offset in offsets.tolist()])
    best = int(np.argmax(scores))
    _refuse_ambiguity(offsets, scores, best)
    return float(offsets[best])


def _refuse_ambiguity(offsets: FloatArray, scores: FloatArray, best: int) -> None:
    """Refuse a periodic motion, which fits as well when shifted by its period."""
    if scores[best] < _LEAST_R2:
        return
    inner = np.flatnonzero((scores[1:-1] >= scores[:-2]) & (scores[1:-1] >= scores[2:])) + 1
    rest = [k for k in inner.tolist() if abs(k - best) > 1]
    rivals = [k for k in rest if 1.0 - scores[k] < _RIVAL * (1.0 - scores[best])]
    if rivals:
        other = max(rivals, key=lambda k: float(scores[k]))
        raise InputError(
            "synchronisation: the trigger never changes, and the motion repeats: offsets of "
            f"{offsets[best]:.3f} s and {offsets[other]:.3f} s explain the load cell as well"
        )


def _basis(t: FloatArray, x: FloatArray, at: FloatArray) -> FloatArray:
    columns = [np.interp(at, t, x[:, k]) for k in range(x.shape[1])]
    return np.column_stack((np.ones_like(at), *columns))


def _explained(t: FloatArray, x: FloatArray, at: FloatArray, y: FloatArray) -> float:
    inside = (at >= t[0]) & (at <= t[-1])
    if int(inside.sum()) < 20:
        return 0.0
    target = y[inside]
    power = float(np.sum((target - target.mean()) ** 2))
    if power == 0.0:
        return 0.0
    basis = _basis(t, x, at[inside])
    weights, *_ = np.linalg.lstsq(basis, target, rcond=1e-10)
    return 1.0 - float(np.sum((target - basis @ weights) ** 2)) / power


def _refine(
    t: FloatArray,
    x: FloatArray,
    s: FloatArray,
    y: FloatArray,
    *,
    guess: float,
    edge: TriggerEdge | None,
) -> ClockFit | None:
    """Offset, drift and weights together; the trigger enters as one more observation."""
    from scipy.optimize import least_squares

    at = guess + s
    margin = _MOST_DRIFT * float(np.ptp(s))
    inside = (at >= t[0] - margin) & (at <= t[-1] + margin)
    if int(inside.sum()) < 20:
        return None
    s, y = s[inside], y[inside]
    middle = float(s.mean())
    basis = _basis(t, x, guess + s)
    weights, *_ = np.linalg.lstsq(basis, y, rcond=1e-10)
    noise = max(float(np.std(y - basis @ weights)), 1e-12 * max(float(np.ptp(y)), 1e-300))

    def moved(p: FloatArray) -> FloatArray:
        return np.asarray(p[0] + p[1] * (s - middle) + s, dtype=np.float64)

    def residual(p: FloatArray) -> FloatArray:
        rest = (_basis(t, x, moved(p)) @ p[2:] - y) / noise
        if edge is None:
            return np.asarray(rest, dtype=np.float64)
        return np.append(rest, (p[0] - p[1] * middle - edge.time) / edge.std)

    half = max(edge.std * 6.0, margin) if edge else margin + 5.0 * float(np.median(np.diff(s)))
    low = [guess - half, -_MOST_DRIFT, *([-np.inf] * len(weights))]
    high = [guess + half, _MOST_DRIFT, *([np.inf] * len(weights))]
    scale = [float(np.median(np.diff(t))), 1e-4, *np.maximum(np.abs(weights), noise)]
    solution = least_squares(
        residual, [guess, 0.0, *weights], bounds=(low, high), x_scale=scale, jac="3-point"
    )
    return _clock_fit(solution, middle, y, noise, edge)


def _clock_fit(
    solution: object, middle: float, y: FloatArray, noise: float, edge: TriggerEdge | None
) -> ClockFit:
    count = len(y)
    p, jac, fun = (np.asarray(getattr(solution, name)) for name in ("x", "jac", "fun"))
    covariance = robust_covariance(jac[:count], fun[:count])
    if edge is not None and np.all(np.isfinite(covariance)):
        # The trigger as an observation beside the logs: its row is white and of unit variance.
        row = jac[count]
        gain = covariance @ row / (1.0 + row @ covariance @ row)
        covariance = covariance - np.outer(gain, row @ covariance)
    rest = noise * fun[:count]
    explained = 1.0 - float(rest @ rest) / float(np.sum((y - y.mean()) ** 2))
    turn = np.zeros(len(p))
    turn[0], turn[1] = 1.0, -middle
    variance = float(turn @ covariance @ turn)
    return ClockFit(
        offset=float(p[0] - p[1] * middle),
        offset_std=math.sqrt(max(variance, 0.0)),
        drift=float(p[1]),
        drift_std=math.sqrt(max(float(covariance[1, 1]), 0.0)),
        method="correlation" if edge is None else "trigger and correlation",
        explained=explained,
    )
