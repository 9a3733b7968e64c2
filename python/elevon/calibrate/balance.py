"""Torque balance and the speed controller's law, each a regression on noise-free regressors.

The motor's encoder has 2^24 counts a turn: speed and acceleration taken from its angle are nearly
free of noise, so that all the noise is in the current, the left-hand side, and least squares is
unbiased. Every signal goes through one Gaussian, and lags pass everything alike: what the kernel
does to the left-hand side it does to the right-hand side too. No simulation enters.

    k_t i = J dw/dt + C w + (F + T_brake) sgn w
    k_t i_ref = K_p e + K_i int e dt + K_d (dw_ref/dt - dw/dt),   e = w_ref - w

In the law the motion has a coefficient of its own in the first term and in the last. A set point
that goes by stairs (counts of an encoder, a slower position loop) makes the derivative branch
spike; the log's samples stand in step with the drive and catch those spikes too often or too
seldom, and what the drive reads a tick late looks like a derivative or a set-point weight. All that
lands on the set point's slope and on the motion's own term; the gains are read from the error and
from the motion's slope, which is smooth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Bools, Floats
from elevon.estimate.covariance import Strokes
from elevon.estimate.regression import Regression, huber, regressed, robust_cost, with_deviations
from elevon.estimate.signals import integral
from elevon.logs.log import Log

_NOISE = 0.01  # of the acceleration's RMS that its noise may be
_WIDEST = 0.02  # s, deviation of the smoothing kernel at most
_REACH = 6.0  # deviations of the kernel kept
_SIGMAS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)  # samples: kernels tried, narrowest first


@dataclass(frozen=True)
class SmoothedMotion:
    """Speed and acceleration of one log, smoothed as its current is, and what may be used."""

    speed: Floats
    acceleration: Floats
    current: Floats
    sigma: float


def motion_of(log: Log) -> SmoothedMotion:
    """Speed, acceleration and current through one kernel and its derivatives."""
    sigma = kernel(log)
    return SmoothedMotion(*acceleration_of(log, sigma), smoothed(log.current, sigma), sigma)


def acceleration_of(log: Log, sigma: float) -> tuple[Floats, Floats]:
    """Smoothed speed and acceleration.

    Derivatives are those of the kernel: differences of neighbours would damp what is fast, at
    40 Hz already by 6 %, and the lag and the derivative time would take it up.
    """
    dt = log.period
    if not log.has("motor_position"):
        return smoothed(log.speed, sigma), smoothed(log.speed, sigma, 1) / dt
    return smoothed(log.motor, sigma, 1) / dt, smoothed(log.motor, sigma, 2) / dt**2


def kernel(log: Log) -> float:
    """Deviation in samples of a Gaussian that brings the acceleration's noise under its limit."""
    for sigma in _SIGMAS:
        acceleration = acceleration_of(log, sigma)[1]
        # Third differences of a smooth motion vanish: what is left is noise.
        jerk = np.diff(acceleration, 3)
        noise = 1.4826 * float(np.median(np.abs(jerk))) / np.sqrt(20.0)
        if noise < _NOISE * max(float(np.std(acceleration)), 1e-300):
            return sigma
        if (sigma + 1.0) * log.period > _WIDEST:
            return sigma
    return _SIGMAS[-1]


def smoothed(values: Floats, sigma: float, order: int = 0) -> Floats:
    """Pass values (n,) or columns (n, k), or their derivative a sample, through the Gaussian."""
    from scipy.ndimage import correlate1d

    # Taken off the mean: an angle of many turns would leave its rounding in the derivatives.
    level = values.mean(axis=0)
    fresh = correlate1d(values - level, _gaussian(sigma, order), axis=0, mode="nearest")
    return np.asarray(fresh if order else fresh + level, dtype=np.float64)


def _gaussian(sigma: float, order: int) -> Floats:
    """Sampled Gaussian, or its derivative, exact for polynomials of degree two.

    Sampling leaves the second derivative a sum of some 1e-7: enough to turn an angle of a hundred
    radians into an acceleration.
    """
    reach = round(_REACH * sigma)
    x = np.arange(-reach, reach + 1, dtype=np.float64)
    plain = np.exp(-0.5 * (x / sigma) ** 2)
    plain /= plain.sum()
    if order == 0:
        return plain
    if order == 1:
        return np.asarray(plain * x / np.sum(plain * x * x), dtype=np.float64)
    curved = plain * (x * x - sigma**2)
    curved -= plain * curved.sum()
    return np.asarray(2.0 * curved / np.sum(curved * x * x), dtype=np.float64)


