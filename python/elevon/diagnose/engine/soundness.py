"""What is wrong with a log itself, before anything is diagnosed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.logs.clocks.clock_fit import clipped_share

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

_CURRENTS = ("torque_current", "current_ref", "supply_current")
_MISSING, _CLIPPED = 0.01, 0.05  # share of the samples
_TURN = 0.02  # s over which a position's change is held against a speed
_ALIKE = 0.95  # correlation of the same signal
_NEARER = 3.0  # times what a speed lacks of full correlation: another one is that speed
_PAIRS = 20_000  # samples that are held against each other, about
_APART = 10.0  # times the stated ratio of two positions, either way: beyond any sensor's gain


def check_sizes(log: Log, actuator: Actuator) -> None:
    """Refuse a log whose numbers cannot be this actuator's.

    Raises
    ------
    InputError
        More current than supply over resistance lets flow; positions whose ratio is another; a
        motor's speed that a current's column has.
    """
    _check_speed(log)
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


def _check_speed(log: Log) -> None:
    """Refuse a log whose motor speed is none, where a current is how its position changes."""
    place = next((r for r in ("motor_position", "output_position") if log.has(r)), None)
    if place is None or not log.has("motor_speed") or log.time[-1] - log.time[0] <= 2.0 * _TURN:
        return
    half = max(round(0.5 * _TURN / float(np.median(np.diff(log.time)))), 1)
    step = max(len(log.time) // _PAIRS, 1)
    at = np.arange(half, len(log.time) - half, step)
    rate = log[place][at + half] - log[place][at - half]
    alike = _correlation(rate, log["motor_speed"][at])
    if not alike:  # one that stands still is a fault for diagnosis
        return
    # A current that drives friction alone goes nearly as the speed does.
    least = max(_ALIKE, 1.0 - (1.0 - alike) / _NEARER)
    for role in _CURRENTS:
        if log.has(role) and _correlation(rate, log[role][at]) > least:
            raise InputError(
                f"{log.name}: {place} changes as {role} goes, not as motor_speed: swapped columns"
            )


def _correlation(a: Floats, b: Floats) -> float:
    """Of samples that both have; nought where one of them stands still."""
    both = np.isfinite(a) & np.isfinite(b)
    a, b = a[both] - np.mean(a[both]), b[both] - np.mean(b[both])
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0.0 else 0.0


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
