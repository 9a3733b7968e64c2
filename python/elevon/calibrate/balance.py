"""Torque balance and speed controller as regressions on noise-free regressors.

The motor's encoder has 2^24 counts a turn: speed and acceleration taken from its angle are nearly
free of noise, so that all the noise is in the current, the left-hand side, and least squares is
unbiased. No simulation, no controller, no command enters the plant's balance

    k_t i = J dw/dt + C w + (F + T_brake) sgn w,

and no plant enters the controller's law i_ref = (K_p e + K_i int e + K_d de/dt) / k_t.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from elevon.calibrate.blocks import block_covariance, stroke_blocks
from elevon.calibrate.direct import saturated_speed
from elevon.calibrate.log import BenchLog

__all__ = ["Regression", "controller_law", "robust_regression", "torque_balance"]

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
_SLOW = 0.05  # of the highest speed: below it friction may stick
_CLEARER = 0.2  # of the highest speed: the same, asked more strictly
_CLEAR = 0.01  # s around a reversal and a slow sample that are left out too
_NOISE = 0.01  # of the acceleration's RMS that its noise may be
_WIDEST = 0.02  # s, deviation of the smoothing kernel at most
_HUBER = 1.345
_SETTLED = 0.25  # s around a saturated set point in which anti-windup may act
_LAGS = (-0.005, 0.02)  # s searched for the current's lag behind the motion


@dataclass(frozen=True)
class Regression:
    """A regression's answer.

    Attributes
    ----------
    names : tuple of str
        Coefficients.
    value : ndarray, shape (p,)
        Their values, SI (per ampere of set-point or measured current, peak).
    covariance : ndarray, shape (p, p)
        For coloured residuals.
    degrees : float
        Degrees of freedom of the covariance.
    explained : float
        Share of the current's variance explained.
    samples : int
        Samples used.
    """

    names: tuple[str, ...]
    value: Floats
    covariance: Floats
    degrees: float
    explained: float
    samples: int

    def __getitem__(self, name: str) -> float:
        return float(self.value[self.names.index(name)])

    def std(self, name: str) -> float:
        """Return the deviation of one coefficient."""
        k = self.names.index(name)
        return float(np.sqrt(max(self.covariance[k, k], 0.0)))


@dataclass(frozen=True)
class _Motion:
    """Speed and acceleration of one log, smoothed as its current is, and what may be used."""

    speed: Floats
    acceleration: Floats
    current: Floats
    sigma: float


def torque_balance(logs: Sequence[BenchLog], keeps: Sequence[Bools]) -> Regression | None:
    """Regress the measured current on motion, friction and brake.

    Parameters
    ----------
    logs : sequence of BenchLog
        Those with an unmeasured brake count only where there is no other.
    keeps : sequence of ndarray of bool
        Samples that may be used, one a log.

    Returns
    -------
    Regression or None
        Coefficients ``inertia``, ``viscous``, ``dry``, ``brake`` (with a load cell), ``cell`` (its
        offset, where another log shows the friction alone), ``offset`` (of the current), ``lag``
        [s]; None without enough motion both ways.
    """
    clean = [k for k, log in enumerate(logs) if log.brake.known in {"off", "torque"}]
    chosen = clean or list(range(len(logs)))
    used = [logs[k] for k in chosen]
    motions = [_motion(log) for log in used]
    cell = any(log.brake.measured for log in used)
    masks = [_moving(logs[k], m, keeps[k]) for k, m in zip(chosen, motions, strict=True)]
    if sum(int(m.sum()) for m in masks) < 200 or not _both_ways(motions, masks):
        return None
    both = cell and any(log.brake.known == "off" for log in used)
    names = (
        "inertia",
        "viscous",
        "dry",
        *(("brake",) if cell else ()),
        *(("cell",) if both else ()),
        "offset",
        "lag",
    )
    problem = _Balance(used, motions, masks, cell, both)
    answer = problem.solve()
    design = np.column_stack((answer.design, problem.slope(answer)))
    times = [(log.time[m], log.speed[m], log.period) for log, m in zip(used, masks, strict=True)]
    value = np.append(answer.beta, answer.lag)
    found = _answer(names, value, design, answer.rest, answer.weight, times=times)
    if not np.isfinite(found.covariance).all():
        return found
    covariance = found.covariance
    for other in problem.variants(answer):
        gap = np.append(other.beta, other.lag) - value
        covariance = covariance + np.outer(gap, gap)
    return replace(found, covariance=covariance)


@dataclass(frozen=True)
class _Solved:
    """Coefficients at the best lag, and what they stand on."""

    beta: Floats
    lag: float
    rest: Floats
    weight: Floats
    design: Floats


@dataclass(frozen=True)
class _Balance:
    """The torque balance of several logs, ready to be solved in more than one way."""

    logs: Sequence[BenchLog]
    motions: Sequence[_Motion]
    masks: Sequence[Bools]
    cell: bool
    both: bool

    def at(
        self,
        lag: float,
        *,
        delay: bool = False,
        drift: float = 0.0,
        masks: Sequence[Bools] | None = None,
    ) -> _Solved:
        """Solve at one lag of the current: a first-order one, or a pure delay."""
        masks = masks or self.masks
        rows, data = [], []
        for log, motion, mask in zip(self.logs, self.motions, masks, strict=True):
            columns = _balance_columns(log, motion, self.cell, self.both, drift=drift)
            moved = (
                _delayed(columns, lag, log.period) if delay else _lagged(columns, lag, log.period)
            )
            rows.append(moved[mask])
            data.append(motion.current[mask])
        solved = robust_regression(np.vstack(rows), np.concatenate(data))
        return _Solved(solved[0], lag, *solved[1:])

    def solve(self, *, delay: bool = False) -> _Solved:
        """Find the lag of least robust cost."""
        from scipy.optimize import minimize_scalar

        found = minimize_scalar(
            lambda lag: _robust_cost(self.at(lag, delay=delay).rest),
            bounds=_LAGS,
            method="bounded",
            options={"xatol": 1e-5},
        )
        return self.at(float(found.x), delay=delay)

    def slope(self, answer: _Solved) -> Floats:
        """Derivative of the prediction by the lag, shape (n,)."""
        step = 2e-4
        up, down = self.at(answer.lag + step), self.at(answer.lag - step)
        return np.asarray((up.design - down.design) @ answer.beta / (2.0 * step), dtype=np.float64)

    def variants(self, answer: _Solved) -> list[_Solved]:
        """Solve again under choices that no log can settle; their spread is uncertainty.

        The shape of the current's lag; how near to a reversal the friction already has its level;
        the speed of the load cell's clock.
        """
        clear = [
            mask & (np.abs(motion.speed) > _CLEARER * np.abs(motion.speed).max())
            for mask, motion in zip(self.masks, self.motions, strict=True)
        ]
        found = [self.solve(delay=True)]
        if all(mask.sum() > 100 for mask in clear):
            found.append(self.at(answer.lag, masks=clear))
        drift = max((log.brake.drift_std for log in self.logs if log.brake.measured), default=0.0)
        if drift > 0.0:
            found.append(self.at(answer.lag, drift=drift))
        return found


def controller_law(logs: Sequence[BenchLog], keeps: Sequence[Bools]) -> Regression | None:
    """Regress the current's set point on the speed error, its integral and its derivative.

    Returns
    -------
    Regression or None
        ``proportional``, ``integral``, ``derivative``, ``smoothing`` (of the derivative and the
        log: second derivative), one ``start`` a log; None where the error hardly moves.

    Notes
    -----
    The deviations hold the difference between the law with and without ``smoothing``: which lags
    the real controller has between its error and its set point is not in any log.
    """
    rows, data, times, inside = [], [], [], []
    for k, (log, keep) in enumerate(zip(logs, keeps, strict=True)):
        columns, target = _law_columns(log)
        limit = 0.999 * saturated_speed(log)
        good = keep & log.good & ~_dilated(np.abs(log.speed_ref) >= limit, log.period, _SETTLED)
        starts = [np.full(len(target), float(j == k)) for j in range(len(logs))]
        rows.append(np.column_stack((*columns, *starts))[good])
        data.append(target[good])
        times.append((log.time[good], log.speed[good], log.period))
        inside.append(int(good.sum()))
    if sum(inside) < 200:
        return None
    present = [k for k, count in enumerate(inside) if count]
    names = (
        "proportional",
        "integral",
        "derivative",
        "smoothing",
        *(f"start[{k}]" for k in present),
    )
    design = np.vstack(rows)[:, [0, 1, 2, 3, *(4 + k for k in present)]]
    size = np.linalg.norm(design, axis=0)
    if not np.all(size > 0.0) or np.linalg.matrix_rank(design / size) < design.shape[1]:
        return None
    target = np.concatenate(data)
    full = _answer(names, *_in_order(robust_regression(design, target)), times=times)
    rest = [0, 1, 2, *range(4, design.shape[1])]
    plain = robust_regression(design[:, rest], target)[0]
    gap = np.zeros(len(names))
    gap[rest] = full.value[rest] - plain
    return replace(full, covariance=full.covariance + np.outer(gap, gap) / 3.0)


def _law_columns(log: BenchLog) -> tuple[list[Floats], Floats]:
    """Error, its integral, slope and curvature, and the set point, all smoothed alike."""
    motion = _motion(log)
    error = _smoothed(log.speed_ref, motion.sigma) - motion.speed
    integral = _integral(log.time, log.speed_ref - _raw_speed(log))
    slope = np.gradient(error, log.time)
    target = _smoothed(log.current_target, motion.sigma)
    return [error, integral, slope, np.gradient(slope, log.time)], target


def _in_order(
    solved: tuple[Floats, Floats, Floats, Floats],
) -> tuple[Floats, Floats, Floats, Floats]:
    beta, rest, weight, design = solved
    return beta, design, rest, weight


def _answer(
    names: tuple[str, ...],
    value: Floats,
    design: Floats,
    rest: Floats,
    weight: Floats,
    *,
    times: Sequence[tuple[Floats, Floats, float]],
) -> Regression:
    scores, blocks, at = [], [], 0
    for time, speed, period in times:
        part = slice(at, at + len(time))
        at += len(time)
        if not len(time):
            continue
        clipped = rest[part] * weight[part]
        scores.append(design[part] * clipped[:, None])
        blocks.append(stroke_blocks(time, speed, clipped, period))
    # Huber's score stands still for outliers: they carry no information.
    inner = weight >= 1.0
    normal = design[inner].T @ design[inner]
    covariance, degrees = block_covariance(normal, scores, blocks)
    # Columns beyond the linear ones (the lag's) move nothing at the solution.
    linear = len(value) - int("lag" in names)
    data = rest + design[:, :linear] @ value[:linear]
    spread = float(np.sum((data - data.mean()) ** 2))
    explained = 1.0 - float(rest @ rest) / spread if spread > 0.0 else 0.0
    return Regression(names, value, covariance, degrees, explained, len(rest))


def _motion(log: BenchLog) -> _Motion:
    """Speed and acceleration by differences of one smoothed signal, the current smoothed alike."""
    dt = log.period
    sigma = _kernel(log)
    if log.motor is not None:
        angle = _smoothed(log.motor, sigma)
        speed = np.gradient(angle, log.time)
        acceleration = np.zeros_like(angle)
        acceleration[1:-1] = (angle[2:] - 2.0 * angle[1:-1] + angle[:-2]) / dt**2
    else:
        speed = _smoothed(log.speed, sigma)
        acceleration = np.gradient(speed, log.time)
    return _Motion(speed, acceleration, _smoothed(log.current, sigma), sigma)


def _kernel(log: BenchLog) -> float:
    """Deviation in samples of a Gaussian that brings the acceleration's noise under its limit."""
    dt = log.period
    for sigma in (0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0):
        source = log.motor if log.motor is not None else log.speed
        smooth = _smoothed(source, sigma)
        if log.motor is not None:
            acceleration = (smooth[2:] - 2.0 * smooth[1:-1] + smooth[:-2]) / dt**2
        else:
            acceleration = (smooth[2:] - smooth[:-2]) / (2.0 * dt)
        # Third differences of a smooth motion vanish: what is left is noise.
        jerk = np.diff(acceleration, 3)
        noise = 1.4826 * float(np.median(np.abs(jerk))) / np.sqrt(20.0)
        if noise < _NOISE * max(float(np.std(acceleration)), 1e-300):
            return sigma
        if (sigma + 1.0) * dt > _WIDEST:
            return sigma
    return 8.0