def dilated(bad: Bools, period: float, reach: float) -> Bools:
    """Widen what is marked by a reach [s] to either side."""
    from scipy.ndimage import binary_dilation

    steps = max(1, round(reach / period))
    return np.asarray(binary_dilation(bad, iterations=steps), dtype=np.bool_)


def lagged(columns: Floats, lag: float, period: float) -> Floats:
    """Pass columns, shape (n, p), through a first-order lag.

    Exact for whatever the samples can tell: straight lines between them would damp it. A negative
    lag is a shift ahead: a current that comes before the motion it makes.
    """
    if abs(lag) < 1e-7:
        return columns
    if lag < 0.0:
        return delayed(columns, lag, period)
    folded = np.concatenate((columns, columns[::-1]))
    at = np.fft.rfftfreq(len(folded), period)
    passed = np.fft.rfft(folded, axis=0) / (1.0 + 2j * np.pi * at * lag)[:, None]
    return np.asarray(np.fft.irfft(passed, len(folded), axis=0)[: len(columns)], dtype=np.float64)


def delayed(columns: Floats, lag: float, period: float) -> Floats:
    """Shift columns, shape (n, p), later by a lag."""
    folded = np.concatenate((columns, columns[::-1]))
    at = np.fft.rfftfreq(len(folded), period)
    turned = np.fft.rfft(folded, axis=0) * np.exp(-2j * np.pi * at * lag)[:, None]
    return np.asarray(np.fft.irfft(turned, len(folded), axis=0)[: len(columns)], dtype=np.float64)


def saturated_speed(log: Log) -> float:
    """Level at which the set point is held flat [rad/s]; infinite where it never is."""
    top = float(np.abs(log.speed_ref).max())
    flat = np.abs(log.speed_ref) > top * (1.0 - 1e-4)
    return top if top > 0.0 and int(flat.sum()) >= 20 else float("inf")


_SLOW = 0.05  # of the highest speed: below it friction may stick
_CLEARER = 0.2  # of the highest speed: the same, stricter
_CLEAR = 0.01  # s around a reversal and a slow sample that are left out too
_LAGS = (-0.005, 0.02)  # s searched for the current's lag behind the motion


def torque_balance(logs: Sequence[Log]) -> Regression | None:
    """Regress the measured current on motion, friction and brake.

    Parameters
    ----------
    logs : sequence of Log
        Those with an unmeasured brake count only where there is no other.

    Returns
    -------
    Regression or None
        Coefficients ``inertia``, ``viscous``, ``dry``, ``brake`` (with a load cell), ``cell`` (its
        offset, where another log shows the friction alone), ``offset`` (of the current's sensor;
        ``constant`` where only the set point is logged), ``lag`` [s]; None without enough motion
        in both directions.
    """
    clean = [k for k, log in enumerate(logs) if log.brake.known in {"off", "torque"}]
    chosen = clean or list(range(len(logs)))
    used = [logs[k] for k in chosen]
    motions = [motion_of(log) for log in used]
    cell = any(log.brake.measured for log in used)
    masks = [_moving(log, m) for log, m in zip(used, motions, strict=True)]
    if sum(int(m.sum()) for m in masks) < 200 or not _both_ways(motions, masks):
        return None
    both = cell and any(log.brake.known == "off" for log in used)
    measured = all(log.has("torque_current") for log in used)
    names = (
        "inertia",
        "viscous",
        "dry",
        *(("brake",) if cell else ()),
        *(("cell",) if both else ()),
        "offset" if measured else "constant",
        "lag",
    )
    problem = _Balance(used, motions, masks, cell, both)
    answer = problem.solve()
    design = np.column_stack((answer.design, problem.slope(answer)))
    strokes = [(log.time[m], log.speed[m], log.period) for log, m in zip(used, masks, strict=True)]
    value = np.append(answer.beta, answer.lag)
    regression = with_deviations(
        names, value, design, answer.residual, answer.weight, strokes=strokes
    )
    others = problem.variants(answer) if np.isfinite(regression.covariance).all() else []
    return regression.open_to(np.append(other.beta, other.lag) for other in others)


@dataclass(frozen=True)
class _Solved:
    """Coefficients at the best lag, and what they stand on."""

    beta: Floats
    lag: float
    residual: Floats
    weight: Floats
    design: Floats


