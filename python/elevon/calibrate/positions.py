"""What the two positions and the set points show: backlash, encoder, speed sensor, limits.

The encoder shows the motor's angle over the ratio, after the backlash: one equation, no friction,
inertia or controller in it. All samples count, those inside the gap too. A campaign may change the
backlash between its logs: then each log has its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import fmean, stdev

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Bools, Floats
from elevon.calibrate.kinematics import CommandFit, speed_limit, speed_sensor
from elevon.calibrate.named import named
from elevon.estimate import Estimate, quantile
from elevon.estimate.covariance import numbered_strokes
from elevon.estimate.number import weighted_mean
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


#: What may be estimated for each log on its own.
PER_LOG = ("backlash.total",)
_APART = 0.05  # relative difference of two backlashes that is one
_COUNTS = 3.0  # counts of the encoder that it also exceeds
_SIGMAS = 4.0  # deviations that it also exceeds


def differing_backlashes(logs: Sequence[Log], ratio: float, count: float) -> dict[str, BacklashFit]:
    """Return each log's own fit where the logs' backlashes differ, else nothing.

    Parameters
    ----------
    logs : sequence of Log
        Those without both positions, or without a reversal, are passed over.
    ratio : float
        Gear ratio.
    count : float
        One count of the encoder at the output [rad].
    """
    widths = [median_width(log, ratio, count) for log in logs]
    known = [width for width in widths if width is not None]
    if len(known) < 2 or not _apart(min(known), max(known), count, 0.0):
        return {}
    fits = {log.name: fit_backlash([log], ratio, count) for log in logs}
    backlashes = {name: fit for name, fit in fits.items() if fit is not None}
    least = min(backlashes.values(), key=lambda fit: fit.backlash[0])
    most = max(backlashes.values(), key=lambda fit: fit.backlash[0])
    std = math.hypot(least.backlash[1], most.backlash[1])
    return backlashes if _apart(least.backlash[0], most.backlash[0], count, std) else {}


def _apart(least: float, most: float, count: float, std: float) -> bool:
    return most - least > max(_COUNTS * count, _APART * most, _SIGMAS * std)


def mean_backlash(backlashes: dict[str, BacklashFit]) -> BacklashFit:
    """The mean of logs whose backlashes differ, its deviation that of one log about it."""
    widths = [fit.backlash[0] for fit in backlashes.values()]
    noise = max(fit.backlash[1] for fit in backlashes.values())
    first = next(iter(backlashes.values()))
    width = (fmean(widths), math.hypot(stdev(widths), noise))
    return replace(first, backlash=width, degrees=len(widths) - 1, logs=tuple(backlashes))


def pooled_backlash(backlashes: dict[str, BacklashFit]) -> BacklashFit:
    """Offset, gain and delay of the encoder over all logs; the backlash is the widest log's."""
    fits = list(backlashes.values())
    best = max(fits, key=lambda fit: fit.backlash[0])
    if any(fit.floats for fit in fits):
        return best
    return replace(
        best,
        offset=weighted_mean([fit.offset for fit in fits]),
        gain=weighted_mean([fit.gain for fit in fits]),
        delay=weighted_mean([fit.delay for fit in fits]),
        logs=tuple(backlashes),
    )


def backlashes_differ(backlashes: dict[str, BacklashFit], extra: float) -> str:
    """Say that the backlashes differ, with each log's, in degrees, and what becomes of it."""
    each = ", ".join(
        f"{name} {math.degrees(fit.backlash[0] - extra):.2f} deg"
        for name, fit in backlashes.items()
    )
    return (
        f"backlashes differ: {each}; backlash.total is their mean with the interval of one log, or "
        "left as it was where they differ by more than a quarter of it "
        "(--per-log backlash.total lists each "
        "log's with its interval)"
    )


_OTHER = 0.005  # relative: a limit nearer the actuator file's than this is the actuator file's
_ROUNDED = 0.1  # counts: what rounding to counts may shift where every stroke turns alike
_TURNS = 0.2  # share of that in the encoder's gain
_FLAT = 0.25  # counts: the same where the output stands still in the backlash, long at one count
_LOOSE = 0.05  # relative deviation above which the position gain is not determined


def position_estimates(
    logs: Sequence[Log], actuator: Actuator, per_log: Sequence[str] = ()
) -> tuple[list[Estimate], tuple[str, ...]]:
    """Return backlash, encoder, speed sensor, speed limit as far as the logs show, and words.

    Parameters
    ----------
    logs : sequence of Log
        The data.
    actuator : Actuator
        Values before.
    per_log : sequence of str
        Of `elevon.calibrate.positions.PER_LOG`: estimated for each log.
    """
    estimates, findings = _backlash_estimates(logs, actuator, "backlash.total" in per_log)
    return [
        *estimates,
        *_speed_estimates(logs, actuator),
        *_limit_estimates(logs, actuator),
    ], findings


def _backlash_estimates(
    logs: Sequence[Log], actuator: Actuator, each: bool
) -> tuple[list[Estimate], tuple[str, ...]]:
    """Backlash and encoder; where backlashes differ their mean, and each log's."""
    value = actuator.parameters.value
    ratio, count = value("gear.ratio"), encoder_count(actuator)
    backlashes = differing_backlashes(logs, ratio, count)
    backlash = pooled_backlash(backlashes) if backlashes else fit_backlash(logs, ratio, count)
    if backlash is None:
        return [], ()
    estimates = _backlash(backlash, count, actuator)
    estimates += [
        _initial(log, backlash, count, actuator)
        for log in logs
        if log.has("motor_position", "output_position")
    ]
    fitted = backlashes
    if each and not backlashes:
        fits = {log.name: fit_backlash([log], ratio, count) for log in logs}
        fitted = {name: fit for name, fit in fits.items() if fit is not None}
    if each:
        estimates += [_own_backlash(name, fit, count, actuator) for name, fit in fitted.items()]
    if not backlashes:
        return estimates, ()
    others = [item for item in estimates if item.path != "backlash.total"]
    mean = _backlash(mean_backlash(backlashes), count, actuator)
    total = [
        replace(item, note=f"{item.note}; mean of logs that differ")
        for item in mean
        if item.path == "backlash.total"
    ]
    return [*total, *others], (backlashes_differ(backlashes, value("backlash.extra")),)


