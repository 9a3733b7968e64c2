"""A speed loop from its own set points: gain and integral action by regression.

``y = K e + K z (integral of e)`` holds exactly wherever the output is not limited; each stretch
between two limits begins with an integral of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.level import Level
from elevon.calibrate.regression import Regression, with_deviations

__all__ = ["Stretch", "gain_and_zero", "speed_loop", "stretches"]

Bools = npt.NDArray[np.bool_]
_COLUMNS = ("gain", "integral", "set_point", "ramp")
_FEWEST = 100  # samples of a stretch
_READING = 2.5e-4  # s between the speed that the unit has read and the one that is recorded


@dataclass(frozen=True)
class Stretch:
    """A log's set point, speed and output, and the samples that count: one stretch."""

    time: Floats
    period: float
    set_point: Floats
    speed: Floats
    output: Floats
    used: Bools


def stretches(inside: Bools) -> list[Bools]:
    """Return the contiguous runs of samples that are long enough."""
    number = np.cumsum(np.diff(inside.astype(int), prepend=0) == 1)
    runs = [inside & (number == k) for k in range(1, int(number[-1]) + 1)]
    return [used for used in runs if used.sum() >= _FEWEST]


def speed_loop(parts: Sequence[Stretch], tick: float) -> Regression | None:
    """Fit gain and integral; None without stretches.

    The set point and its ramp are columns of their own: what its reading at another instant than
    the speed's adds.
    """
    rows, data, times = [], [], []
    for part in parts:
        h = part.period
        error = part.set_point - part.speed
        # The unit adds the error of each tick at once: half a tick more than the integral.
        total = np.cumsum(error) * h - 0.5 * h * error + 0.5 * tick * error
        ramp = np.gradient(part.set_point, h)
        rows.append(np.stack([error, total, part.set_point, ramp], axis=1)[part.used])
        data.append(part.output[part.used])
        times.append((part.time[part.used], np.ones(int(part.used.sum())), h))
    if not rows:
        return None
    start = np.repeat(np.eye(len(rows)), [len(row) for row in rows], axis=0)
    design, values = np.hstack([np.vstack(rows), start]), np.concatenate(data)
    scale = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    scaled, *_ = np.linalg.lstsq(design / scale, values, rcond=None)
    value = np.asarray(scaled / scale, dtype=np.float64)
    names = (*_COLUMNS, *(f"start{k}" for k in range(len(rows))))
    residual = values - design @ value
    return with_deviations(names, value, design, residual, np.ones(len(residual)), times=times)


def gain_and_zero(fit: Regression) -> tuple[Level, Level]:
    """Return the gain and the zero (one over the integral time) of a fit."""
    gain, integral = fit["gain"], fit["integral"]
    zero = integral / gain
    slope = np.zeros(len(fit.value))
    slope[0], slope[1] = -integral / gain**2, 1.0 / gain
    spread = float(np.sqrt(max(float(slope @ fit.covariance @ slope), 0.0)))
    # A speed read earlier or later than it is recorded adds to the gain what the integral makes of
    # it.
    late = abs(integral) * _READING
    return (
        Level(gain, fit.std("gain"), fit.degrees).widened(late),
        Level(zero, spread, fit.degrees).widened(late * zero / gain),
    )
