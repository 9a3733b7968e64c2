"""Static friction from the instants at which the shaft breaks away.

After a reversal of the torque the shaft sticks, the current climbs, and the shaft moves off when
the torque exceeds the static friction and the brake. The motor's angle tells the instant to a
fraction of a sample, the current its torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.calibrate.log import BenchLog

__all__ = ["Breakaways", "breakaways", "static_friction"]

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
_FEWEST = 4  # breakaways
_MEDIAN = 1.2533  # deviation of a median over that of a mean
_STUCK = 0.02  # s that the shaft stands still at least
_CLIMB = 0.04  # s of the climb before the instant that are used, at most
_TAIL = 5  # samples of the set point that are as good as straight
_SURE = 5.0  # deviations of the angle's noise that are motion
_FINEST = 1e-6  # rad: motion smaller than this is none
_AWAY = 0.05  # s after the instant in which the motion must have become clear
_CLEAR = 0.02  # of the highest speed


@dataclass(frozen=True)
class Breakaways:
    """Breakaways of all logs, one entry each.

    Attributes
    ----------
    current : ndarray, shape (n,)
        Current that made the torque of the instant, as its sensor would show it without lag [A].
    brake : ndarray, shape (n,)
        Torque of the brake [N m].
    direction : ndarray, shape (n,)
        Of the motion that follows, 1 or -1.
    slope : ndarray, shape (n,)
        Climb of the current towards that motion [A/s].
    """

    current: Floats
    brake: Floats
    direction: Floats
    slope: Floats


def static_friction(
    logs: Sequence[BenchLog],
    keeps: Sequence[Bools],
    *,
    constant: float,
    offset: float,
    lag: float,
) -> tuple[float, float, float] | None:
    """Static friction from all breakaways: value, deviation [N m] and degrees of freedom.

    Parameters
    ----------
    logs, keeps
        As `breakaways`.
    constant : float
        Torque constant [N m/A].
    offset, lag : float
        Of the measured current [A, s].

    Returns
    -------
    (float, float, float) or None
        Median; its deviation from the scatter, and from the climb within one sample, in which
        the instant may be misplaced alike every time. None with fewer than four breakaways.
    """
    found = breakaways(logs, keeps, lag)
    count = len(found.current)
    if count < _FEWEST:
        return None
    torque = constant * found.direction * (found.current - offset) - found.brake
    middle = float(np.median(torque))
    scatter = 1.4826 * float(np.median(np.abs(torque - middle)))
    period = max(log.period for log in logs)
    climb = constant * float(np.median(found.slope)) * period / np.sqrt(3.0)
    std = float(np.hypot(_MEDIAN * scatter / np.sqrt(count), climb))
    return middle, std, count - 1.0


@dataclass(frozen=True)
class _Event:
    """One breakaway: its instant, and set point and measured current while the shaft stuck."""

    when: float
    way: float
    brake: float
    time: Floats
    target: Floats
    current: Floats

    def line(self) -> tuple[float, float]:
        """Slope and level at the instant of the set point's last stretch."""
        last = slice(-_TAIL, None)
        slope, level = np.polyfit(self.time[last] - self.when, self.target[last], 1)
        return float(slope), float(level)


def breakaways(logs: Sequence[BenchLog], keeps: Sequence[Bools], lag: float) -> Breakaways:
    """Find every breakaway whose torque is known.

    The set point of the current gives the shape of the climb, free of noise; how far the measured
    current stays behind is one number for all climbs, its offset another.

    Parameters
    ----------
    logs : sequence of BenchLog
        With the motor's angle; those whose brake acted unmeasured are passed over.
    keeps : sequence of ndarray of bool
        Samples that may be used, one a log.
    lag : float
        Of the measured current behind the torque [s].
    """
    events = [
        event
        for log, keep in zip(logs, keeps, strict=True)
        if log.motor is not None and log.brake.known in {"off", "torque"}
        for event in _events(log, log.motor, keep & log.good)
    ]
    lines = np.array([event.line() for event in events], dtype=np.float64).reshape(-1, 2)
    way = np.array([event.way for event in events], dtype=np.float64)
    climbing = lines[:, 0] * way > 0.0
    events = [event for event, up in zip(events, climbing, strict=True) if up]
    lines, way = lines[climbing], way[climbing]
    gap, offset = _behind(events)
    current = lines[:, 1] - offset - gap * way + lag * lines[:, 0]
    brake = np.array([event.brake for event in events], dtype=np.float64)
    return Breakaways(current, brake, way, lines[:, 0] * way)


def _behind(events: Sequence[_Event]) -> tuple[float, float]:
    """How far the measured current stays behind its set point in a climb, and its offset [A]."""
    if not events:
        return 0.0, 0.0
    rest = np.concatenate([e.target - e.current for e in events])
    way = np.concatenate([np.full(len(e.time), e.way) for e in events])
    found, *_ = np.linalg.lstsq(np.column_stack((way, np.ones_like(way))), rest, rcond=None)
    return float(found[0]), float(found[1])


def _events(log: BenchLog, motor: Floats, keep: Bools) -> list[_Event]:
    least, most = round(_STUCK / log.period), round(_CLIMB / log.period)
    found = []
    for begin, end in _stuck(motor, least):
        instant = _instant(log, motor, end)
        part = slice(max(begin + 1, end - most), end + 1)
        if instant is None or not keep[part].all():
            continue
        brake = np.interp(instant[0], log.brake.time, log.brake.level)
        found.append(
            _Event(
                *instant,
                float(brake) if log.brake.measured else 0.0,
                log.time[part],
                log.current_target[part],
                log.current[part],
            )
        )
    return found


def _stuck(motor: Floats, least: int) -> list[tuple[int, int]]:
    """First and last sample of every stretch without motion of at least so many samples."""
    moved = np.abs(np.diff(motor))
    jumps = np.abs(np.diff(motor, 3))
    noise = 1.4826 * float(np.median(jumps[jumps > 0.0])) / np.sqrt(20.0) if jumps.any() else 0.0
    # The noise of a smooth motion's third differences is far below its first ones.
    still = np.concatenate(([False], moved <= max(_SURE * noise, _FINEST), [False]))
    edges = np.flatnonzero(np.diff(still.astype(np.int8)))
    pairs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [(begin, end) for begin, end in pairs if end - begin >= least and end < len(motor) - 3]


def _instant(log: BenchLog, motor: Floats, end: int) -> tuple[float, float] | None:
    """Instant and direction of the motion after sample `end`; None where it does not go on.

    Off a standstill the angle grows with the square of time: the roots of two samples point back
    at the instant.
    """
    ahead = motor[end + 1 : end + 1 + max(3, round(_AWAY / log.period))] - motor[end]
    way = float(np.sign(ahead[-1]))
    top = float(np.abs(log.speed).max())
    if way == 0.0 or abs(ahead[-1] - ahead[-2]) < _CLEAR * top * log.period:
        return None
    first, second = way * float(ahead[0]), way * float(ahead[1])
    if not 0.0 < first < second:
        return None
    back = np.sqrt(first) / (np.sqrt(second) - np.sqrt(first))
    return float(log.time[end + 1]) - min(max(float(back), 0.0), 1.0) * log.period, way
