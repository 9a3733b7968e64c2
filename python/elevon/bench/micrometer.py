"""The play-setting micrometer: reading d -> centre distance -> play, as computed and as measured.

The encoder's wheel meshes with the output ring; a slide at 45 deg moves it away. Numbers:
test-bench thesis (2022), "Backlash evaluation", and its table of fifteen positions.
"""

from __future__ import annotations

import math

import numpy as np

from elevon.errors import RangeError

__all__ = [
    "INTRINSIC_PLAY",
    "MEASURED",
    "centre_distance",
    "geometric_play",
    "measured_play",
    "micrometer_for",
    "total_play",
]

ZERO_READING = 14.0  # mm: the wheel in full mesh
ZERO_DISTANCE = 108.43  # mm
SLOPE = math.radians(45.0)  # of the slide
PRESSURE_ANGLE = math.radians(20.0)
MODULE = 2.0  # mm
TEETH = 88
INTRINSIC_PLAY = math.radians(0.365568)  # rad at the user: what is left with the wheel in full mesh

#: Micrometer reading [mm] and total play [rad] at the user, as measured on the bench.
MEASURED: tuple[tuple[float, float], ...] = (
    (14.0, 0.0064),
    (13.8, 0.0087),
    (13.5, 0.0094),
    (13.3, 0.0112),
    (13.1, 0.0120),
    (12.8, 0.0143),
    (12.4, 0.0172),
    (12.0, 0.0193),
    (11.5, 0.0227),
    (11.0, 0.0265),
    (10.5, 0.0300),
    (10.0, 0.0348),
    (9.5, 0.0401),
    (9.15, 0.0436),
    (9.0, 0.0457),
)


def centre_distance(reading: float) -> float:
    """Centre distance [mm] of wheel and ring at a micrometer reading [mm].

    Raises
    ------
    RangeError
        A reading outside the table's 9 to 14 mm.
    """
    _check_reading(reading)
    return ZERO_DISTANCE + (ZERO_READING - reading) * math.sin(SLOPE)


def geometric_play(reading: float) -> float:
    """Play [rad, total, user] that the centre distance adds: B = 2 dC tan(alpha) / r_pitch."""
    spread = centre_distance(reading) - ZERO_DISTANCE
    return 2.0 * spread * math.tan(PRESSURE_ANGLE) / (MODULE * TEETH / 2.0)


def measured_play(reading: float) -> float:
    """Total play [rad, at the user] measured at a reading [mm], linear between the table's rows."""
    _check_reading(reading)
    readings, plays = zip(*reversed(MEASURED), strict=True)
    return float(np.interp(reading, readings, plays))


def total_play(reading: float, curve: str = "geometric") -> float:
    """Total play [rad, at the user], intrinsic play included.

    Parameters
    ----------
    reading : float
        Micrometer reading [mm].
    curve : str
        ``geometric`` (intrinsic play plus `geometric_play`) or ``measured``. They part beyond
        some 2.5 mm of travel: the printed teeth are not exact involutes.
    """
    if curve == "geometric":
        return INTRINSIC_PLAY + geometric_play(reading)
    if curve == "measured":
        return measured_play(reading)
    raise RangeError(f"curve = {curve!r}; valid: 'geometric', 'measured'")


def micrometer_for(play: float, curve: str = "geometric") -> float:
    """Micrometer reading [mm] that sets a total play [rad, at the user].

    Raises
    ------
    RangeError
        A play the slide cannot set.
    """
    low, high = total_play(ZERO_READING, curve), total_play(MEASURED[-1][0], curve)
    if not low <= play <= high:
        raise RangeError(f"play {play:.6g} rad: the slide sets {low:.6g} to {high:.6g} rad")
    if curve == "geometric":
        rise = (play - INTRINSIC_PLAY) * MODULE * TEETH / 4.0 / math.tan(PRESSURE_ANGLE)
        return ZERO_READING - rise / math.sin(SLOPE)
    readings, plays = zip(*MEASURED, strict=True)
    return float(np.interp(play, plays, readings))


def _check_reading(reading: float) -> None:
    if not MEASURED[-1][0] <= reading <= ZERO_READING:
        raise RangeError(
            f"micrometer reading {reading!r} mm is outside {MEASURED[-1][0]} to {ZERO_READING} mm"
        )
