"""Features of one log: a dozen numbers by linear regression, alike for logs and for model runs.

None is physics of its own: each is what a linear regression of one logged signal on others says.
What a fault does to them comes from model runs that pass through the same regressions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.engine.table import Feature, FeatureTable, FeatureVector

if TYPE_CHECKING:
    from elevon.logs.log import Log


_AFLOAT = 0.15  # of the difference's width: what it scatters in one direction if it is free
_LEAST_LOST_MOTION = (
    3e-4  # rad of that scatter: four counts of the bench's encoder, more than rounding leaves
)
_ROUNDS = 4  # of which end is nearer, and of the slope


def carried(driver: Floats, width: float) -> Bools:
    """Return the samples after the driver has passed the whole gap since it turned."""
    way = np.sign(np.gradient(driver))
    last = np.zeros(len(driver), dtype=np.intp)
    turns = np.flatnonzero(np.diff(way) != 0) + 1
    last[turns] = turns
    start = driver[np.maximum.accumulate(last)]
    return np.asarray(np.abs(driver - start) > 1.5 * width)


def floats(gap: Floats, way: Floats) -> bool:
    """Return whether the output flies freely in its backlash, no friction holding it.

    Parameters
    ----------
    gap : ndarray, shape (n,)
        Difference of the two positions [rad], where an output held by friction lies at one end.
    way : ndarray, shape (n,)
        Direction of the motion.
    """
    ends = [gap[way > 0.0], gap[way < 0.0]]
    if min(len(end) for end in ends) < 2:
        return False
    scatter = math.sqrt(0.5 * (float(np.var(ends[0])) + float(np.var(ends[1]))))
    return scatter > _LEAST_LOST_MOTION and scatter > _AFLOAT * _width(gap)


def spanned(gap: Floats, output: Floats) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return lost motion and scale of such an output, each with its deviation.

    The difference piles up at both ends of the backlash: which end is nearer, not the direction,
    stands beside the output's position. The lost motion is the width of what is left; one sample in
    ten is on the way or presses a contact. The quarters of the log give the deviations.

    Parameters
    ----------
    gap, output : ndarray, shape (n,)
        Difference of the two positions and the output's position [rad].
    """
    width, slope = _ends(gap, output)
    parts = zip(np.array_split(gap, 4), np.array_split(output, 4), strict=True)
    widths, slopes = np.array([_ends(*part) for part in parts]).T
    return (width, 0.5 * float(widths.std(ddof=1))), (slope, 0.5 * float(slopes.std(ddof=1)))


def _ends(gap: Floats, output: Floats) -> tuple[float, float]:
    """Width of the difference, and its slope over the output's position at either end."""
    centred, slope = output - float(np.mean(output)), 0.0
    for _ in range(_ROUNDS):
        residual = gap - slope * centred
        low, high = np.percentile(residual, [5.0, 95.0])
        end = np.sign(residual - 0.5 * (low + high))
        columns = np.column_stack([centred, end, np.ones_like(gap)])
        slope = float(np.linalg.lstsq(columns, gap, rcond=None)[0][0])
    return _width(gap - slope * centred), slope


def _width(gap: Floats) -> float:
    low, high = np.percentile(gap, [5.0, 95.0])
    return float(high - low)


Bools = npt.NDArray[np.bool_]
Fit = tuple[Floats, Floats]  # weights, shape (k,), and their covariance, shape (k, k)


def _table(*rows: Feature) -> FeatureTable:
    return {row.name: row for row in rows}