@dataclass(frozen=True)
class _Balance:
    """The torque balance of several logs, ready to be solved in more than one way."""

    logs: Sequence[Log]
    motions: Sequence[SmoothedMotion]
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
            moved = delayed(columns, lag, log.period) if delay else lagged(columns, lag, log.period)
            rows.append(moved[mask])
            data.append(motion.current[mask])
        design = np.vstack(rows)
        beta, residual, weight = huber(design, np.concatenate(data))
        return _Solved(beta, lag, residual, weight, design)

    def solve(self, *, delay: bool = False) -> _Solved:
        """Find the lag of least robust cost."""
        from scipy.optimize import minimize_scalar

        least = minimize_scalar(
            lambda lag: robust_cost(self.at(lag, delay=delay).residual),
            bounds=_LAGS,
            method="bounded",
            options={"xatol": 1e-5},
        )
        return self.at(float(least.x), delay=delay)

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
        solved = [self.solve(delay=True)]
        if all(mask.sum() > 100 for mask in clear):
            solved.append(self.at(answer.lag, masks=clear))
        drift = max((log.brake.drift_std for log in self.logs if log.brake.measured), default=0.0)
        if drift > 0.0:
            solved.append(self.at(answer.lag, drift=drift))
        return solved


def _moving(log: Log, motion: SmoothedMotion) -> Bools:
    """Samples well inside a stretch of motion in one direction."""
    slow = np.abs(motion.speed) < _SLOW * np.abs(motion.speed).max()
    ends = np.zeros(len(slow), dtype=np.bool_)
    margin = max(4, round(4.0 * motion.sigma))
    ends[:margin] = ends[-margin:] = True
    near = dilated(slow, log.period, _CLEAR + 3.0 * motion.sigma * log.period)
    return np.asarray(log.good & ~near & ~ends, dtype=np.bool_)


def _both_ways(motions: Sequence[SmoothedMotion], masks: Sequence[Bools]) -> bool:
    speed = np.concatenate([m.speed[k] for m, k in zip(motions, masks, strict=True)])
    return bool(min(np.mean(speed > 0.0), np.mean(speed < 0.0)) > 0.02)


def _balance_columns(
    log: Log, motion: SmoothedMotion, cell: bool, both: bool, *, drift: float = 0.0
) -> Floats:
    sign = np.sign(motion.speed)
    dry = [sign]
    if cell:
        at = log.brake.time * (1.0 + drift)
        level = np.interp(log.time, at, log.brake.level) if log.brake.measured else 0.0
        dry.append(sign * level)
    if both:
        # A cell that turns with the motion shows its offset against it; one pulled always the same,
        # along.
        direction = log.brake.turning if log.brake.turning else sign
        dry.append(-direction * float(log.brake.measured) * np.ones_like(sign))
    # What jumps at a reversal is smoothed as the current is, so that a lag passes it alike.
    jumps = [smoothed(column, motion.sigma) for column in dry]
    return np.column_stack((motion.acceleration, motion.speed, *jumps, np.ones_like(sign)))


_SETTLED = 0.25  # s around a saturated set point in which anti-windup may act
_LEAST = 200  # samples
_LOOP = 1.5e-3  # s: a current loop's lag that a measured current hides (200 Hz and faster)
_NARROWEST = 3.0  # samples, deviation of the kernel: stairs of the set point are averaged over it
_TERMS = ("proportional", "integral", "derivative", "slope", "motion")


@dataclass(frozen=True)
class _Law:
    """Columns and set point of every log, and which samples are used; one array a log."""

    columns: Sequence[Floats]
    targets: Sequence[Floats]
    inside: Sequence[Bools]
    periods: Sequence[float]

    def rows(self) -> tuple[list[Floats], list[Floats]]:
        """Columns and set point of the current, of the samples that count."""
        return self._used(self.columns), self._used(self.targets)

    def without(self, column: int) -> Floats:
        """Solve without one column; its coefficient comes back as zero."""
        residual = [np.delete(c, column, axis=1) for c in self.columns]
        return np.insert(self._solve(residual), column, 0.0)

    def joint(self) -> Floats:
        """Solve with one derivative gain for both slopes; coefficients in the common order."""
        joined = [np.column_stack((c[:, :2], c[:, 2] + c[:, 3], c[:, 4:])) for c in self.columns]
        beta = self._solve(joined)
        return np.insert(beta, 2, beta[2])

    def late(self) -> Floats:
        """Solve with slopes that may come late, by their own derivatives."""
        more = [
            np.column_stack((c, *(np.gradient(c[:, k], dt) for k in (2, 3))))
            for c, dt in zip(self.columns, self.periods, strict=True)
        ]
        return self._solve(more)[:-2]

    def _used(self, arrays: Sequence[Floats]) -> list[Floats]:
        return [c[good] for c, good in zip(arrays, self.inside, strict=True)]

    def _solve(self, columns: Sequence[Floats]) -> Floats:
        return huber(np.vstack(self._used(columns)), np.concatenate(self._used(self.targets)))[0]


