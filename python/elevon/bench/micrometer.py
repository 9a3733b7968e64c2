"""The backlash-setting micrometer: reading -> centre distance -> backlash, computed and measured.

The encoder's wheel meshes with the output ring; a slide at 45 deg moves it away. Numbers:
test-bench thesis (2022), "Backlash evaluation", and its table of fifteen positions.
"""

from __future__ import annotations

import math

import numpy as np

from elevon.data import read_table
from elevon.errors import RangeError

ZERO_READING = 14.0  # mm: the wheel in full mesh
ZERO_DISTANCE = 108.43  # mm
SLOPE = math.radians(45.0)  # of the slide
PRESSURE_ANGLE = math.radians(20.0)
MODULE = 2.0  # mm
TEETH = 88
INTRINSIC_BACKLASH = math.radians(
    0.365568
)  # rad at the output: what is left with the wheel in full mesh

#: Micrometer reading [mm] and total backlash [rad] at the output, as measured on the bench.
MEASURED = tuple(
    (float(row["micrometer_mm"]), float(row["total_measured_rad"]))
    for row in read_table("torino_backlash")
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


def geometric_backlash(reading: float) -> float:
    """Total output backlash [rad] that the centre distance adds: B = 2 dC tan(alpha) / r_pitch."""
    spread = centre_distance(reading) - ZERO_DISTANCE
    return 2.0 * spread * math.tan(PRESSURE_ANGLE) / (MODULE * TEETH / 2.0)


def measured_backlash(reading: float) -> float:
    """Total backlash [rad, at the output] measured at a reading [mm], linear between rows."""
    _check_reading(reading)
    readings, backlashes = zip(*reversed(MEASURED), strict=True)
    return float(np.interp(reading, readings, backlashes))


def total_backlash(reading: float, curve: str = "geometric") -> float:
    """Total backlash [rad, at the output], intrinsic backlash included.

    Parameters
    ----------
    reading : float
        Micrometer reading [mm].
    curve : str
        ``geometric`` (intrinsic backlash plus `geometric_backlash`) or ``measured``. They part
        beyond some 2.5 mm of travel: the printed teeth are not exact involutes.
    """
    if curve == "geometric":
        return INTRINSIC_BACKLASH + geometric_backlash(reading)
    if curve == "measured":
        return measured_backlash(reading)
    raise RangeError(f"curve = {curve!r}; valid: 'geometric', 'measured'")


def micrometer_for(backlash: float, curve: str = "geometric") -> float:
    """Micrometer reading [mm] that sets a total backlash [rad, at the output].

    Raises
    ------
    RangeError
        A backlash the slide cannot set.
    """
    low, high = total_backlash(ZERO_READING, curve), total_backlash(MEASURED[-1][0], curve)
    if not low <= backlash <= high:
        raise RangeError(f"backlash {backlash:.6g} rad: the slide sets {low:.6g} to {high:.6g} rad")
    if curve == "geometric":
        rise = (backlash - INTRINSIC_BACKLASH) * MODULE * TEETH / 4.0 / math.tan(PRESSURE_ANGLE)
        return ZERO_READING - rise / math.sin(SLOPE)
    readings, backlashes = zip(*MEASURED, strict=True)
    return float(np.interp(backlash, backlashes, readings))


def _check_reading(reading: float) -> None:
    if not MEASURED[-1][0] <= reading <= ZERO_READING:
        raise RangeError(
            f"micrometer reading {reading!r} mm is outside {MEASURED[-1][0]} to {ZERO_READING} mm"
        )
