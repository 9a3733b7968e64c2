"""Integral gain of the speed control where neither its set point nor its demand was logged.

While the motor drives, the demand follows from current and speed through the link
(``V = 2 k w + (2 (R + R_on) + c p |w| L) i + 2 L di/dt + (1 - d) V_f``), and the set point from
what commands it: a ramp to the higher speed, and one to the lower from the switch near the end.
When each begins is fitted along.

Only the product of gain and zero shows throughout: it is the gain for the zero as given. The gain
itself is a quarter of a volt while a ramp lasts, against eighteen of the whole demand; a begin 1 ms
earlier does as much, and so does a part in a hundred of the voltage's balance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Bools, Floats
from elevon.calibrate.stages.block_drive import Motor
from elevon.calibrate.stages.moves import Move, moves_of
from elevon.estimate import Determined, Estimate
from elevon.estimate.regression import with_deviations
from elevon.estimate.residual import fit_residual
from elevon.estimate.signals import local_polynomial
from elevon.logs.log import Log

#: Roles that this way needs.
NEEDS = ("torque_current", "motor_speed", "output_position")
#: What the set point and the demand stand on.
GIVEN = (
    "control.zero_retraction",
    "control.speed_high",
    "control.speed_low",
    "control.acceleration_limit",
)
PATHS = ("control.gain_retraction", "control.zero_retraction")
_IDLE = ("control.gain_extension", "control.zero_extension")
_WHY_IDLE = (
    "the leg drives in extension: no current answers the demand, which must be logged itself"
)
_SLOWEST = 100.0  # rad/s, below which the current lags behind the demand
_END = 0.1  # s before the end of a move
_LIMIT = 0.97  # of the link, from which the demand may be limited
_WIDTH = 0.02  # s of the polynomial that gives the current's slope
_FEWEST = 300  # samples
_LATE = 0.3  # s by which a begin may be off
_ZERO = 1.3  # ratio of zeros between which the product is the same but for its deviation
_VOLTS = 0.05  # V, from which a residual weighs less
_ROUNDS = 6  # of the share of the time in which the bridge is on


@dataclass(frozen=True)
class _Ramp:
    """A move's samples, what the unit must have demanded, and where its set point changes."""

    log: Log
    used: Bools
    demand: Floats
    begin: float
    slows: float
    open: float

    def set_point(self, actuator: Actuator, begin: float, slows: float) -> Floats:
        """Speed set point as a size [rad/s], for shifts of its begin and of its slowing [s]."""
        value = actuator.parameters.value
        slope, time = value("control.acceleration_limit"), self.log.time
        high, low = value("control.speed_high"), value("control.speed_low")
        rises = np.minimum(high, slope * np.maximum(time - self.begin - begin, 0.0))
        falls = high - slope * np.maximum(time - self.slows - slows, 0.0)
        return np.asarray(np.minimum(rises, np.maximum(falls, low)))


def gains_by_current(logs: Sequence[Log], actuator: Actuator, motor: Motor) -> Determined:
    """Return gain and zero of the speed control in retraction, and why they are not determined.

    Parameters
    ----------
    logs : sequence of Log
        Those that show set point and demand are passed over: they say more.
    actuator : Actuator
        With ramp, levels and motor constants as far as they are determined.
    motor : Motor
        What the third phase draws.
    """
    ramps = [
        ramp
        for log in logs
        if log.has(*NEEDS)
        for move in moves_of(log)
        if not move.extending and (ramp := _ramp(log, move, actuator, motor)) is not None
    ]
    reasons = dict.fromkeys(PATHS, "no retraction in which the motor drives below the limit")
    levels: dict[str, Estimate] = {}
    if ramps:
        levels, reasons = _fitted(ramps, actuator)
    if any(move.extending for log in logs for move in moves_of(log)):
        reasons = {**reasons, **dict.fromkeys(_IDLE, _WHY_IDLE)}
    return levels, reasons


def _ramp(log: Log, move: Move, actuator: Actuator, motor: Motor) -> _Ramp | None:
    value = actuator.parameters.value
    demand, link = _demand(log, actuator, motor)
    inside = (log.time > move.begin) & (log.time < move.end - _END)
    used = inside & (demand < _LIMIT * link)
    used &= np.abs(log["motor_speed"]) > _SLOWEST
    # One stretch: from a limit on the integral is another's.
    over = np.flatnonzero(inside & (demand >= _LIMIT * link))
    if len(over):
        used &= log.time < log.time[over[0]] - _END
    near = np.flatnonzero(inside & (log["output_position"] < value("proximity.position_25")))
    if used.sum() < _FEWEST or not len(near):
        return None
    open_ = log.period + value("control.period") if log.has("state") else _LATE
    return _Ramp(log, used, demand, move.begin, float(log.time[near[0]]), open_)