#: The least deviations stand beside what draws of the model show (another start, counts, clocks),
#: the mismatch is replaced by baselines of the same test; both, and the model's error (how much of
#: a ripple shows depends on the current loop, which the reduced-order model has not), are ASSUMED,
#: from logs of benches with another drive and friction law. One friction law acts in all tests of a
#: unit, at other speeds: its share is pooled. A voltage beside little current takes what the
#: switches drop, and a derivative's spikes move the speed gain by 20 %.
FEATURES = _table(
    Feature("lost_motion", "rad", "difference of the two positions between the directions",
            (0.01, 2e-5), (0.03, 1e-4)),
    Feature("position_scale", "1",
            "motor's position over the output's, by the gear ratio, less one",
            (0.0, 2e-4), (0.0, 1e-3), constant=True),
    Feature("dry_current", "A", "current that changes sign with the motion",
            (0.01, 0.0), (0.10, 0.0), kind="share", pooled=0.04),
    Feature("viscous_current", "A s/rad", "current by speed",
            (0.05, 0.0), (0.20, 0.0), kind="share"),
    Feature("inertia_current", "A s2/rad", "current by acceleration",
            (0.01, 0.0), (0.05, 0.0), kind="share"),
    Feature("brake_current", "A/(N m)", "current by brake torque",
            (0.01, 0.0), (0.03, 0.0), kind="share"),
    Feature("current_order_1", "1", "share of the current that turns with the electrical angle",
            (0.0, 0.003), (0.0, 0.006), 0.10, "size"),
    Feature("current_order_2", "1", "share of the current at twice the electrical angle",
            (0.0, 0.003), (0.0, 0.006), 0.35, "size"),
    Feature("current_shaft", "A", "current that turns with the motor's shaft",
            (0.0, 0.002), (0.0, 0.005), 0.20, "size"),
    Feature("voltage_per_speed", "V s/rad", "voltage by speed",
            (0.005, 0.0), (0.30, 0.0), 0.50),
    Feature("voltage_per_current", "ohm", "voltage by current",
            (0.05, 0.0), (1.0, 10.0), 0.50),
    Feature("voltage_order_1", "1", "share of the EMF that turns with the electrical angle",
            (0.0, 0.002), (0.0, 0.006), 0.30, "size"),
    Feature("voltage_order_2", "1", "share of the EMF at twice the electrical angle",
            (0.0, 0.002), (0.0, 0.006), 0.40, "size"),
    Feature("speed_gain", "A s/rad", "current set point by speed error",
            (0.03, 0.0), (0.40, 0.0), kind="share"),
    Feature("following_gain", "s", "following error over speed set point: 1/position gain",
            (0.0005, 0.0), (0.004, 0.0), kind="share", constant=True),
    Feature("current_sideband", "1",
            "share of the current at twice the electrical angle plus the shaft's",
            (0.0, 0.003), (0.0, 0.006), 0.40, "size"),
    Feature("voltage_sideband", "1",
            "share of the EMF at twice the electrical angle plus the shaft's",
            (0.0, 0.002), (0.0, 0.006), 0.40, "size"),
)  # fmt: skip
_BLOCKS = 16  # stretches of a log whose scores give the deviations
#: Stretches of what a speed controller's law leaves, each less the one before it: at each reversal
#: it is off alike in all logs of a test, which is no noise, and longer stretches take it for some.
_SHORT = 256
#: Share of what the voltage's regression leaves that may be in step with a column: the current
#: controller answers its sensor's noise by voltage, and that repeats with the motion, so stretches
#: of a log do not show it. ASSUMED: from units of another program whose speed is steady.
_IN_STEP = 0.1
LEAST = 100  # samples of a regression
#: rad at the output: largest amplitude of an encoder's error once a turn of its wheel; any up to it
#: is as likely. Where the wheel stands when the drive is switched on nobody knows, so the phase is
#: free. ASSUMED: the class of 40 arcseconds.
ENCODER_ERROR = 2e-4
SLOW = 0.1  # of the highest speed
SMOOTH = 0.02  # s of the difference that gives the acceleration
_BRAKE = 8  # place of the brake torque among the columns that explain the current


def features_of(
    signals: Log,
    *,
    ratio: float,
    pole_pairs: float,
    emf: float,
    deviations: bool = True,
    shaft: bool = True,
) -> FeatureVector:
    """Regress.

    Parameters
    ----------
    signals : Log
        A log or a model's run of its test. The channel ``command`` is that of a run; a log's is not
        known to the last bit, it has a `gain` instead.
    ratio : float
        Gear ratio.
    pole_pairs : float
        Electrical angle over shaft angle.
    emf : float
        Of the actuator [V s/rad]: what the voltage's ripple is a share of.
    deviations : bool
        Whether deviations are needed; without them `FeatureVector.std` is NaN, in a third of the
        time.
    shaft : bool
        Whether what turns with the shaft is sought.
    """
    width = median(np.diff(signals.time))
    moving = signals.good & (np.abs(signals.speed) > SLOW * np.abs(signals.speed).max())
    rows, flies = _positions(signals, moving, ratio, deviations)
    cosine, sine = np.cos(pole_pairs * signals.motor), np.sin(pole_pairs * signals.motor)
    waves = (cosine, sine, cosine**2 - sine**2, 2.0 * cosine * sine)
    sideband = (2.0 * pole_pairs + 1.0) * signals.motor if shaft else None
    rows |= _currents(signals, moving, (waves, sideband), width, deviations)
    if signals.has("torque_voltage"):
        rows |= _voltages(signals, moving, (waves, sideband), emf, deviations)
    rows |= _control(signals, width, deviations)
    names = tuple(name for name in FEATURES if name in rows)
    return FeatureVector(
        names,
        np.array([rows[name][0] for name in names]),
        np.array([rows[name][1] for name in names]),
        flies,
    )


