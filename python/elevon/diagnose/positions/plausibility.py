"""What a log shows beside its features and no candidate moves: lags, noise, ripple, rests.

One table serves every actuator; a log gives what its roles allow. Positions are compared as angles
at the motor's shaft, whatever the output's unit.

Nothing here is held against the model, which has neither noise nor a sampled controller: only a
baseline of the same test says what the unit shows. So no model run pays for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.table import Feature, FeatureTable, FeatureVector, deviations
from elevon.diagnose.positions.features import (
    LEAST,
    SLOW,
    SMOOTH,
    Bools,
    carried,
    local_mean,
    local_slope,
    median,
    regress,
)

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

_NEEDED = ("gear.ratio", "screw.lead", "motor.pole_pairs")
_CREEPING = 0.2  # of the highest speed: over which friction that falls with speed has fallen
_BOTH = 0.1  # share of the samples in each direction: a motion both ways
_APART = 0.1  # of the square of ones that the other columns do not make up
_BINS = 96  # of a motor turn: two a period of 48 cogs
_USUAL = 90.0  # percent of the samples that noise is read from: steps and reversals are no noise

#: Least deviations from day to day: share of the value, and SI. ASSUMED, a few times what logs of
#: another program scatter by, so that grease, temperature or another start is no finding.
PLAUSIBLE: FeatureTable = {
    row.name: row
    for row in (
        Feature("position_lag", "s", "delay of the output's position behind the motor's",
                (0.0, 2e-4)),
        Feature("position_shaft", "rad", "error of the two positions that turns with the motor",
                (0.3, 4e-3)),
        Feature("position_bend", "rad", "difference of the two positions by the stroke's square",
                (0.0, 25e-3)),
        Feature("position_cubic", "rad", "difference of the two positions by the stroke's cube",
                (0.0, 50e-3)),
        Feature("position_rest", "rad", "scatter of the two positions' difference",
                (0.2, 2.5e-3)),
        Feature("speed_offset", "rad/s", "logged speed beside the motor position's slope",
                (0.0, 0.05)),
        Feature("speed_lag", "s", "delay of the logged speed behind the motor's position",
                (0.0, 2e-4)),
        Feature("speed_rest", "rad/s", "scatter of speed and the motor position's slope",
                (0.10, 0.005)),
        Feature("current_mean", "A", "current that neither direction nor speed explains",
                (0.0, 0.04)),
        Feature("creeping_current", "A", "dry current that falls with speed",
                (0.1, 0.025)),
        Feature("current_by_angle", "A", "ripple of the current over a motor turn",
                (0.3, 0.005)),
        Feature("current_lag", "s", "delay of the current behind its set point",
                (0.2, 1e-3)),
        Feature("current_noise", "A", "noise of the current", (0.12, 0.005)),
        Feature("target_noise", "A", "noise of the current set point", (0.12, 0.005)),
        Feature("control_noise", "A", "noise of what the speed controller's law leaves",
                (0.15, 0.005)),
        Feature("integral_rate", "1/s", "speed controller's integral over its gain",
                (0.15, 0.03)),
        Feature("reference_noise", "rad/s", "noise of the speed set point", (0.15, 2e-3)),
        Feature("voltage_rest", "V", "scatter of the voltage", (0.10, 0.1)),
        Feature("voltage_noise", "V", "noise of the voltage", (0.10, 0.1)),
    )
}  # fmt: skip


def plausibility_of(log: Log, actuator: Actuator) -> FeatureVector:
    """Return what `PLAUSIBLE` lists, as far as a log's roles allow; its good samples count."""
    known = {p: actuator.parameters.value(p) for p in _NEEDED if p in actuator.parameters}
    ratio = known.get("gear.ratio", 1.0) / known.get("screw.lead", 1.0)
    pole_pairs = known["motor.pole_pairs"]
    rows: dict[str, float] = {}
    if log.has("motor_speed") and np.ptp(log.speed) > 0.0:
        width = median(np.diff(log.time))
        moving = log.good & (np.abs(log.speed) > SLOW * np.abs(log.speed).max())
        half = max(1, round(0.5 * SMOOTH / width))
        rate = local_slope(log.speed, half) / width
        columns: list[Floats] = []
        if log.has("motor_position"):
            rows |= _speeds(log, rate, width)
        if log.has("motor_position", "output_position"):
            rows |= _positions(log, moving, ratio)
        if log.has("torque_current") or log.has("current_ref"):
            columns = _explaining(log, rate, half, pole_pairs)
            rows |= _currents(log, moving, columns, width)
        if columns and log.has("speed_ref"):
            rows |= _control(log, width)
        rows |= _voltages(log, moving, columns)
    names = tuple(name for name in PLAUSIBLE if name in rows and np.isfinite(rows[name]))
    values = np.array([rows[name] for name in names])
    return FeatureVector(names, values, np.zeros(len(names)))


