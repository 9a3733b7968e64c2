"""A first column map of a foreign log, from its headers, its units and what fits together.

Every entry carries its reason, for you to correct: a header that says so, a column that is
the integral of another, one that leads another, a size that only one unit explains.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from elevon.arrays import Floats
from elevon.data import packaged_toml
from elevon.errors import FormatError, InputError, quoted
from elevon.logs.formats.table import RawTable
from elevon.logs.maps.agreement import evened, slope_and_fit
from elevon.logs.maps.column_map import drive_columns, known_roles, known_signals, parameter_key
from elevon.logs.maps.motion import MotionColumns, find_motion
from elevon.units import Unit, parse_unit

_TIME = re.compile(r"^(x?ms|x|t|t_?ms|t_?s|zeit.*|.*time.*|.*timestamp.*|seconds?|sec)$")
_HINTS = packaged_toml("elevon.logs", "hints.toml")
_SUFFIXES: Mapping[str, str] = _HINTS["suffixes"]
_PER_SECOND = frozenset({"mm", "cm", "m", "rad", "deg", "rev"})


@dataclass(slots=True)
class GuessedColumn:
    """A column: its role and its unit, where they are known, and why."""

    name: str
    role: str | None = None
    unit: str | None = None
    sign: int = 1
    reasons: list[str] = field(default_factory=list)


def role_hint(header: str) -> str:
    """Return the role a header suggests; empty where it says nothing (``column_3``)."""
    text = re.sub(r"[^a-z0-9]+", "_", _without_unit(header).lower()).strip("_")
    if re.fullmatch(r"column_\d+", text):
        return ""
    if text in known_roles():
        return text
    if text in known_signals():
        return known_signals()[text].role
    key = parameter_key(header)
    if key is not None:
        return drive_columns()[key].role or ""
    return "time" if _TIME.match(text) else _by_words(text)


def _without_unit(header: str) -> str:
    """Leave out a last word that is a unit; single letters only where they are capitals."""
    head, _, last = header.strip().rpartition("_")
    first, _, per = head.rpartition("_")
    if first and last == "s" and per.lower() in _PER_SECOND:
        return first
    if head and last.lower() in _SUFFIXES and (len(last) > 1 or last.isupper()):
        return head
    return header


def _by_words(text: str) -> str:
    groups = {name for name, words in _HINTS["words"].items() if re.search(words, text)}
    return next((role for role, *words in _HINTS["rules"]["all"] if groups.issuperset(words)), "")


def unit_hint(header: str, stated: str) -> str:
    """Return the unit that a file states or a header's last word suggests; empty for none."""
    name = header.strip()
    tail = re.split(r"[_\s]+", name)[-1]
    if stated or ("/" in tail and tail != name):
        return _known_unit(stated or tail)
    key = parameter_key(header)
    if name.lower() == "xms":
        return "ms"
    # A plain 'time' is no drive's column: its unit is not ms because the drive's is.
    if key is not None and key != "time":
        return drive_columns()[key].unit or ""
    words = re.split(r"[^A-Za-z0-9]+", name)
    suffix = words[-1].lower()
    if len(words) > 2 and suffix == "s" and words[-2].lower() in _PER_SECOND:
        return f"{words[-2].lower()}/s"
    return _SUFFIXES.get(suffix, "") if len(words) > 1 or suffix in {"ms", "mm", "rpm"} else ""


def _known_unit(text: str) -> str:
    try:
        return parse_unit(text).text
    except InputError:
        return ""


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


_HEAD = """# A first map of {source}: guessed, to be read and corrected.
# Roles: `role`; what is wrong is refused at the import where the data contradict it.
# A column whose meaning is not known stands at the end as a comment.
"""


def guess_text(guess: Guess) -> str:
    """Return the map's file."""
    text = _HEAD.format(source=ascii(guess.source)[1:-1])
    if guess.travel_per_turn is not None:
        text += f'travel_per_turn = "{1e3 * guess.travel_per_turn:.6g} mm"  # as the data show\n'
    if guess.gear_ratio is not None:
        text += f"gear_ratio = {guess.gear_ratio:.6g}  # as the data show\n"
    if any(item.role in _CURRENTS for item in guess.columns):
        text += 'current = "peak"  # ASSUMED; "rms" where the drive logs effective values\n'
    for item in guess.columns:
        text += "\n" + (_entry(item) if item.role else _unknown(item))
    return text


_CURRENTS = {"torque_current", "current_ref", "direct_current", "torque_voltage"}


def _entry(item: GuessedColumn) -> str:
    lines = [f"# {_comment(reason)}" for reason in item.reasons]
    lines += ["[[column]]", f"name = {json.dumps(item.name)}", f'role = "{item.role}"']
    if item.unit:
        lines.append(f"unit = {json.dumps(item.unit)}")
    if item.sign < 0:
        lines.append("sign = -1")
    return "\n".join(lines) + "\n"


def _unknown(item: GuessedColumn) -> str:
    lines = [f"# not known: {_comment(item.name)}"]
    lines += [f"# {_comment(reason)}" for reason in item.reasons]
    return "\n".join(lines) + "\n"


def _comment(text: str) -> str:
    """Foreign text on one line, without control characters."""
    return "".join(c if c.isprintable() else "?" for c in text)[:200]
