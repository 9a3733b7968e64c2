"""Logs of a high rate, thinned: what is calibrated and diagnosed is far below a kilohertz."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats

if TYPE_CHECKING:
    from elevon.calibrate.log import BenchLog

__all__ = ["RATE", "group_means", "groups_of", "thinned"]

#: Hz, the least that is left. ASSUMED: ten times the lag of the bench's current filter, more than
#: twice the bench's own rate; time and memory of calibration grow with the samples.
RATE = 1000.0


def groups_of(time: Floats) -> int:
    """Return how many samples of a log of these instants [s] make one."""
    period = float(np.median(np.diff(time)))
    return max(1, int(1.0 / (period * RATE) + 1e-6))


def group_means(values: Floats, count: int) -> Floats:
    """Means of groups of `count` samples, shape (n,) to (n // count,); NaN where one is missing."""
    whole = len(values) // count
    return np.asarray(values[: whole * count].reshape(whole, count).mean(axis=1))


def thinned(log: BenchLog) -> BenchLog:
    """Return a log of at least `RATE`: means of groups, all channels and the clock alike.

    A mean over a group acts on every channel in the same way, so no channel is late against
    another, and what is linear between them stays as it is.
    """
    count = groups_of(log.time)
    if count == 1:
        return log
    time = group_means(log.time, count)
    size = len(time)

    def mean(values: Floats | None) -> Floats | None:
        return None if values is None else group_means(values, count)

    brake = log.brake
    if len(brake.time):
        brake = replace(brake, time=brake.time - time[0])
    good: npt.NDArray[np.bool_] = np.asarray(log.good[: size * count].reshape(size, count).all(1))
    return replace(
        log,
        start=log.start + float(time[0]),
        time=time - time[0],
        speed_ref=group_means(log.speed_ref, count),
        speed=group_means(log.speed, count),
        current=group_means(log.current, count),
        current_target=group_means(log.current_target, count),
        motor=mean(log.motor),
        output=mean(log.output),
        brake=brake,
        good=good,
    )
