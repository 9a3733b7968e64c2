"""A first column map of a foreign log, from its headers, its units and what fits together.

Every entry carries its reason, for you to correct: a header that says so, a column that is
the integral of another, one that leads another, a size that only one unit explains.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.data import packaged_toml
from elevon.errors import FormatError, quoted
from elevon.logs.formats.table import RawTable
from elevon.logs.maps.agreement import evened, slope_and_fit
from elevon.logs.maps.hints import GuessedColumn, role_hint, unit_hint
from elevon.logs.maps.motion import MotionColumns, find_motion
from elevon.logs.maps.signals import known_roles
from elevon.logs.maps.time_unit import TIME_UNITS, settle_time_unit
from elevon.units import parse_unit

_EVEN = 0.25  # of the columns that rise, the one whose steps scatter least is the time
_MOVES = 0.05  # of a clock's steps, at least, are no repetition: a command that steps is no clock
_CURRENT = 0.2  # share of a column that acceleration, friction and speed must explain
_PHASE = "current_a"
_DEFAULT_UNITS = packaged_toml("elevon.logs", "hints.toml")["default_units"]


@dataclass(frozen=True, slots=True)
class Guess:
    """A first map of a log.

    Attributes
    ----------
    source : str
        The log.
    columns : list of GuessedColumn
        In the file's order.
    gear_ratio : float or None
        Motor over output, where both angles show it.
    travel_per_turn : float or None
        m of the output for one turn of the motor.
    swapped : (str, str) or None
        Columns of motor and output whose headers name the other.
    """

    source: str
    columns: list[GuessedColumn]
    gear_ratio: float | None = None
    travel_per_turn: float | None = None
    swapped: tuple[str, str] | None = None


def guess_map(table: RawTable) -> Guess:
    """Guess what the columns of a table are.

    Raises
    ------
    FormatError
        No column that could be the time.
    """
    columns = {
        name: GuessedColumn(name, unit=unit_hint(name, table.units.get(name, "")) or None)
        for name in table.columns
    }
    time = _time(table, columns)
    _headers(columns)
    motion = find_motion(time, _candidates(table, columns))
    _apply(motion, columns)
    if motion.position is not None:
        _current(time, table, columns, motion)
    _units(columns)
    return Guess(
        table.source, list(columns.values()), motion.gear_ratio, motion.travel_per_turn,
        motion.swapped,
    )  # fmt: skip


def _time(table: RawTable, columns: Mapping[str, GuessedColumn]) -> Floats:
    """Settle the time column and return it in s."""
    rising = {}
    for name, values in table.columns.items():
        steps = np.diff(values)
        if (
            len(steps)
            and np.isfinite(steps).all()
            and (steps >= 0.0).all()
            and np.count_nonzero(steps) > _MOVES * len(steps)
        ):
            rising[name] = float(np.std(steps) / np.mean(steps))
    if not rising:
        raise FormatError(
            f"{table.source}: no column rises throughout: none can be the time; columns: "
            f"{', '.join(quoted(name) for name in list(table.columns)[:12])}"
        )
    named = [name for name in rising if role_hint(name) == "time"]
    name = named[0] if named else min(rising, key=lambda n: rising[n])
    entry = columns[name]
    entry.role = "time"
    entry.reasons.append("named as time" if named else "rises throughout, most evenly")
    settle_time_unit(entry, table, columns)
    scale = TIME_UNITS.get(entry.unit or "", 1.0)
    return np.asarray(evened(table.columns[name]) * scale, dtype=np.float64)


def _headers(columns: Mapping[str, GuessedColumn]) -> None:
    """Take roles from the headers; of two that suggest one role neither has it yet."""
    hints = {name: role_hint(name) for name, item in columns.items() if not item.role}
    for name, role in hints.items():
        if not role or role == "time":
            continue
        if list(hints.values()).count(role) > 1:
            columns[name].reasons.append(f"its header suggests {role}, and so does another's")
            continue
        columns[name].role = role
        columns[name].reasons.append("by its header")
        if role == _PHASE and _in_units(name, hints, columns):
            columns[name].role, columns[name].unit = "torque_current", "A"
            columns[name].reasons.append("the other headers end in units: in A, not of phase a")
        _drop_odd_unit(columns[name])


def _in_units(name: str, hints: Mapping[str, str], columns: Mapping[str, GuessedColumn]) -> bool:
    """Whether a last word 'a' is the unit: most headers end in theirs, and no phase b is there."""
    if not name.endswith("_a") or {"current_b", "current_c", "torque_current"} & set(
        hints.values()
    ):
        return False
    others = [item for other, item in columns.items() if other != name]
    ending = sum(bool(item.unit) and "_" in item.name for item in others)
    return 2 * ending > len(others)


def _drop_odd_unit(item: GuessedColumn) -> None:
    """Forget a unit that no signal in this role can have: the header was misread."""
    if not item.unit or item.role is None or item.role not in known_roles():
        return
    dimension = parse_unit(item.unit).dimension
    units = known_roles()[item.role].units
    if item.role == "motor_speed":
        units = (*units, *known_roles()["output_speed"].units)
    if all(parse_unit(unit).dimension != dimension for unit in units):
        item.reasons.append(f"not in {item.unit}, which its header suggests")
        item.unit = None


def _candidates(
    table: RawTable, columns: Mapping[str, GuessedColumn]
) -> dict[str, tuple[str, str, Floats]]:
    """Columns that may be positions or speeds: role so far, unit so far, values without holes."""
    moving = {"", "command", "output_position", "output_speed", "motor_position", "motor_speed",
              "speed_ref"}  # fmt: skip
    chosen = {}
    for name, item in columns.items():
        values = table.columns[name]
        good = np.isfinite(values)
        role = item.role or ""
        if role in moving and good.sum() > 30 and np.ptp(values[good]) > 0.0:
            index = np.arange(len(values))
            chosen[name] = (role, item.unit or "", np.interp(index, index[good], values[good]))
    return chosen


def _apply(motion: MotionColumns, columns: Mapping[str, GuessedColumn]) -> None:
    for name in motion.swapped or ():
        columns[name].role = None
    for name, finding in motion.findings.items():
        item = columns[name]
        if finding.role and finding.role != item.role:
            clash = next((c for c in columns.values() if c.role == finding.role), None)
            if clash is not None:
                clash.role = None
            item.role = finding.role
        item.unit = finding.unit or item.unit
        item.sign = finding.sign
        item.reasons.extend(finding.reasons)


def _current(
    time: Floats, table: RawTable, columns: Mapping[str, GuessedColumn], motion: MotionColumns
) -> None:
    """Find the current among what is left: acceleration, friction and speed explain it."""
    if any(item.role in {"torque_current", "current_ref"} for item in columns.values()):
        return
    speed = np.gradient(motion.smooth, time)
    size = float(np.std(speed)) or 1.0
    parts = np.column_stack((np.gradient(speed, time), np.tanh(10.0 * speed / size), speed))
    best, most = None, _CURRENT
    for name, item in columns.items():
        values = table.columns[name]
        good = np.isfinite(values)
        if item.role or good.sum() < 100 or not np.ptp(values[good]) > 0.0:
            continue
        design = np.column_stack((parts[good], np.ones(good.sum())))
        fit = design @ np.linalg.lstsq(design, values[good], rcond=None)[0]
        explained = slope_and_fit(fit, values[good])[1]
        if explained > most:
            best, most = item, explained
    if best is not None:
        best.role = "torque_current"
        best.reasons.append(
            f"acceleration, direction and speed explain {100 * most:.0f} % of it, as of a current"
        )


def _units(columns: Mapping[str, GuessedColumn]) -> None:
    """Give what still has no unit the usual one, and say so."""
    for item in columns.values():
        if item.role and not item.unit and item.role in _DEFAULT_UNITS:
            item.unit = _DEFAULT_UNITS[item.role]
            item.reasons.append(f"unit not stated: {item.unit} ASSUMED")
