"""Transients of aircraft supplies by the clauses of their standards, as tables of volts over time.

A table runs along the limit that its clause draws, from the nominal voltage and back to it. Edges
that a standard leaves open take `EDGE`. All levels and instants are ASSUMED: they have not been
held against the text of the standards, but for the levels of DO-160G 16.6.1.4, which a vendor's
manual states too (with sags of 15 and 12 ms where 30 ms stand here).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from elevon.arrays import Floats
from elevon.errors import unknown

#: Rise and fall where the clause states none. ASSUMED: fast against every filter of a drive.
EDGE = 1e-4


@dataclass(frozen=True)
class SupplyTransient:
    """One transient of a standard.

    Attributes
    ----------
    name : str
        As a scenario writes it: ``standard = "..."`` of a table.
    clause : str
        Standard, clause or figure.
    nominal : float
        V, before and after.
    levels : tuple of (float, float)
        Instants after the onset (s) and volts of the limit's corners.
    kind : str
        ``normal`` or ``abnormal`` operation.
    """

    name: str
    clause: str
    nominal: float
    levels: tuple[tuple[float, float], ...]
    kind: Literal["normal", "abnormal"] = "normal"

    def points(self) -> tuple[Floats, Floats]:
        """Return times in s and volts, shape (n,) each: an edge to the first level, one back."""
        last = self.levels[-1][0]
        times = [0.0, *(EDGE + t for t, _ in self.levels), 2 * EDGE + last]
        volts = [self.nominal, *(v for _, v in self.levels), self.nominal]
        return np.array(times), np.array(volts)


_MIL, _DO = "MIL-STD-704F", "RTCA DO-160G"

TRANSIENTS = {
    item.name: item
    for item in (
        SupplyTransient("mil-std-704f/28v/overvoltage", f"{_MIL} figure 13, upper limit", 28.0,
                        ((0.0, 50.0), (0.0125, 50.0), (0.0825, 29.0))),
        SupplyTransient("mil-std-704f/28v/undervoltage", f"{_MIL} figure 13, lower limit", 28.0,
                        ((0.0, 18.0), (0.015, 18.0), (0.1, 22.0))),
        SupplyTransient("mil-std-704f/270v/overvoltage", f"{_MIL} figure 16, upper limit", 270.0,
                        ((0.0, 330.0), (0.02, 330.0), (0.04, 280.0))),
        SupplyTransient("mil-std-704f/270v/undervoltage", f"{_MIL} figure 16, lower limit", 270.0,
                        ((0.0, 200.0), (0.01, 200.0), (0.04, 250.0))),
        SupplyTransient("do-160g/28v/surge-a", f"{_DO} 16.6.1.4, category A", 28.0,
                        ((0.0, 40.0), (0.03, 40.0))),
        SupplyTransient("do-160g/28v/sag-a", f"{_DO} 16.6.1.4, category A", 28.0,
                        ((0.0, 15.0), (0.03, 15.0))),
        SupplyTransient("do-160g/28v/surge-z", f"{_DO} 16.6.1.4, category Z", 28.0,
                        ((0.0, 50.0), (0.05, 50.0))),
        SupplyTransient("do-160g/28v/sag-z", f"{_DO} 16.6.1.4, category Z", 28.0,
                        ((0.0, 12.0), (0.03, 12.0))),
        SupplyTransient("do-160g/28v/abnormal-surge-a", f"{_DO} 16.6.2.4, category A", 28.0,
                        ((0.0, 46.3), (0.1, 46.3), (0.1 + EDGE, 37.8), (1.1, 37.8)), "abnormal"),
        SupplyTransient("do-160g/28v/abnormal-surge-z", f"{_DO} 16.6.2.4, category Z", 28.0,
                        ((0.0, 80.0), (0.1, 80.0), (0.1 + EDGE, 48.0), (1.1, 48.0)), "abnormal"),
    )
}  # fmt: skip


def supply_transient(name: str) -> SupplyTransient:
    """Return a transient by its name.

    Raises
    ------
    UnknownNameError
        None of that name; the message lists the nearest.
    """
    if name not in TRANSIENTS:
        raise unknown("supply transient", name, TRANSIENTS)
    return TRANSIENTS[name]
