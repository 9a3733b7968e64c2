"""Backlash, encoder gain and offset from the two positions alone.

The encoder shows the motor's angle over the ratio, after the backlash: one equation, no
friction, inertia or controller in it. All samples count, those inside the gap too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Bools, Floats
from elevon.estimate import quantile
from elevon.estimate.covariance import numbered_strokes
from elevon.estimate.residual import fit_residual
from elevon.estimate.signals import through_backlash
from elevon.logs.log import Log

_TRAVEL = 3.0  # backlashes (or counts) of travel in both directions that a log must have
_STRETCH = 0.5  # s: of a free output, within which a load is taken as constant (ASSUMED)
_AGREE = 3  # stretches of one span at least
_DEFLECTS = 0.1  # of the backlash: a span that goes further is a deflection under load (ASSUMED)
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
    beyond : float
        Of a free output: how much further than the backlash the difference goes under load, by the
        transmission's compliance [rad].
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
    beyond: float = 0.0


def fit_backlash(logs: Sequence[Log], ratio: float, count: float) -> BacklashFit | None:
    """Fit backlash, offset, gain and delay to every log that moves in both directions.

    Parameters
    ----------
    logs : sequence of Log
        Those without both positions are passed over.
    ratio : float
        Gear ratio.
    count : float
        One count of the encoder at the output [rad].

    Returns
    -------
    BacklashFit or None
        None where no log has both positions, a reversal, and a stroke wider than the lag.
    """
    used = [log for log in logs if _usable(log, ratio, count)]
    if not used:
        return None
    positions = _Positions.of(used, ratio)
    wide = [k for k, keep in enumerate(positions.keeps) if keep.any()]
    if not wide:
        return None
    if len(wide) < len(used):
        return fit_backlash([used[k] for k in wide], ratio, count)
    return _fitted(positions, count)


@dataclass(frozen=True)
class _Positions:
    """Two positions of several logs at the output, and the samples of each that count.

    `start` is backlash and offset by the medians.
    """

    logs: Sequence[Log]
    drivers: Sequence[Floats]
    outputs: Sequence[Floats]
    speeds: Sequence[Floats]
    keeps: Sequence[Bools]
    start: tuple[float, float]

    @classmethod
    def of(cls, logs: Sequence[Log], ratio: float) -> _Positions:
        drivers, outputs = [log.motor / ratio for log in logs], [log.output for log in logs]
        start = _start(logs, drivers, outputs)
        keeps = [_after_reversal(x, start[0]) for x in drivers]
        return cls(logs, drivers, outputs, [log.speed / ratio for log in logs], keeps, start)

    @property
    def reach(self) -> float:
        return 0.5 * max(float(np.ptp(x)) for x in self.drivers)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(log.name for log in self.logs)

    def misfit(self, p: Floats) -> Floats:
        """Encoder as predicted less as logged, of backlash, offset, gain and delay."""
        parts = []
        for x, y, v, keep in zip(self.drivers, self.outputs, self.speeds, self.keeps, strict=True):
            following = through_backlash(x, abs(float(p[0])))
            moving = np.gradient(following) / np.maximum(np.abs(np.gradient(x)), 1e-15)
            follows = v * np.clip(np.abs(moving), 0.0, 1.0)
            parts.append(((p[2] * following + p[1] - p[3] * follows) - y)[keep])
        return np.concatenate(parts)


def _fitted(positions: _Positions, count: float) -> BacklashFit:
    scale = np.array([count, count, 1e-4, 1e-3])

    def residual(p: Floats) -> Floats:
        return positions.misfit(p) / count

    best = fit_residual(
        residual, [*positions.start, 1.0, 0.0], scale=scale, loss="soft_l1", soft=3.0, most=30,
        jacobian=lambda p: _jacobian(residual, p, scale),
    )  # fmt: skip
    rms = count * float(np.sqrt(np.mean(best.residual**2)))
    if rms > _FLOATS * count:
        return _spanned(positions, count=count, rms=rms)
    # Blocks of whole strokes: the encoder's rounding repeats itself within one.
    pairs = zip(positions.logs, positions.keeps, strict=True)
    strokes = [(x.time[k], x.speed[k], x.period) for x, k in pairs]
    covariance, degrees = best.covariance(numbered_strokes(strokes, best.weight * best.residual))
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    value = np.append(abs(best.x[0]), best.x[1:])
    backlash, offset, gain, delay = ((float(v), float(s)) for v, s in zip(value, std, strict=True))
    return BacklashFit(
        backlash, offset, gain, delay, degrees, rms, positions.reach, positions.names
    )


def _spanned(positions: _Positions, *, count: float, rms: float) -> BacklashFit:
    """Backlash of an output that flies from one end of the gap to the other.

    The difference of the two positions piles up at both ends. What it leaves out at either side
    within twenty to one crosses the backlash or is not yet in contact; what lies beyond two hundred
    to one is the compliance of the contacts: the backlash is between the two spans, less the count
    of the rounding. Where the log spans far more than the stretches that agree with each other,
    loads deflect the transmission: those stretches hold the backlash, the rest is compliance.
    """
    samples = zip(positions.drivers, positions.outputs, positions.keeps, strict=True)
    gaps = [(y - x)[keep] for x, y, keep in samples]
    low, high, middle = _spans(gaps)
    pairs = zip(gaps, positions.logs, strict=True)
    unloaded = _unloaded([gap[a:b] for gap, log in pairs for a, b in _stretches(gap, log)], count)
    beyond = 0.0
    if unloaded and high > (1.0 + _DEFLECTS) * max(span for _, span, _ in map(_span, unloaded)):
        whole, (low, high, middle) = high, _spans(unloaded)
        beyond = whole - high
    low, high = max(low - count, 0.0), high - count
    half = 0.5 * (high - low) / quantile(np.inf)
    return BacklashFit(
        backlash=(0.5 * (low + high), half),
        offset=(middle, half),
        gain=(1.0, np.inf),
        delay=(0.0, np.inf),
        degrees=np.inf,
        rms=rms,
        reach=positions.reach,
        logs=positions.names,
        floats=True,
        beyond=beyond,
    )


def _span(gap: Floats) -> tuple[float, float, float]:
    """Span of a difference within twenty to one, within two hundred to one, and its middle."""
    first, low, high, last = (float(x) for x in np.percentile(gap, [0.5, 5.0, 95.0, 99.5]))
    return high - low, last - first, 0.5 * (last + first)


def _spans(gaps: Sequence[Floats]) -> tuple[float, float, float]:
    """Least inner and largest outer span, and the mean of the middles."""
    inner, outer, middles = zip(*map(_span, gaps), strict=True)
    return min(inner), max(outer), float(np.mean(middles))


def _stretches(gap: Floats, log: Log) -> list[tuple[int, int]]:
    width = max(round(_STRETCH / log.period), 2)
    return [(k, k + width) for k in range(0, len(gap) - width + 1, width)]


def _unloaded(stretches: Sequence[Floats], count: float) -> list[Floats]:
    """Return the stretches that cross the backlash without a load; none where few agree.

    A load deflects the transmission as far as it is large; without one the span is the backlash in
    every stretch: it is the span on which most stretches agree to two counts.
    """
    crossing = [gap for gap in stretches if _span(gap)[1] > _TRAVEL * count]
    spans = np.array([_span(gap)[1] for gap in crossing])
    near = np.abs(spans[:, None] - spans) <= 2.0 * count
    if len(spans) == 0 or near.sum(axis=1).max() < _AGREE:
        return []
    alike = near[int(np.argmax(near.sum(axis=1)))]
    return [gap for gap, same in zip(crossing, alike, strict=True) if same]


def _jacobian(residual: Callable[[Floats], Floats], p: Floats, scale: Floats) -> Floats:
    """Central differences over steps of the size that matters: the backlash's kinks average out."""
    columns = []
    for k, step in enumerate(0.5 * scale):
        shift = np.zeros_like(p)
        shift[k] = step
        columns.append((residual(p + shift) - residual(p - shift)) / (2.0 * step))
    return np.column_stack(columns)


