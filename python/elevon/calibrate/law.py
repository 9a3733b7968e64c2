"""The speed controller's law as a regression; no plant enters it.

    k_t i_ref = K_p e + K_i int e dt + K_d (dw_ref/dt - dw/dt),   e = w_ref - w.

The motion has a coefficient of its own in the first term and in the last. A set point that goes
by stairs (counts of an encoder, a slower position loop) makes the derivative branch spike; the
log's samples stand in step with the drive and catch those spikes too often or too seldom, and what
the drive reads a tick late looks like a derivative or a set-point weight. All that lands on the
set point's slope and on the motion's own term; the gains are read from the error and from the
motion's slope, which is smooth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Bools, Floats
from elevon.calibrate.direct import saturated_speed
from elevon.calibrate.motion import acceleration_of, dilated, kernel, lagged, smoothed
from elevon.estimate.covariance import Strokes
from elevon.estimate.regression import Regression, huber, regressed
from elevon.estimate.signals import integral
from elevon.logs.log import Log

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
