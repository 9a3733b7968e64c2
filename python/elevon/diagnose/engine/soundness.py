"""What is wrong with a log itself, before anything is diagnosed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.errors import InputError
from elevon.logs.clocks.quality import clipped_share

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

_CURRENTS = ("torque_current", "current_ref", "supply_current")
_MISSING, _CLIPPED = 0.01, 0.05  # share of the samples
_APART = 10.0  # times the stated ratio of two positions, either way: beyond any sensor's gain


def check_sizes(log: Log, actuator: Actuator) -> None:
    """Refuse a log whose numbers cannot be this actuator's.

    Raises
    ------
    InputError
        More current than supply over resistance lets flow; positions whose ratio is another.
    """
    known = actuator.parameters
    most = known.value("inverter.supply_voltage") / known.value("motor.winding_resistance")
    for role in _CURRENTS:
        size = float(np.nanmax(np.abs(log[role]), initial=0.0)) if log.has(role) else 0.0
        if size > most:
            raise InputError(
                f"{log.name}: {role} reaches {size:.4g} A, and no more than {most:.4g} A can flow "
                "(supply over the winding's resistance): another unit, or another column"
            )
    if log.has("motor_position", "output_position") and "screw.lead" in known:
        ratio = known.value("gear.ratio") if "gear.ratio" in known else 1.0
        stated = ratio / known.value("screw.lead")
        travels = [float(np.nanstd(log[r])) for r in ("motor_position", "output_position")]
        # A sensor that stands still is a fault for diagnosis, no column of another signal.
        seen = travels[0] / travels[1] if min(travels) > 0.0 else stated
        if not 1.0 / _APART < seen / stated < _APART:
            raise InputError(
                f"{log.name}: the motor turns {seen:.4g} rad a metre of the output, "
                f"{actuator.name} {stated:.4g}: swapped columns, or another unit"
            )


def unsound(log: Log) -> tuple[str, ...]:
    """Return findings: channels that are clipped or have samples missing."""
    out = []
    for role in log:
        values = log[role]
        missing = 1.0 - float(np.mean(np.isfinite(values)))
        if missing > _MISSING:
            out.append(f"{log.name}: {100 * missing:.0f} % of {role} are missing")
        if role in _CURRENTS and max(clipped_share(values)) > _CLIPPED:
            share = 100 * max(clipped_share(values))
            out.append(
                f"{log.name}: {share:.0f} % of {role} sit at its largest or smallest value: "
                "clipped, or at the drive's limit"
            )
    return tuple(out)