def _left(columns: Sequence[Floats], rows: Sequence[Floats], use: Bools) -> tuple[Floats, Floats]:
    """Regress rows on columns: weights, shape (k, m), and what is left, shape (m, n)."""
    design = np.stack([column[use] for column in columns], axis=1)
    data = np.stack([row[use] for row in rows], axis=1)
    weights = np.linalg.pinv(design.T @ design, 1e-12, hermitian=True) @ (design.T @ data)
    return weights, (data - design @ weights).T


def _along(way: Floats, left: Floats) -> float:
    """Weight of one more column, both less what the others explain of them."""
    square = float(way @ way)
    return float(way @ left) / square if square > 0.0 else 0.0


def _noise(values: Floats, use: Bools) -> float:
    """Mean second difference of all but the largest."""
    inside = use[:-2] & use[1:-1] & use[2:]
    sizes = np.sort(np.abs(np.diff(values, 2)[inside]))
    return float(sizes[: max(int(len(sizes) * _USUAL / 100.0), 1)].mean())


def _positions(log: Log, moving: Bools, ratio: float) -> dict[str, float]:
    gap = log.motor - ratio * log.output
    use = moving & carried(log.motor, float(np.ptp(gap[moving])))
    use = use if use.sum() >= LEAST else moving
    turn = (np.cos(log.motor), np.sin(log.motor))
    place = log.output - float(np.mean(log.output[use]))
    stroke = float(np.ptp(place[use])) or 1.0
    columns = [np.sign(log.speed), place, np.ones_like(gap), *_pushing(log)]
    rows = [gap, log.speed, (place / stroke) ** 2, (place / stroke) ** 3, *turn]
    _, (left, speed, square, cube, *waves) = _left(columns, rows, use)
    sizes = np.linalg.lstsq(np.stack(waves, axis=1), left, rcond=None)[0]
    return {
        "position_lag": _along(speed, left),
        "position_shaft": float(np.hypot(*sizes)),
        "position_bend": _along(square, left),
        "position_cubic": float(np.linalg.lstsq(np.stack([square, cube], axis=1), left)[0][1]),
        "position_rest": float(left.std()),
    }


def _speeds(log: Log, rate: Floats, width: float) -> dict[str, float]:
    columns = [np.gradient(log.motor, width), np.ones_like(rate), rate]
    weights, (left,) = _left(columns, [log.speed], log.good)
    return {
        "speed_offset": float(weights[1, 0]),
        "speed_lag": -float(weights[2, 0]),
        "speed_rest": float(left.std()),
    }


def _pushing(log: Log) -> list[Floats]:
    """A load on the output, and its size by the direction: what it bends and what it rubs."""
    load = log.get("load")
    return [] if load is None else [load, np.sign(log.speed) * np.abs(load)]


