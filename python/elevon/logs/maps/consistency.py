"""Units, shaft and sign of the two positions, confirmed or refused by physics.

The drive's trace does not state in what unit the positions are written, nor on which shaft the
encoder's is (the two theses disagree). Three facts settle it where the motor moves: the motor's
position is the integral of its speed, the output's is the motor's over the gear ratio but for the
backlash, and the possible units lie far apart.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.estimate.signals import through_backlash

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