def _own_backlash(name: str, backlash: BacklashFit, count: float, actuator: Actuator) -> Estimate:
    """Backlash of one log."""
    total = _backlash(backlash, count, actuator)[0]
    return replace(total, path=f"backlash.total[{name}]", in_set=False, note="of this log alone")


def _speed_estimates(logs: Sequence[Log], actuator: Actuator) -> list[Estimate]:
    """Gain and offset of the speed sensor."""
    return [
        named(Estimate(*pair), f"sensor.speed_{name}", actuator)
        for name, pair in (speed_sensor(logs) or {}).items()
    ]


def _limit_estimates(logs: Sequence[Log], actuator: Actuator) -> list[Estimate]:
    """Limit of the speed, where a log holds it and it is not the actuator file's."""
    path = "control.speed_limit"
    limit = speed_limit(logs)
    if limit is None or abs(limit / actuator.parameters.value(path) - 1.0) <= _OTHER:
        return []
    number = Estimate(limit, 1e-4 * limit, interval=(limit * (1 - 2e-4), limit * (1 + 2e-4)))
    return [named(number, path, actuator, "held flat in the log")]


def encoder_count(actuator: Actuator) -> float:
    """One count of the output encoder [rad at the output]."""
    value = actuator.parameters.value
    counts = value("sensor.encoder.pulses") * value("sensor.encoder.edges")
    return 2.0 * math.pi / (counts * value("sensor.encoder.wheel_ratio"))


def _backlash(backlash: BacklashFit, count: float, actuator: Actuator) -> list[Estimate]:
    value = actuator.parameters.value
    total, rounded = backlash.backlash[0] - value("backlash.extra"), _ROUNDED * count
    number = Estimate(total, math.hypot(backlash.backlash[1], rounded), backlash.degrees)
    floats = "; it floats: from the span" if backlash.floats else ""
    if backlash.beyond > 0.0:
        deflected = math.degrees(backlash.beyond)
        floats += f" without load; under load {deflected:.2g} deg more"
    # The model's encoder truncates; one that rounds would sit half a count lower.
    offset = (
        backlash.offset[0] + 0.5 * count + value("sensor.resolver.offset") / value("gear.ratio")
    )
    note = "encoder less motor over ratio, backlash centred: only the difference is known"
    rows = [
        named(
            number, "backlash.total", actuator, f"total, at the output{floats}",
            in_set=total >= 0.0,
        ),
        named(_counted(offset, backlash, count), "sensor.encoder.offset", actuator, note),
    ]  # fmt: skip
    return rows if backlash.floats else [*rows, *_encoder(backlash, actuator, rounded)]


def _counted(value: float, backlash: BacklashFit, count: float) -> Estimate:
    """A place between two positions, known to half a count of the encoder at best."""
    half = quantile(backlash.degrees) * math.hypot(backlash.offset[1], _ROUNDED * count)
    half += 0.5 * count
    std = math.hypot(backlash.offset[1], count / math.sqrt(12.0))
    return Estimate(value, std, interval=(value - half, value + half))


def _initial(log: Log, backlash: BacklashFit, count: float, actuator: Actuator) -> Estimate:
    """Where in the backlash the motor stood when a log began."""
    ratio = actuator.parameters.value("gear.ratio")
    seen = backlash.gain[0] * log.motor[0] / ratio + backlash.offset[0] - log.output[0]
    number = _counted(float(seen), backlash, count)
    return named(number, f"initial.lead[{log.name}]", actuator)


def _encoder(backlash: BacklashFit, actuator: Actuator, rounded: float) -> list[Estimate]:
    """Delay and gain of the encoder against the motor's sensor."""
    # All counts between the turns determine the gain, only those at the turns are rounded alike.
    gain, std = backlash.gain[0], math.hypot(backlash.gain[1], _TURNS * rounded / backlash.reach)
    return [
        named(Estimate(*backlash.delay, backlash.degrees), "sensor.encoder_delay", actuator),
        named(
            Estimate(gain, std, backlash.degrees), "sensor.encoder.gain", actuator,
            "encoder over motor and ratio", in_set=abs(gain - 1.0) > max(3.0 * std, 1e-4),
        ),
    ]  # fmt: skip


def gain_estimate(fits: Sequence[CommandFit], actuator: Actuator) -> Estimate | None:
    """Position gain pooled over the commands; the logs' scatter counts where it is larger.

    Parameters
    ----------
    fits : sequence of CommandFit
        One a log.
    actuator : Actuator
        Values before, and the count of the encoder: what rounding may shift counts like noise.
    """
    count = encoder_count(actuator)
    rounded = [math.hypot(fit.gain_std, _FLAT * count * fit.gain / fit.reach) for fit in fits]
    good = [
        (fit, std) for fit, std in zip(fits, rounded, strict=True) if 0.0 < std < _LOOSE * fit.gain
    ]
    if not good:
        return None
    gain, deviation = weighted_mean([(fit.gain, std) for fit, std in good])
    note = f"from the command's waveform in {', '.join(fit.log for fit, _ in good)}"
    number = Estimate(gain, deviation, max(len(good) - 1.0, 2.0))
    return named(number, "control.position_gain", actuator, note)