def _smoothed(values: Floats, sigma: float) -> Floats:
    if sigma == 0.0:
        return values
    from scipy.ndimage import gaussian_filter1d

    return np.asarray(gaussian_filter1d(values, sigma, mode="nearest"), dtype=np.float64)


def _raw_speed(log: BenchLog) -> Floats:
    return log.speed if log.motor is None else np.gradient(log.motor, log.time)


def _moving(log: BenchLog, motion: _Motion, keep: Bools) -> Bools:
    """Samples well inside a stretch of motion one way."""
    slow = np.abs(motion.speed) < _SLOW * np.abs(motion.speed).max()
    ends = np.zeros(len(slow), dtype=np.bool_)
    margin = max(4, round(4.0 * motion.sigma))
    ends[:margin] = ends[-margin:] = True
    near = _dilated(slow, log.period, _CLEAR + 3.0 * motion.sigma * log.period)
    return np.asarray(keep & log.good & ~near & ~ends, dtype=np.bool_)


def _dilated(bad: Bools, period: float, reach: float) -> Bools:
    from scipy.ndimage import binary_dilation

    steps = max(1, round(reach / period))
    return np.asarray(binary_dilation(bad, iterations=steps), dtype=np.bool_)


def _both_ways(motions: Sequence[_Motion], masks: Sequence[Bools]) -> bool:
    speed = np.concatenate([m.speed[k] for m, k in zip(motions, masks, strict=True)])
    return bool(min(np.mean(speed > 0.0), np.mean(speed < 0.0)) > 0.02)


