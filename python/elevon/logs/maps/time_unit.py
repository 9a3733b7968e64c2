"""Unit of a time column: what else the log shows decides, else both readings are stated."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from elevon.arrays import Floats
from elevon.logs.formats.table import RawTable
from elevon.logs.maps.agreement import evened, slope_and_fit
from elevon.logs.maps.hints import GuessedColumn, role_hint
from elevon.units import Unit, parse_unit

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
_COARSE = 0.05  # a step of so much is ms: logs are sampled at 20 Hz and faster
_FAST = 20e3  # Hz: a faster log is rare, so that its unit is doubted
_NEAR = 0.2  # relative: an integral within this of its position names the unit
_EXPLAINED = 0.9  # of a position by the integral of its speed
_PLACES = ("output_position", "motor_position")
_SPEEDS = ("output_speed", "motor_speed")


def settle_time_unit(
    entry: GuessedColumn, table: RawTable, columns: Mapping[str, GuessedColumn]
) -> None:
    """Settle the unit of the time column, with its reasons.

    A position and a speed whose headers state their units are consistent with one unit only. Where
    there are none the header counts, else the size of the steps; a reading that is not the only
    possible one is stated.
    """
    step = float(np.median(np.diff(evened(table.columns[entry.name]))))
    consistent = _by_motion(table.columns[entry.name], table, columns)
    if consistent is not None:
        if entry.unit and entry.unit != consistent:
            entry.reasons.append(f"its header suggests {entry.unit}, and the motion contradicts it")
        entry.unit = consistent
        entry.reasons.append(f"in {consistent} a position is the integral of its speed")
        return
    if not entry.unit:
        entry.unit = "ms" if step >= _COARSE else "s"
        entry.reasons.append(f"steps of {step:.4g}: {entry.unit}")
    scale = TIME_UNITS.get(entry.unit)
    if scale is not None and _doubtful(step, entry.unit):
        rates = " or ".join(f"{1.0 / (step * TIME_UNITS[u]):.4g} Hz in {u}" for u in ("s", "ms"))
        entry.reasons.append(f"both are possible, s and ms: {rates}; correct it where it is wrong")


def _doubtful(step: float, unit: str) -> bool:
    """Whether the other of s and ms is as possible: a rate from 1 Hz to 1 MHz in both."""
    if unit not in {"s", "ms"}:
        return False
    rates = [1.0 / (step * TIME_UNITS[name]) for name in ("s", "ms")]
    fast = unit == "ms" and rates[1] > _FAST
    return fast or (unit == "s" and all(1.0 <= rate <= 1.0001e6 for rate in rates))


def _by_motion(time: Floats, table: RawTable, columns: Mapping[str, GuessedColumn]) -> str | None:
    """Unit in which a position is the integral of its speed, both units from the headers."""
    steps = np.diff(time, prepend=time[0])
    for place, unit in _stated(_PLACES, table, columns):
        for rate, per_time in _stated(_SPEEDS, table, columns):
            if per_time.dimension != parse_unit(f"{unit.text}/s").dimension:
                continue
            slope, explained = slope_and_fit(np.cumsum(rate * steps), place)
            for name, scale in TIME_UNITS.items():
                if explained > _EXPLAINED and abs(slope / scale - 1.0) < _NEAR:
                    return name
    return None


def _stated(
    roles: tuple[str, ...], table: RawTable, columns: Mapping[str, GuessedColumn]
) -> list[tuple[Floats, Unit]]:
    """Values in SI, and units, of the columns whose headers name a role and state a unit."""
    chosen = []
    for name, item in columns.items():
        values = table.columns[name]
        if item.unit and role_hint(name) in roles and np.isfinite(values).all():
            unit = parse_unit(item.unit)
            chosen.append((np.asarray(values * unit.factor, dtype=np.float64), unit))
    return chosen
