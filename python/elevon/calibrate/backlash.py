"""Backlash, encoder gain and offset from the two positions alone.

The encoder shows the motor's angle over the ratio, after the backlash: one equation, no
friction, inertia or controller in it. All samples count, those inside the gap too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.blocks import block_covariance, stroke_blocks
from elevon.calibrate.estimate import quantile
from elevon.calibrate.log import BenchLog

__all__ = ["BacklashFit", "fit_backlash", "median_width", "through_backlash"]

_TRAVEL = 3.0  # backlashes (or counts) of travel in both directions that a log must have
_FLOATS = 3.0  # counts of residual that no rounding leaves: the output is free


@dataclass(frozen=True)
class BacklashFit:
    """What the two positions say, pooled over logs.

    Attributes
    ----------
    backlash, offset, gain, delay : (float, float)
        Value and standard deviation: total backlash [rad at the output]; encoder less motor over
        ratio [rad]; encoder's gain over the motor's; encoder's lag behind the motor's sensor [s].
    degrees : float
        Degrees of freedom of the deviations.
    rms : float
        Of the residual [rad].
    reach : float
        Greatest half range of motion in a log [rad at the output].
    logs : tuple of str
        Logs used.
    floats : bool
        The output is free: it moves on its own within the backlash. Only the span of the two
        positions' difference is known then; gain and delay are not.
    """

    backlash: tuple[float, float]
    offset: tuple[float, float]
    gain: tuple[float, float]
    delay: tuple[float, float]
    degrees: float
    rms: float
    reach: float
    logs: tuple[str, ...]
    floats: bool = False


def through_backlash(driver: Floats, width: float) -> Floats:
    """Drag a follower through a total backlash; it starts in the middle. Shape as `driver`."""
    half = 0.5 * width
    out = np.empty_like(driver)
    state = float(driver[0])
    for k, x in enumerate(driver.tolist()):
        state = min(max(state, x - half), x + half)
        out[k] = state
    return out


def fit_backlash(logs: Sequence[BenchLog], ratio: float, count: float) -> BacklashFit | None:
    """Fit backlash, offset, gain and delay to every log that moves in both directions.

    Parameters
    ----------
    logs : sequence of BenchLog
        Those without both positions are passed over.
    ratio : float
        Gear ratio.
    count : float
        One count of the encoder at the output [rad].

    Returns
    -------
    BacklashFit or None
        None where no log has both positions and a reversal.
    """
    used = [log for log in logs if _usable(log, ratio, count)]
    if not used:
        return None
    from scipy.optimize import least_squares

    drivers = [log.motor / ratio for log in used if log.motor is not None]
    outputs = [log.output for log in used if log.output is not None]
    width, centre = _start(used, drivers, outputs)
    keeps = [_after_reversal(x, width) for x in drivers]
    speeds = [log.speed / ratio for log in used]
    scale = np.array([count, count, 1e-4, 1e-3])

    def residual(p: Floats) -> Floats:
        parts = []
        for x, y, v, keep in zip(drivers, outputs, speeds, keeps, strict=True):
            following = through_backlash(x, abs(float(p[0])))
            moving = np.gradient(following) / np.maximum(np.abs(np.gradient(x)), 1e-15)
            follows = v * np.clip(np.abs(moving), 0.0, 1.0)
            parts.append(((p[2] * following + p[1] - p[3] * follows) - y)[keep])
        return np.concatenate(parts) / count

    def jacobian(p: Floats) -> Floats:
        return _jacobian(residual, p, scale)

    best = least_squares(
        residual,
        [width, centre, 1.0, 0.0],
        x_scale=scale,
        loss="soft_l1",
        f_scale=3.0,
        max_nfev=30,
        jac=jacobian,
    )
    covariance, degrees = _covariance(best, used, keeps)
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    value = np.array(best.x)
    value[0] = abs(value[0])
    rms = count * float(np.sqrt(np.mean(residual(best.x) ** 2)))
    if rms > _FLOATS * count:
        return _spanned(used, drivers, outputs, keeps, count=count, rms=rms)
    pairs = [(float(v), float(s)) for v, s in zip(value, std, strict=True)]
    return BacklashFit(
        backlash=pairs[0],
        offset=pairs[1],
        gain=pairs[2],
        delay=pairs[3],
        degrees=degrees,
        rms=rms,
        reach=0.5 * max(float(np.ptp(x)) for x in drivers),
        logs=tuple(x.name for x in used),
    )


def _spanned(
    logs: Sequence[BenchLog],
    drivers: Sequence[Floats],
    outputs: Sequence[Floats],
    keeps: Sequence[npt.NDArray[np.bool_]],
    *,
    count: float,
    rms: float,
) -> BacklashFit:
    """Backlash of an output that flies from one end of the gap to the other.

    The difference of the two positions piles up at both ends. What it leaves out at either side
    within twenty to one crosses the backlash or is not yet in contact; what lies beyond two hundred
    to one is the compliance of the contacts: the backlash is between the two spans, less the count
    of the rounding.
    """
    inner, outer, middles = [], [], []
    for x, y, keep in zip(drivers, outputs, keeps, strict=True):
        edges = np.percentile((y - x)[keep], [0.5, 5.0, 95.0, 99.5])
        inner.append(edges[2] - edges[1])
        outer.append(edges[3] - edges[0])
        middles.append(0.5 * (edges[3] + edges[0]))
    low, high = max(min(inner) - count, 0.0), max(outer) - count
    half = 0.5 * (high - low) / quantile(np.inf)
    return BacklashFit(
        backlash=(0.5 * (low + high), half),
        offset=(float(np.mean(middles)), half),
        gain=(1.0, np.inf),
        delay=(0.0, np.inf),
        degrees=np.inf,
        rms=rms,
        reach=0.5 * max(float(np.ptp(x)) for x in drivers),
        logs=tuple(log.name for log in logs),
        floats=True,
    )


def _jacobian(residual: object, p: Floats, scale: Floats) -> Floats:
    """Central differences over steps of the size that matters: the backlash's kinks average out."""
    columns = []
    for k, step in enumerate(0.5 * scale):
        shift = np.zeros_like(p)
        shift[k] = step
        columns.append((residual(p + shift) - residual(p - shift)) / (2.0 * step))  # type: ignore[operator]
    return np.column_stack(columns)


