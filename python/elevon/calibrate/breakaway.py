"""Static friction from the instants at which the shaft breaks away.

After a reversal of the torque the shaft sticks, the current climbs, and the shaft moves off when
the torque exceeds the static friction and the brake. The motor's angle shows the instant to a
fraction of a sample, the current its torque.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.logs.log import Log

_FEWEST = 4  # breakaways
_MEDIAN = 1.2533  # deviation of a median over that of a mean
_STUCK = 0.02  # s that the shaft stands still at least
_CLIMB = 0.04  # s of the climb before the instant that are used, at most
_TAIL = 5  # samples of the set point that are as good as straight
_NOISY_TAIL = 0.02  # s of a measured current that are as good as straight: its noise averages out
_MOTION = 5.0  # deviations of the angle's noise that are motion
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
    behind : float
        Deviation of how far the measured current stays behind its set point: alike for all [A].
    """

    current: Floats
    brake: Floats
    direction: Floats
    slope: Floats
    behind: float


def breakaway_torque(
    logs: Sequence[Log],
    *,
    constant: float,
    offset: float,
    lag: float,
    slow: float,
) -> tuple[float, float, float] | None:
    """Static friction from all breakaways: value, deviation [N m] and degrees of freedom.

    Parameters
    ----------
    logs
        As `breakaways`.
    constant : float
        Torque constant [N m/A].
    offset, lag : float
        Of the measured current [A, s].
    slow : float
        Speed [rad/s] below which the shaft counts as at rest.

    Returns
    -------
    (float, float, float) or None
        Median; its deviation from the scatter, from the climb within one sample, in which the
        instant may be misplaced alike every time, and from the set point's own shift. None with
        fewer than four breakaways.
    """
    every = breakaways(logs, lag, slow)
    count = len(every.current)
    if count < _FEWEST:
        return None
    torque = constant * every.direction * (every.current - offset) - every.brake
    middle = float(np.median(torque))
    scatter = 1.4826 * float(np.median(np.abs(torque - middle)))
    period = max(log.period for log in logs)
    climb = constant * float(np.median(every.slope)) * period / np.sqrt(3.0)
    noise_part = _MEDIAN * scatter / np.sqrt(count)
    std = float(np.sqrt(noise_part**2 + climb**2 + (constant * every.behind) ** 2))
    return middle, std, count - 1.0


@dataclass(frozen=True)
class _Event:
    """One breakaway: its instant, and set point and measured current while the shaft stuck."""

    when: float
    direction: float
    brake: float
    time: Floats
    target: Floats
    current: Floats
    tail: int

    def climbs(self) -> bool:
        """Whether the set point climbs towards the motion, over the standstill that is used."""
        slope = np.polyfit(self.time - self.when, self.target, 1)[0]
        return bool(slope * self.direction > 0.0)

    def line(self) -> tuple[float, float]:
        """Slope and level at the instant of the set point's last stretch."""
        last = slice(-self.tail, None)
        slope, level = np.polyfit(self.time[last] - self.when, self.target[last], 1)
        return float(slope), float(level)


def breakaways(logs: Sequence[Log], lag: float, slow: float) -> Breakaways:
    """Find every breakaway whose torque is known.

    The set point of the current gives the shape of the climb, free of noise; how far the measured
    current stays behind is one number for all climbs, its offset another.

    Parameters
    ----------
    logs : sequence of Log
        With the motor's angle; those whose brake acted unmeasured are passed over.
    lag : float
        Of the measured current behind the torque [s].
    slow : float
        Speed [rad/s] below which the shaft counts as at rest.
    """
    events = [
        event
        for log in logs
        if log.has("motor_position") and log.brake.known in {"off", "torque"}
        for event in _events(log, log.motor, slow)
    ]
    lines = np.array([event.line() for event in events], dtype=np.float64).reshape(-1, 2)
    direction = np.array([event.direction for event in events], dtype=np.float64)
    climbing = np.array([event.climbs() for event in events], dtype=np.bool_)
    events = [event for event, up in zip(events, climbing, strict=True) if up]
    lines, direction = lines[climbing], direction[climbing]
    gap, offset, behind = _behind(events)
    current = lines[:, 1] - offset - gap * direction + lag * lines[:, 0]
    brake = np.array([event.brake for event in events], dtype=np.float64)
    return Breakaways(current, brake, direction, lines[:, 0] * direction, behind)


def _behind(events: Sequence[_Event]) -> tuple[float, float, float]:
    """How far the current stays behind its set point in a climb, its offset, a deviation [A]."""
    if not events:
        return 0.0, 0.0, 0.0
    deficit = np.concatenate([e.target - e.current for e in events])
    direction = np.concatenate([np.full(len(e.time), e.direction) for e in events])
    columns = np.column_stack((direction, np.ones_like(direction)))
    (gap, offset), *_ = np.linalg.lstsq(columns, deficit, rcond=None)
    # One climb is one observation.
    means = [float(np.mean(e.target - e.current)) - gap * e.direction - offset for e in events]
    return float(gap), float(offset), float(np.std(means) / np.sqrt(len(means)))


def _events(log: Log, motor: Floats, slow: float) -> list[_Event]:
    least, most = round(_STUCK / log.period), round(_CLIMB / log.period)
    noisy = not log.has("current_ref")
    tail = max(_TAIL, round(_NOISY_TAIL / log.period)) if noisy else _TAIL
    events = []
    for begin, end in stuck_stretches(motor, least, slow * log.period):
        instant = _instant(log, motor, end)
        part = slice(max(begin + 1, end - most), end + 1)
        if instant is None or not log.good[part].all():
            continue
        brake = np.interp(instant[0], log.brake.time, log.brake.level)
        events.append(
            _Event(
                *instant,
                float(brake) if log.brake.measured else 0.0,
                log.time[part],
                log.current_target[part],
                log.current[part],
                tail,
            )
        )
    return events


def stuck_stretches(motor: Floats, least: int, small: float) -> list[tuple[int, int]]:
    """First and last sample of every stretch that moves less a sample than is small [rad]."""
    moved = np.abs(np.diff(motor))
    jumps = np.abs(np.diff(motor, 3))
    noise = 1.4826 * float(np.median(jumps[jumps > 0.0])) / np.sqrt(20.0) if jumps.any() else 0.0
    # The noise of a smooth motion's third differences is far below its first ones.
    standing = np.concatenate(([False], moved <= max(_MOTION * noise, _FINEST, small), [False]))
    edges = np.flatnonzero(np.diff(standing.astype(np.int8)))
    pairs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [(begin, end) for begin, end in pairs if end - begin >= least and end < len(motor) - 3]


def _instant(log: Log, motor: Floats, end: int) -> tuple[float, float] | None:
    """Instant and direction of the motion after sample `end`; None where it does not go on.

    Off a standstill the angle grows with the square of time: the roots of two samples point back
    at the instant.
    """
    ahead = motor[end + 1 : end + 1 + max(3, round(_AWAY / log.period))] - motor[end]
    direction = float(np.sign(ahead[-1]))
    top = float(np.abs(log.speed).max())
    if direction == 0.0 or abs(ahead[-1] - ahead[-2]) < _CLEAR * top * log.period:
        return None
    first, second = direction * float(ahead[0]), direction * float(ahead[1])
    if not 0.0 < first < second:
        return None
    back = np.sqrt(first) / (np.sqrt(second) - np.sqrt(first))
    return float(log.time[end + 1]) - min(max(float(back), 0.0), 1.0) * log.period, direction