def _usable(log: Log, ratio: float, count: float) -> bool:
    if not log.has("motor_position", "output_position"):
        return False
    speed = np.abs(log.speed).max()
    both = min(float((log.speed > 0.1 * speed).mean()), float((log.speed < -0.1 * speed).mean()))
    return both > 0.02 and float(np.ptp(log.motor)) / ratio > _TRAVEL * count


def median_width(log: Log, ratio: float, count: float) -> float | None:
    """Backlash of one log [rad at the output] by the medians of each direction, or None."""
    if not _usable(log, ratio, count):
        return None
    return _start([log], [log.motor / ratio], [log.output])[0]


def _start(
    logs: Sequence[Log], drivers: Sequence[Floats], outputs: Sequence[Floats]
) -> tuple[float, float]:
    """Median lag of each direction, away from reversals: half a backlash either side of centre."""
    ahead, behind = [], []
    for log, x, y in zip(logs, drivers, outputs, strict=True):
        # Of the slower direction some samples must remain.
        fast = min(0.3 * np.abs(log.speed).max(), 0.9 * min(log.speed.max(), -log.speed.min()))
        lag = y - x
        ahead.append(np.median(lag[log.speed > fast]))
        behind.append(np.median(lag[log.speed < -fast]))
    up, down = float(np.median(ahead)), float(np.median(behind))
    return max(down - up, 1e-7), 0.5 * (up + down)


def _after_reversal(x: Floats, width: float) -> Bools:
    """Samples after the gap has surely been crossed once: before, the start decides the output."""
    reach = np.maximum.accumulate(x) - np.minimum.accumulate(x)
    return np.asarray(reach > 1.5 * width, dtype=np.bool_)