def controller_law(logs: Sequence[Log], lag: float = 0.0) -> Regression | None:
    """Regress the current's set point on the speed error, its integral and its derivative.

    Parameters
    ----------
    logs : sequence of Log
        All of them count: the law holds whatever the load.
    lag : float
        Of the measured current behind the torque [s]: where no set point was logged, the measured
        current stands for it.

    Returns
    -------
    Regression or None
        ``proportional``, ``integral``, ``derivative`` (of the motion), ``slope`` (of the set
        point), ``motion`` (what the motion's weight differs from the set point's), one ``start`` a
        log; None where the error hardly moves.

    Notes
    -----
    What no log can settle enters the deviations as the difference it makes: for gain and
    integral one weight for set point and motion in the place of two, for the derivative one gain
    in the place of two, and slopes that come late as a filter or a slow tick would have them.
    """
    law, present, strokes = _ready(logs, lag)
    rows, data = law.rows()
    design = np.vstack(rows)
    size = np.linalg.norm(design, axis=0)
    if len(design) < _LEAST or not np.all(size > 0.0):
        return None
    if np.linalg.matrix_rank(design / size) < design.shape[1]:
        return None
    names = (*_TERMS, *(f"start[{k}]" for k in present))
    regression = regressed(names, rows, data, strokes)
    sloped, beta = np.isin(names, ("derivative", "slope")), regression.value
    return regression.open_to(
        (
            np.where(sloped, beta, law.without(_TERMS.index("motion"))),
            np.where(sloped, law.joint(), beta),
            np.where(sloped, law.late(), beta),
            *((_slower(beta),) if any(_stands_for(log) for log in logs) else ()),
        )
    )


def _ready(logs: Sequence[Log], lag: float) -> tuple[_Law, list[int], list[Strokes]]:
    """Columns of every log, which logs have any sample, and the times of the samples used."""
    inside = [_inside(log) for log in logs]
    present = [k for k, good in enumerate(inside) if good.any()]
    columns, targets = [], []
    for k, log in enumerate(logs):
        sigma = _sigma(log)
        starts = [np.full(len(log.time), float(j == k)) for j in present]
        table = np.column_stack((*_columns(log, sigma), *starts))
        columns.append(lagged(table, lag, log.period) if _stands_for(log) else table)
        targets.append(smoothed(log.current_target, sigma))
    strokes = [
        (log.time[good], log.speed[good], log.period)
        for log, good in zip(logs, inside, strict=True)
    ]
    return _Law(columns, targets, inside, [log.period for log in logs]), present, strokes


def _stands_for(log: Log) -> bool:
    """Whether the measured current stands for a set point that was not logged."""
    return not log.has("current_ref")


def _slower(beta: Floats) -> Floats:
    """What a current loop of `_LOOP` hides of the slopes: it comes late by P and D alike."""
    other = beta.copy()
    at = [_TERMS.index("derivative"), _TERMS.index("slope")]
    other[at] += _LOOP * beta[_TERMS.index("proportional")]
    return other


def _sigma(log: Log) -> float:
    return max(kernel(log), _NARROWEST)


def _inside(log: Log) -> Bools:
    """Samples away from a saturated set point and from the log's ends."""
    saturated = np.abs(log.speed_ref) >= 0.999 * saturated_speed(log)
    good = log.good & ~dilated(saturated, log.period, _SETTLED)
    margin = round(4.0 * _sigma(log))
    good[:margin] = good[-margin:] = False
    return np.asarray(good, dtype=np.bool_)


def _columns(log: Log, sigma: float) -> list[Floats]:
    """Error, its integral, the motion's slope (negative), the set point's, the motion."""
    speed, acceleration = acceleration_of(log, sigma)
    turned = (
        integral(log.time, log.speed) if not log.has("motor_position") else log.motor - log.motor[0]
    )
    return [
        smoothed(log.speed_ref, sigma) - speed,
        smoothed(integral(log.time, log.speed_ref) - turned, sigma),
        -acceleration,
        smoothed(log.speed_ref, sigma, 1) / log.period,
        -speed,
    ]