def _balance_columns(
    log: BenchLog, motion: _Motion, cell: bool, both: bool, *, drift: float = 0.0
) -> Floats:
    sign = np.sign(motion.speed)
    columns = [motion.acceleration, motion.speed, sign]
    if cell:
        at = log.brake.time * (1.0 + drift)
        level = np.interp(log.time, at, log.brake.level) if log.brake.measured else 0.0
        columns.append(sign * level)
    if both:
        columns.append(-sign * float(log.brake.measured))
    return np.column_stack((*columns, np.ones_like(sign)))


def _lagged(columns: Floats, lag: float, period: float) -> Floats:
    """Pass columns through a first-order lag, exact for straight lines between samples.

    A negative lag is a shift ahead: a current that comes before the motion it makes.
    """
    if abs(lag) < 1e-7:
        return columns
    if lag < 0.0:
        return _delayed(columns, lag, period)
    from scipy.signal import lfilter

    decay = float(np.exp(-period / lag))
    ramp = 1.0 - lag / period * (1.0 - decay)
    b = [ramp, (1.0 - decay) - ramp]
    start = (1.0 - b[0]) * columns[:1]
    out, _ = lfilter(b, [1.0, -decay], columns, axis=0, zi=start)
    return np.asarray(out, dtype=np.float64)