def _demand(log: Log, actuator: Actuator, motor: Motor) -> tuple[Floats, Floats]:
    """Demanded voltage from current and speed, and the link's, as sizes."""
    stand = dict(log.stand.parameters)
    value = actuator.with_values(stand, source="stand of the log").parameters.value
    speed, current = np.abs(log["motor_speed"]), np.abs(log["torque_current"])
    inductance, drop = value("motor.winding_inductance"), value("inverter.diode_drop")
    resistance = 2.0 * (value("motor.winding_resistance") + value("inverter.on_resistance"))
    commutation = value("low.commutation_factor") * value("motor.pole_pairs") * inductance
    link = (
        log["supply_voltage"]
        if log.has("supply_voltage")
        else np.full(len(speed), value("inverter.supply_voltage"))
    )
    slope = local_polynomial(current, log.period, _WIDTH, slope=True)
    emf = 2.0 * value("motor.emf_constant") * speed
    demand = emf
    for _ in range(_ROUNDS):
        duty = np.clip(demand / link, 0.0, 1.0)
        third_mean = 0.0 if motor.third is None else motor.third.means(speed, duty, link)[0]
        pair = current - third_mean
        demand = emf + (resistance + commutation * speed) * pair + (1.0 - duty) * drop
    return np.asarray(demand + 2.0 * inductance * slope), np.asarray(link)


def _fitted(ramps: Sequence[_Ramp], actuator: Actuator) -> Determined:
    zero = actuator.parameters.value(PATHS[1])
    why = {PATHS[1]: "without set point or demand only its product with the gain shows"}
    level, other = (_integral(ramps, actuator, zero * scale) for scale in (1.0, _ZERO))
    if level is None or other is None:
        return {}, {**why, PATHS[0]: "no integral gain explains the demand that the current says"}
    open_ = level.widened(other.value - level.value)
    return {PATHS[0]: Estimate(open_.value / zero, open_.std / zero, open_.degrees)}, why


def _integral(ramps: Sequence[_Ramp], actuator: Actuator, zero: float) -> Estimate | None:
    """Product of gain and zero, for a zero."""
    tick = actuator.parameters.value("control.period")
    first = actuator.parameters.value(PATHS[0]) * zero
    scale = np.concatenate([[first], np.full(2 * len(ramps), 0.1)])

    def residual(x: Floats) -> Floats:
        integral, *shifts = x * scale
        parts = []
        for ramp, begin, slows in zip(ramps, shifts[::2], shifts[1::2], strict=True):
            error = ramp.set_point(actuator, begin, slows) - np.abs(ramp.log["motor_speed"])
            h = ramp.log.period
            total = np.cumsum(error) * h - 0.5 * (h - tick) * error
            parts.append((integral * (error / zero + total) - ramp.demand)[ramp.used])
        return np.concatenate(parts)

    reach = np.concatenate([[20.0], *([10.0 * ramp.open, 10.0 * _LATE] for ramp in ramps)])
    start = np.concatenate([[1.0], np.zeros(2 * len(ramps))])
    lowest = np.concatenate([[1e-3], -reach[1:]])
    fit = fit_residual(residual, start, ends=(lowest, reach), loss="soft_l1", soft=_VOLTS)
    x, jacobian = fit.x, fit.jacobian
    # What lies at its bound is known, what no sample feels changes nothing.
    inside = (x > lowest + 1e-6) & (x < reach - 1e-6) & np.any(jacobian, axis=0)
    if not inside[0]:
        return None
    slope, ends = jacobian[:, inside], fit.residual
    strokes = [(r.log.time[r.used], np.ones(int(r.used.sum())), r.log.period) for r in ramps]
    names = tuple(f"x{k}" for k in range(int(inside.sum())))
    fitted = with_deviations(names, x[inside], slope, ends, np.ones(len(ends)), strokes=strokes)
    spread = fitted.std(names[0])
    return Estimate(x[0] * first, spread * first, fitted.degrees) if np.isfinite(spread) else None