def median(values: Floats) -> float:
    """Return NumPy's median, without the masked arrays that its first call loads for 10 ms."""
    half = len(values) // 2
    ends = np.partition(values, (max(half - 1, 0), half))
    return float(ends[half] if len(values) % 2 else 0.5 * (ends[half - 1] + ends[half]))


def regress(columns: Sequence[Floats], data: Floats) -> tuple[Floats, Floats]:
    """Least squares; covariance from the scores of stretches, since residuals are coloured.

    Parameters
    ----------
    columns : sequence of ndarray, shape (n,)
        What explains.
    data : ndarray, shape (n,)
        What is explained.

    Returns
    -------
    ndarray, shape (k,), ndarray, shape (k, k)
        Weights and their covariance.
    """
    return _regress(np.stack([*columns, data]), True)


def _regress(rows: Floats, deviations: bool, *, short: bool = False) -> tuple[Floats, Floats]:
    """Regress the last of the rows, shape (k + 1, n), on the others; they are scaled in place."""
    count = len(rows) - 1
    gram = rows @ rows.T
    scale = np.sqrt(np.diag(gram)[:count] / rows.shape[1])
    scale[scale == 0.0] = 1.0
    inverse = np.linalg.pinv(gram[:count, :count] / np.outer(scale, scale), 1e-10, hermitian=True)
    beta = inverse @ (gram[:count, count] / scale)
    if not deviations:
        return beta / scale, np.full((count, count), np.nan)
    columns = rows[:count]
    columns /= scale[:, None]
    score = columns * (rows[count] - beta @ columns)
    covariance = inverse @ _scatter(score, short=short) @ inverse
    return beta / scale, covariance / np.outer(scale, scale)


def _scatter(score: Floats, *, short: bool) -> Floats:
    """Covariance of the scores' sum, shape (k, k), by stretches; short ones by their steps."""
    parts = np.add.reduceat(score, _edges(score.shape[1], _SHORT if short else _BLOCKS), axis=1)
    if short:
        steps = np.diff(parts, axis=1)
        return np.asarray(0.5 * steps @ steps.T)
    return np.asarray(parts @ parts.T * _BLOCKS / (_BLOCKS - 1))


def _fit(
    columns: Sequence[Floats], target: Floats, use: Bools, deviations: bool, *, short: bool = False
) -> Fit:
    at = np.flatnonzero(use)
    rows = np.empty((len(columns) + 1, len(at)))
    for row, column in zip(rows, (*columns, target), strict=True):
        np.take(column, at, out=row, mode="clip")
    return _regress(rows, deviations, short=short)


def _edges(count: int, blocks: int) -> npt.NDArray[np.intp]:
    return np.linspace(0, count, min(blocks, count), endpoint=False).astype(np.intp)


def _one(fit: Fit, at: int, factor: float = 1.0) -> tuple[float, float]:
    beta, covariance = fit
    return factor * float(beta[at]), abs(factor) * _root(float(covariance[at, at]))


def _size(fit: Fit, at: int, over: float = 1.0) -> tuple[float, float]:
    """Amplitude of a cosine and a sine; its phase depends on where the angle has its zero."""
    beta, covariance = fit
    variance = 0.5 * float(covariance[at, at] + covariance[at + 1, at + 1])
    return float(np.hypot(beta[at], beta[at + 1])) / abs(over), _root(variance) / abs(over)


def _root(variance: float) -> float:
    """Deviation; rounding may leave a variance below zero, and NaN is kept."""
    return math.nan if math.isnan(variance) else math.sqrt(max(variance, 0.0))


def _positions(
    signals: Log, moving: Bools, ratio: float, deviations: bool
) -> tuple[dict[str, tuple[float, float]], bool]:
    """Lost motion and scale, and whether the output flies in its backlash on its own."""
    gap = signals.motor / ratio - signals.output
    use = moving & carried(signals.motor / ratio, float(np.ptp(gap[moving])))
    if use.sum() < LEAST:
        use = moving
    centred = signals.output - float(np.mean(signals.output[use]))
    columns = [np.sign(signals.speed), centred, np.ones_like(gap)]
    fit = _fit(columns, gap, use, deviations)
    lost, scale = _one(fit, 0, 2.0), _one(fit, 1)
    flies = floats((gap - scale[0] * centred)[use], columns[0][use])
    if flies:
        lost, scale = spanned(gap[use], signals.output[use])
    return {"lost_motion": lost, "position_scale": scale}, flies


#: Cosine and sine of the electrical angle and of twice it; the sideband's angle, if it is sought.
_Turns = tuple[Sequence[Floats], Floats | None]


