"""Torque balance as a regression on noise-free regressors.

Speed and acceleration come from the motor's angle (`elevon.calibrate.motion`), so that all the
noise is in the current, the left-hand side, and least squares is unbiased. No simulation, no
controller, no command enters

    k_t i = J dw/dt + C w + (F + T_brake) sgn w.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Bools, Floats
from elevon.calibrate.motion import SmoothedMotion, delayed, dilated, lagged, motion_of, smoothed
from elevon.estimate.regression import Regression, huber, robust_cost, with_deviations
from elevon.logs.log import Log

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
