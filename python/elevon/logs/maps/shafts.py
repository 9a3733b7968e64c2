"""Unit, shaft and sign of the two positions of a drive trace, settled by consistency."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.estimate.signals import integral, through_backlash
from elevon.logs.report import ImportReport

MOTOR_COUNTS = 2.0**24  # absolute encoder of the motor, counts a turn (test-bench thesis)
ENCODER_COUNTS = 20_000.0  # 5000 pulses, four edges each, a turn of the encoder's own wheel
ENCODER_WHEEL = 88.0 / 22.0  # turns of the encoder's wheel per turn of the output
_TOLERANCE = 0.15
_ENOUGH = 8.0  # travel over noise below which nothing is stated


@dataclass(frozen=True, slots=True)
class UnitCandidate:
    """A way a position may be written: `scale` file units per rad of what it is compared to."""

    unit: str
    shaft: str
    scale: float


@dataclass(frozen=True, slots=True)
class Fit:
    """Slope of a measured position against its reference, and how well it is known.

    Attributes
    ----------
    slope : float
        File units per rad of the reference.
    backlash : float
        Width of the dead zone, in rad of the reference; 0 when not fitted.
    error : float
        RMS of the residual over RMS of the fitted motion.
    travel : float
        Peak-to-peak travel of the reference [rad].
    """

    slope: float
    backlash: float
    error: float
    travel: float

    @property
    def usable(self) -> bool:
        """Whether the motion stands clear of everything the line does not explain."""
        return self.travel > 0.0 and self.error * _ENOUGH < 1.0


def motor_candidates() -> tuple[UnitCandidate, ...]:
    """Ways the motor's position may be written, per rad of the motor."""
    return (
        UnitCandidate("rad", "fast", 1.0),
        UnitCandidate("deg", "fast", 180.0 / math.pi),
        UnitCandidate("rev", "fast", 0.5 / math.pi),
        UnitCandidate("counts", "fast", MOTOR_COUNTS / (2.0 * math.pi)),
    )


def encoder_candidates(ratio: float) -> tuple[UnitCandidate, ...]:
    """Ways the output encoder's position may be written, per rad of the motor."""
    shafts = (("fast", 1.0), ("slow", 1.0 / ratio), ("wheel", ENCODER_WHEEL / ratio))
    units = (("rad", 1.0), ("deg", 180.0 / math.pi), ("rev", 0.5 / math.pi))
    angles = [UnitCandidate(unit, shaft, u * s) for shaft, s in shafts for unit, u in units]
    counts = ENCODER_COUNTS * ENCODER_WHEEL / (2.0 * math.pi * ratio)
    return (*angles, UnitCandidate("counts", "slow", counts))


def match(slope: float, candidates: tuple[UnitCandidate, ...]) -> UnitCandidate | None:
    """Return the one candidate whose scale agrees with a slope (its sign aside), if any."""
    good = [c for c in candidates if abs(math.log(abs(slope) / c.scale)) < _TOLERANCE]
    return min(good, key=lambda c: abs(math.log(abs(slope) / c.scale))) if good else None


def slope_with_backlash(reference: Floats, position: Floats) -> Fit:
    """Fit a position as slope x (reference passed through a dead zone) + offset.

    Parameters
    ----------
    reference : ndarray, shape (n,)
        The driving shaft's position [rad].
    position : ndarray, shape (n,)
        The driven position in file units.

    Returns
    -------
    Fit
        The best of a scan over the width of the backlash, refined by golden section.
    """
    travel = float(np.ptp(reference)) if reference.size else 0.0
    if travel == 0.0 or np.ptp(position) == 0.0:
        return Fit(0.0, 0.0, math.inf, travel)
    step = max(1, len(reference) // 4000)
    x, y = reference[::step], position[::step]
    widths = travel * np.linspace(0.0, 0.6, 13)
    errors = [centred_line(through_backlash(x, width), y)[1] for width in widths]
    best = int(np.argmin(errors))
    low, high = widths[max(best - 1, 0)], widths[min(best + 1, len(widths) - 1)]
    width = _golden(x, y, float(low), float(high))
    if errors[0] <= centred_line(through_backlash(x, width), y)[1]:
        width = 0.0
    slope, error = centred_line(through_backlash(x, width), y)
    return Fit(slope, width, error, travel)


def _golden(x: Floats, y: Floats, low: float, high: float) -> float:
    ratio = (math.sqrt(5.0) - 1.0) / 2.0
    for _ in range(12):
        a, b = high - ratio * (high - low), low + ratio * (high - low)
        if centred_line(through_backlash(x, a), y)[1] <= centred_line(through_backlash(x, b), y)[1]:
            high = b
        else:
            low = a
    return 0.5 * (low + high)


def centred_line(x: Floats, y: Floats) -> tuple[float, float]:
    """Slope of y over x, and the RMS of the residual over that of the fitted motion."""
    dx, dy = x - x.mean(), y - y.mean()
    power = float(dx @ dx)
    if power == 0.0:
        return 0.0, math.inf
    slope = float(dx @ dy) / power
    residual = float(np.sqrt(np.mean((dy - slope * dx) ** 2)))
    moved = abs(slope) * math.sqrt(power / len(dx))
    return slope, residual / moved if moved > 0.0 else math.inf


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
