"""Failure rates an hour, by kind of fault."""

from __future__ import annotations

import math
from collections.abc import Sequence

_BEARINGS, _POSITION, _MOTOR, _CONNECTOR = 1.78e-5, 1.70e-5, 1.03e-5, 6.64e-7
"""Bearings, position sensor, brushless motor, power connector: T3 Table 1.1."""
_SWITCH = 2e-6
"""A proximity switch with its wiring, and a switch of the bridge: ASSUMED, the usual order of a
sealed sensor and of a power semiconductor in flight."""
_MECHANISM = 1e-6
"""A brake, lock, release cable or screw: ASSUMED, a tenth of the motor's."""

RATES = {
    "short": _MOTOR, "open_phase": _MOTOR, "motor_shorted": _MOTOR,
    "eccentricity_static": _BEARINGS, "eccentricity_dynamic": _BEARINGS,
    "demagnetisation": _MOTOR, "bearing_wear": _BEARINGS,
    "open_switch": _SWITCH, "shorted_switch": _SWITCH, "sag": _CONNECTOR,
    "friction_growth": _MECHANISM, "efficiency_loss": _MECHANISM, "jam": _MECHANISM,
    "brake_dragging": _MECHANISM, "brake_slipping": _MECHANISM, "brake_not_releasing": _MECHANISM,
    "release_cable_failed": _MECHANISM, "lock_spring_weak": _MECHANISM,
    "lock_not_engaging": _MECHANISM, "lock_not_releasing": _MECHANISM,
    "hall_high": _POSITION, "hall_low": _POSITION, "offset": _POSITION, "dropout": _POSITION,
    "proximity_on": _SWITCH, "proximity_off": _SWITCH,
}  # fmt: skip
"""Rate an hour of each kind, at each place (a rate of a table is taken for every kind of it)."""


def rate(kinds: Sequence[str]) -> float:
    """Return the probability an hour of failures together.

    Parameters
    ----------
    kinds : sequence of str
        Kinds of the faults; an upper bound, since a failure is taken to last the hour.
    """
    return math.prod(RATES[kind] for kind in kinds)