def _explaining(log: Log, rate: Floats, half: int, pole_pairs: float) -> list[Floats]:
    """What explains the current: direction, speed, acceleration, electrical angle, loads."""
    way = np.sign(log.speed)
    columns = [np.ones_like(way), way, log.speed, rate]
    if log.has("motor_position"):
        level, angle = local_mean(log.current, 8 * half), pole_pairs * log.motor
        waves = (np.cos(angle), np.sin(angle), np.cos(2.0 * angle), np.sin(2.0 * angle))
        columns += [level * wave for wave in waves]
    if log.brake.measured:
        columns.append(way * log.brake.at(log.time))
    return columns + _pushing(log)


def _currents(log: Log, moving: Bools, columns: Sequence[Floats], width: float) -> dict[str, float]:
    falling = np.exp(-np.abs(log.speed) / (_CREEPING * float(np.abs(log.speed).max())))
    rows = [log.current, np.sign(log.speed) * falling]
    _, (left, creeping) = _left(columns, rows, moving)
    out = {"current_noise": _noise(log.current, log.good)}
    if _both_ways(log, moving):  # else nothing distinguishes them from dry friction
        out["creeping_current"] = _along(creeping, left)
        one, *others = columns
        _, (alone, current) = _left(others, [one, log.current], moving)
        if float(alone @ alone) > _APART * len(alone):  # a load one way is a mean, too
            out["current_mean"] = _along(alone, current)
    if log.has("motor_position"):
        place = np.floor(log.motor[moving] / (2.0 * np.pi) % 1.0 * _BINS).astype(np.intp)
        count = np.bincount(place, minlength=_BINS)
        mean = np.bincount(place, left, minlength=_BINS) / np.maximum(count, 1)
        out["current_by_angle"] = float(np.sqrt(np.sum(count * mean**2) / count.sum()))
    if log.has("torque_current", "current_ref"):
        target = log.current_target
        slope = np.gradient(target, width)
        weights, _ = _left([target, slope, np.ones_like(target)], [log.current], log.good)
        out["current_lag"] = -float(weights[1, 0])
    return out


def _control(log: Log, width: float) -> dict[str, float]:
    error = log.speed_ref - log.speed
    size = np.abs(log.speed_ref)
    inside = log.good & (size < 0.999 * float(size.max()))
    columns = [error, np.cumsum(error) * width, np.gradient(error, width), np.ones_like(error)]
    beta, covariance = regress([column[inside] for column in columns], log.current_target[inside])
    left = log.current_target[inside] - sum(
        b * column[inside] for b, column in zip(beta, columns, strict=True)
    )
    return _integral_rate(beta, covariance) | {
        "target_noise": _noise(log.current_target, log.good),
        "control_noise": _noise(left, np.ones(len(left), dtype=np.bool_)),
        "reference_noise": _noise(log.speed_ref, log.good),
    }


def _integral_rate(beta: Floats, covariance: Floats) -> dict[str, float]:
    """Return the integral's weight over the error's, where the log says it better than days do."""
    if not beta[0]:
        return {}
    record, rate = PLAUSIBLE["integral_rate"], float(beta[1] / beta[0])
    slope = np.array([-rate, 1.0]) / beta[0]
    variance = float(slope @ covariance[:2, :2] @ slope)
    known = variance <= float(deviations([record], np.array([rate]), "repeats")[0]) ** 2
    return {"integral_rate": rate} if known else {}


def _voltages(log: Log, moving: Bools, columns: Sequence[Floats]) -> dict[str, float]:
    voltage = log.get("torque_voltage")
    if voltage is None:
        return {}
    use = moving & np.isfinite(voltage)
    if use.sum() < LEAST:
        return {}
    known = [*columns, log.current] if columns else [np.ones_like(voltage), log.speed]
    _, (left,) = _left(known, [voltage], use)
    out = {"voltage_noise": _noise(voltage, use)}
    # Of a motion one way it is the start and the end, which no two days have alike.
    return out | ({"voltage_rest": float(left.std())} if _both_ways(log, moving) else {})


def _both_ways(log: Log, moving: Bools) -> bool:
    ahead = float(np.mean(log.speed[moving] > 0.0))
    return min(ahead, 1.0 - ahead) > _BOTH