def _usable(log: BenchLog, ratio: float, count: float) -> bool:
    if log.motor is None or log.output is None:
        return False
    speed = np.abs(log.speed).max()
    both = min(float((log.speed > 0.1 * speed).mean()), float((log.speed < -0.1 * speed).mean()))
    return both > 0.02 and float(np.ptp(log.motor)) / ratio > _TRAVEL * count


def median_width(log: BenchLog, ratio: float, count: float) -> float | None:
    """Backlash of one log [rad at the output] by the medians of each direction, or None."""
    if not _usable(log, ratio, count) or log.motor is None or log.output is None:
        return None
    return _start([log], [log.motor / ratio], [log.output])[0]


def _start(
    logs: Sequence[BenchLog], drivers: Sequence[Floats], outputs: Sequence[Floats]
) -> tuple[float, float]:
    """Median lag of each direction, away from reversals: half a backlash either side of centre."""
    ahead, behind = [], []
    for log, x, y in zip(logs, drivers, outputs, strict=True):
        fast = 0.3 * np.abs(log.speed).max()
        lag = y - x
        ahead.append(np.median(lag[log.speed > fast]))
        behind.append(np.median(lag[log.speed < -fast]))
    up, down = float(np.median(ahead)), float(np.median(behind))
    return max(down - up, 1e-7), 0.5 * (up + down)


def _after_reversal(x: Floats, width: float) -> npt.NDArray[np.bool_]:
    """Samples after the gap has surely been crossed once: before, the start decides the output."""
    reach = np.maximum.accumulate(x) - np.minimum.accumulate(x)
    return np.asarray(reach > 1.5 * width, dtype=np.bool_)


def _covariance(
    best: object, logs: Sequence[BenchLog], keeps: Sequence[npt.NDArray[np.bool_]]
) -> tuple[Floats, float]:
    """Blocks of whole strokes: the encoder's rounding repeats itself within one."""
    jac, fun = np.asarray(best.jac), np.asarray(best.fun)  # type: ignore[attr-defined]
    weight = 1.0 / np.sqrt(1.0 + (fun / 3.0) ** 2)
    scores, blocks, at = [], [], 0
    for log, keep in zip(logs, keeps, strict=True):
        size = int(keep.sum())
        part = slice(at, at + size)
        scores.append(jac[part] * (weight[part] * fun[part])[:, None])
        blocks.append(
            stroke_blocks(log.time[keep], log.speed[keep], weight[part] * fun[part], log.period)
        )
        at += size
    return block_covariance(jac.T @ (weight[:, None] ** 3 * jac), scores, blocks)