def _currents(
    signals: Log, moving: Bools, turns: _Turns, width: float, deviations: bool
) -> dict[str, tuple[float, float]]:
    half = max(1, round(0.5 * SMOOTH / width))
    rate = local_slope(signals.speed, half) / width
    way = np.sign(signals.speed)
    level = local_mean(signals.current, 8 * half)
    columns = [way, signals.speed, rate, np.ones_like(way)]
    columns += [level * wave for wave in turns[0]]
    brake = signals.brake.at(signals.time)
    if signals.brake.measured and float(np.ptp(brake[moving])) > 0.0:
        columns.append(way * brake)
    fit = _fit(columns, signals.current, moving, deviations)
    names = ("dry_current", "viscous_current", "inertia_current")
    rows = {name: _one(fit, k) for k, name in enumerate(names)}
    if len(fit[0]) > _BRAKE:
        rows["brake_current"] = _one(fit, _BRAKE)
    rows["current_order_1"] = _size(fit, 4)
    rows["current_order_2"] = _size(fit, 6)
    if turns[1] is None:
        return rows
    # What turns with the shaft is sought in what is left: in a short motion its turn looks like
    # the acceleration, and the sideband like its neighbour.
    residual = signals.current - sum(b * column for b, column in zip(fit[0], columns, strict=True))
    shaft = [np.cos(signals.motor), np.sin(signals.motor)]
    sideband = [level * np.cos(turns[1]), level * np.sin(turns[1])]
    rows["current_shaft"] = _size(_fit(shaft, residual, moving, deviations), 0)
    rows["current_sideband"] = _size(_fit(sideband, residual, moving, deviations), 0)
    return rows


def local_slope(values: Floats, half: int) -> Floats:
    """Mean slope over `half` samples either way, per sample."""
    padded = np.pad(values, half, mode="edge")
    return np.asarray((padded[2 * half :] - padded[: -2 * half]) / (2.0 * half), dtype=np.float64)


def local_mean(values: Floats, half: int) -> Floats:
    """Mean over `half` samples either way."""
    total = np.concatenate(([0.0], np.cumsum(np.pad(values, half, mode="edge"))))
    width = 2 * half + 1
    return np.asarray((total[width:] - total[:-width]) / width, dtype=np.float64)


def _voltages(
    signals: Log, moving: Bools, turns: _Turns, emf: float, deviations: bool
) -> dict[str, tuple[float, float]]:
    voltage = signals["torque_voltage"]
    use = moving & np.isfinite(voltage)
    if use.sum() < 2 * LEAST:
        return {}
    columns = [signals.speed, signals.current, np.ones_like(signals.speed)]
    columns += [signals.speed * wave for wave in turns[0]]
    fit = _fit(columns, voltage, use, deviations)
    residual = voltage - sum(b * c for b, c in zip(fit[0], columns, strict=True))
    if deviations:
        fit[1][np.diag_indices(2)] += _in_step(columns, residual, use)[:2] ** 2
    rows = {
        "voltage_per_speed": _one(fit, 0),
        "voltage_per_current": _one(fit, 1),
        "voltage_order_1": _size(fit, 3, emf),
        "voltage_order_2": _size(fit, 5, emf),
    }
    if turns[1] is not None:
        sideband = [signals.speed * np.cos(turns[1]), signals.speed * np.sin(turns[1])]
        rows["voltage_sideband"] = _size(_fit(sideband, residual, use, deviations), 0, emf)
    return rows


def _in_step(columns: Sequence[Floats], residual: Floats, use: Bools) -> Floats:
    """Deviation of each weight, shape (k,), where a share of the residual is in step with it."""
    rows = np.stack(columns)[:, use]
    gram = rows @ rows.T / rows.shape[1]
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    inverse = np.linalg.pinv(gram / np.outer(scale, scale), 1e-10, hermitian=True)
    size = _IN_STEP * float(np.std(residual[use]))
    return np.asarray(size * np.sqrt(np.maximum(np.diag(inverse), 0.0)) / scale)


def _control(signals: Log, width: float, deviations: bool) -> dict[str, tuple[float, float]]:
    error = signals.speed_ref - signals.speed
    size = np.abs(signals.speed_ref)
    inside = signals.good & (size < 0.999 * float(size.max()))
    integral = np.cumsum(error) * width
    columns = [error, integral, np.gradient(error, width), np.ones_like(error)]
    law = _fit(columns, signals.current_target, inside, deviations, short=True)
    rows = {"speed_gain": _one(law, 0)}
    if signals.gain is not None:
        gain, std = signals.gain
        rows["following_gain"] = (1.0 / gain, std / gain**2)
    elif signals.has("command"):
        columns = [signals.speed_ref, signals["command"], np.ones_like(error)]
        rows["following_gain"] = _one(_fit(columns, signals.output, inside, deviations), 0, -1.0)
    return rows
