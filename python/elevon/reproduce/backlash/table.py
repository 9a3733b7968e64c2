"""The measured backlash table of the Torino bench and its geometric formula."""

from __future__ import annotations

import math
from dataclasses import dataclass

from elevon.data import read_table

INTRINSIC_DEG = 0.365568
"""Backlash of the bench itself at zero spacing, total, at the output side (thesis) [deg]."""
PRESSURE_ANGLE = math.radians(20.0)
PITCH_RADIUS_MM = 88.0
"""Module 2 times 88 teeth, halved."""


@dataclass(frozen=True, slots=True)
class BacklashRow:
    """One setting of the encoder support.

    Attributes
    ----------
    row : int
        From 1, as printed.
    micrometer_mm, centre_distance_mm, spacing_mm : float
        Reading, distance of the two gears' centres, and that less the distance of row 1.
    calculated_deg : float
        Net backlash of the formula as printed.
    measured_total_deg : float
        Measured total backlash: the printed radians in degrees.
    """

    row: int
    micrometer_mm: float
    centre_distance_mm: float
    spacing_mm: float
    calculated_deg: float
    measured_total_deg: float


def measured_rows() -> list[BacklashRow]:
    """Return the fifteen rows as printed."""
    return [
        BacklashRow(
            row=int(line["row"]),
            micrometer_mm=float(line["micrometer_mm"]),
            centre_distance_mm=float(line["centre_distance_mm"]),
            spacing_mm=float(line["spacing_mm"]),
            calculated_deg=float(line["net_calculated_deg"]),
            measured_total_deg=math.degrees(float(line["total_measured_rad"])),
        )
        for line in read_table("torino_backlash")
    ]


def centre_distance(micrometer_mm: float) -> float:
    """Return the centre distance [mm] of a micrometer reading: the support slides at 45 deg."""
    return 108.43 + (14.0 - micrometer_mm) * math.sin(math.radians(45.0))


def formula_deg(spacing_mm: float) -> float:
    """Return the total backlash [deg] that a radial spacing gives between ideal teeth.

    Two flanks, each opening by spacing * tan(pressure angle), over the pitch radius, and the
    bench's intrinsic backlash. The published form divides by z instead of the pitch radius m z / 2
    and is right only because m = 2.
    """
    opened = 2.0 * spacing_mm * math.tan(PRESSURE_ANGLE) / PITCH_RADIUS_MM
    return math.degrees(opened) + INTRINSIC_DEG
