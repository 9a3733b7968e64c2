"""Unit, shaft and sign of the two positions of a drive trace, settled by consistency."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.estimate.signals import integral
from elevon.logs.maps.consistency import (
    Fit,
    UnitCandidate,
    centred_line,
    encoder_candidates,
    match,
    motor_candidates,
    slope_with_backlash,
)
from elevon.logs.report import ImportReport

_LEAST_TRAVEL = 0.5  # rad of the motor: less than that says nothing about a unit


@dataclass(frozen=True, slots=True)
class PositionStatement:
    """What is stated about a position column: file units per rad of the signal's own shaft, signed.

    None where nothing is given. The own shaft is the motor's for the motor's position, the output's
    for the encoder's, whatever shaft the file refers it to.
    """

    column: str
    per_rad: float | None = None


def travel_from_speed(time: Floats, speed: Floats) -> Floats:
    """Integrate a speed [rad/s] by the trapezoidal rule; missing samples are bridged."""
    good = np.isfinite(speed)
    filled = np.interp(time, time[good], speed[good]) if good.any() else np.zeros_like(time)
    return integral(time, filled)


def settle_motor(
    statement: PositionStatement,
    time: Floats,
    position: Floats,
    speeds: Sequence[Floats],
    report: ImportReport,
    *,
    name: str = "resolver_position",
) -> tuple[float, bool]:
    """Return the factor from the file's motor position to rad, and whether the log confirms it.

    Parameters
    ----------
    statement : PositionStatement
        What the caller stated, if anything.
    time : ndarray, shape (n,)
        Seconds.
    position : ndarray, shape (n,)
        As in the file.
    speeds : sequence of ndarray, shape (n,)
        Actual speed and speed set point [rad/s], those that exist.
    report : ImportReport
        Findings are added to it.

    Raises
    ------
    InputError
        The motion contradicts every unit, or the one stated, or the sign.
    """
    fits = [_against(travel_from_speed(time, speed), position) for speed in speeds]
    usable = [fit for fit in fits if fit.usable and fit.travel > _LEAST_TRAVEL]
    if not usable:
        return _unconfirmed(statement, name, _why(fits), report), False
    slope = usable[0].slope
    if statement.per_rad is not None:
        _check_stated(statement, slope, "the integral of the motor's speed")
        return 1.0 / statement.per_rad, True
    if slope < 0.0:
        other = len(usable) > 1 and usable[1].slope > 0.0
        what = "r63 (speed)" if other else f"{statement.column} (motor position)"
        raise InputError(
            f"{report.source}: {what} has the wrong sign: the motor's position falls while its "
            "speed is positive; give sign = -1 in a column map"
        )
    candidate = match(slope, motor_candidates())
    if candidate is None:
        raise InputError(
            f"{report.source}: {statement.column} moves {slope:.5g} per rad of the integrated "
            f"motor speed, which is no known unit ({_listed(motor_candidates())}); give unit and "
            "scale in a column map"
        )
    moved = slope / candidate.scale
    report.say(name, "unit-confirmed", statement.column, candidate.unit, moved)
    return 1.0 / candidate.scale, True


def settle_encoder(
    statement: PositionStatement,
    reference: Floats,
    position: Floats,
    ratio: float,
    report: ImportReport,
    *,
    trusted: bool = True,
    name: str = "encoder_position",
) -> tuple[float, bool]:
    """Return the factor from the file's encoder position to rad at the output, and if confirmed.

    Parameters
    ----------
    statement : PositionStatement
        What the caller stated, if anything.
    reference : ndarray, shape (n,)
        The motor's position [rad].
    position : ndarray, shape (n,)
        As in the file.
    ratio : float
        Gear ratio, fast over slow.
    report : ImportReport
        Findings are added to it.
    trusted : bool
        Whether the reference itself is confirmed.

    Raises
    ------
    InputError
        Wrong sign, wrong shaft, or a scale that fits no unit.
    """
    good = np.isfinite(reference) & np.isfinite(position)
    fit = slope_with_backlash(reference[good], position[good])
    if not (trusted and fit.usable and fit.travel > _LEAST_TRAVEL):
        why = "the motor's own unit is not confirmed" if not trusted else _why([fit])
        return _unconfirmed(statement, name, why, report, ratio), False
    backlash = math.degrees(fit.backlash / ratio)
    if statement.per_rad is not None:
        against = "the motor's position over the gear ratio"
        _check_stated(statement, fit.slope * ratio, against, ratio)
        return 1.0 / statement.per_rad, True
    if fit.slope < 0.0:
        raise InputError(
            f"{report.source}: {statement.column} (encoder) has the wrong sign: it falls while "
            "the motor's position rises; give sign = -1 in a column map"
        )
    candidate = match(fit.slope, encoder_candidates(ratio))
    _refuse_shaft(statement, fit, candidate, ratio, report)
    assert candidate is not None
    seen = ratio * candidate.scale / fit.slope
    follows = f"gear ratio seen {seen:.3f}, expected {ratio:g}"
    if candidate.shaft == "fast":  # the drive has multiplied by its own ratio: it cannot be seen
        follows = f"it moves {fit.slope / candidate.scale:.4f} of the motor"
    report.say(name, "shaft-confirmed", statement.column, candidate, follows, backlash)
    return 1.0 / (candidate.scale * ratio), True


def _against(reference: Floats, position: Floats) -> Fit:
    """Fit without backlash; a slow drift of the integrated speed is removed where it is seen."""
    good = np.isfinite(reference) & np.isfinite(position)
    x, y = reference[good], position[good]
    travel = float(np.ptp(x)) if x.size else 0.0
    if travel == 0.0 or np.ptp(y) == 0.0:
        return Fit(0.0, 0.0, math.inf, travel)
    line = np.linspace(-1.0, 1.0, len(x))
    dx, dy = x - x.mean(), y - y.mean()
    if abs(float(np.corrcoef(dx, line)[0, 1])) < 0.9:
        power = float(line @ line)
        dx, dy = dx - line * (dx @ line) / power, dy - line * (dy @ line) / power
    slope, error = centred_line(dx, dy)
    return Fit(slope, 0.0, error, travel)


def _refuse_shaft(
    statement: PositionStatement,
    fit: Fit,
    candidate: UnitCandidate | None,
    ratio: float,
    report: ImportReport,
) -> None:
    if candidate is None:
        raise InputError(
            f"{report.source}: {statement.column} (encoder) moves {fit.slope:.5g} per rad of the "
            f"motor, which fits no unit on any shaft for a gear ratio of {ratio:g} "
            f"({_listed(encoder_candidates(ratio))}); check the gear ratio, or give unit, scale "
            "and shaft in a column map"
        )
    if candidate.shaft == "wheel":
        raise InputError(
            f"{report.source}: {statement.column} (encoder) is on the wrong shaft: it turns "
            f"{fit.slope / candidate.scale:.3f} x 4 times the output shaft, as the encoder's own "
            f"22-tooth wheel does; give shaft = 'slow', scale = 0.25, "
            f"unit = '{candidate.unit}' in a column map"
        )


def _check_stated(
    statement: PositionStatement, slope: float, against: str, ratio: float = 1.0
) -> None:
    stated = statement.per_rad or 1.0
    if slope * stated < 0.0:
        raise InputError(
            f"{statement.column}: the sign stated contradicts the log: against {against} it runs "
            "in the other direction"
        )
    off = slope / stated
    if abs(math.log(off)) > 0.15:
        hint = ""
        if ratio > 1.0 and min(abs(math.log(off / f)) for f in (ratio, 1.0 / ratio)) < 0.15:
            hint = ": the other shaft"
        raise InputError(
            f"{statement.column}: unit, scale or shaft stated contradict the log: against "
            f"{against} it moves {off:.4g} times what they say{hint}"
        )


def _unconfirmed(
    statement: PositionStatement, name: str, why: str, report: ImportReport, ratio: float = 1.0
) -> float:
    if statement.per_rad is not None:
        report.say(name, "unit-unconfirmed", statement.column, why)
        return 1.0 / statement.per_rad
    shaft = ", on the motor shaft" if ratio > 1.0 else ""
    report.say(name, "unit-assumed", statement.column, shaft, why)
    return math.pi / 180.0 / ratio


def _why(fits: Sequence[Fit]) -> str:
    if not fits:
        return "not confirmed: the log holds no speed"
    travel = max(fit.travel for fit in fits)
    if travel <= _LEAST_TRAVEL:
        return f"not confirmed: the motor moves only {travel:.3g} rad"
    return "not confirmed: the two do not move together"


def _listed(candidates: Sequence[UnitCandidate]) -> str:
    return ", ".join(f"{c.unit} {c.shaft} {c.scale:.4g}" for c in candidates)