def _delayed(columns: Floats, lag: float, period: float) -> Floats:
    """Shift columns later by a lag."""
    at = np.arange(len(columns)) * period
    return np.column_stack([np.interp(at - lag, at, c) for c in columns.T])


def _integral(time: Floats, values: Floats) -> Floats:
    return np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))))


def robust_regression(design: Floats, data: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Robust regression: coefficients, residuals, weights, design."""
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0.0] = 1.0
    scaled = design / scale
    weight = np.ones(len(data))
    beta = np.zeros(design.shape[1])
    for _ in range(20):
        heavy = weight[:, None] * scaled
        fresh, *_ = np.linalg.lstsq(heavy.T @ scaled, heavy.T @ data, rcond=1e-12)
        rest = data - scaled @ fresh
        spread = 1.4826 * float(np.median(np.abs(rest))) or 1e-300
        weight = np.minimum(1.0, _HUBER * spread / np.maximum(np.abs(rest), 1e-300))
        done = np.abs(fresh - beta).max() <= 1e-7 * max(float(np.abs(fresh).max()), 1e-300)
        beta = fresh
        if done:
            break
    return beta / scale, data - scaled @ beta, weight, design


def _robust_cost(rest: Floats) -> float:
    """Huber's cost at a fixed fraction of the spread: smooth in whatever moves the residual."""
    bound = _HUBER * 1.4826 * float(np.median(np.abs(rest)))
    size = np.abs(rest)
    inner = size <= bound
    return float(np.sum(np.where(inner, 0.5 * size**2, bound * (size - 0.5 * bound))))
