"""A first column map of a foreign log, from its headers, its units and what fits together.

Every entry carries its reason, for you to correct: a header that says so, a column that is
the integral of another, one that leads another, a size that only one unit explains.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError, quoted, unknown
from elevon.estimate.signals import integral
from elevon.logs.formats.table import RawTable, split_unit
from elevon.logs.maps.agreement import slope_and_fit
from elevon.logs.maps.column_map import (
    drive_unit,
    known_roles,
    known_signals,
    parameter_key,
    unit_among,
)
from elevon.logs.maps.headers import (
    EXPLAINED,
    HINTS,
    PLACES,
    GuessedColumn,
    plain_words,
    role_hint,
    settle_time,
    unit_hint,
)
from elevon.logs.maps.joint import (
    DOUBTFUL,
    KINDS,
    Candidate,
    Joint,
    assign_roles,
    drives_of,
    lead,
)
from elevon.logs.maps.motion import MotionColumns, find_motion
from elevon.units import parse_unit


@dataclass(frozen=True, slots=True)
class Question:
    """What a log leaves open.

    Attributes
    ----------
    role : str
        Role that is doubtful; ``drive`` where several drives stand in one file.
    candidates : list of str
        Columns (of a drive: names; of a unit: units), the likeliest first.
    text : str
        The question, with the option that answers it.
    """

    role: str
    candidates: list[str]
    text: str


_LEAST = 30  # samples
_STATES = 16  # different whole numbers, at most, of a state
_STEADY = 0.05  # deviation over mean of a supply's voltage
_CURRENT = 0.2  # share of a column that acceleration, friction and speed must explain
_ALIKE = 0.1  # share by which what drives must be explained better than another column
_PHASE = "current_a"
_DEFAULT_UNITS = HINTS["default_units"]
_COUNTS = frozenset(HINTS["counts"]["words"])


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
    questions: tuple[Question, ...] = ()

    def roles(self) -> list[dict[str, str | float | None]]:
        """Return the roles given, each with its column, unit, reason and margin."""
        return [
            {"role": c.role, "column": c.name, "unit": c.unit, "reason": "; ".join(c.reasons),
             "margin": c.margin}
            for c in self.columns if c.role
        ]  # fmt: skip


def guess_map(
    table: RawTable, *, drive: str | None = None, answers: Mapping[str, str] | None = None
) -> Guess:
    """Guess what the columns of a table are.

    Parameters
    ----------
    table : RawTable
        The log.
    drive : str, optional
        Which of several drives in the file.
    answers : mapping of str to str, optional
        Role to the column that has it, whatever the guess; behind it in brackets its unit, or what
        one of its numbers is: ``qm [m]``, ``pos [0.25 deg]``.

    Raises
    ------
    FormatError
        No column that could be the time.
    InputError
        No such drive, column or role, or a unit that the role cannot have.
    """
    table, questions = _one_drive(table, drive)
    given = {role: _answer(role, text, table) for role, text in (answers or {}).items()}
    answers = {role: item.name for role, item in given.items()}
    stated = {item.name: item for item in given.values() if item.unit}
    table = replace(
        table,
        columns={n: v * stated[n].scale if n in stated else v for n, v in table.columns.items()},
        units={**table.units, **{n: str(item.unit) for n, item in stated.items()}},
    )
    columns = {
        name: GuessedColumn(name, unit=unit_hint(name, table.units.get(name, "")) or None)
        for name in table.columns
    }
    time = settle_time(table, columns)
    for item in given.values():
        columns[item.name].role, columns[item.name].scale = item.role, item.scale
        columns[item.name].reasons.append("as you say")
    questions += _headers(time, columns, table, answers)
    joint = assign_roles(time, _joint_candidates(table, columns), _current_like(table, columns))
    questions += _settle_joint(joint, columns, answers)
    swapped = _swapped(columns)
    motion = find_motion(time, _candidates(table, columns))
    _apply(motion, columns)
    if motion.position is not None:
        questions += _effort(time, table, columns, motion)
    questions += _counts(time, table, columns) + _units(columns)
    return Guess(
        table.source, list(columns.values()), motion.gear_ratio, motion.travel_per_turn,
        motion.swapped or swapped, tuple(questions),
    )  # fmt: skip


def _one_drive(table: RawTable, drive: str | None) -> tuple[RawTable, list[Question]]:
    """Return the columns of one drive, and the question which where several stand in the file."""
    drives = drives_of(list(table.columns))
    if drive is not None and drive not in drives:
        if not drives:
            raise InputError(f"{table.source}: --drive {drive}: the columns name no drives")
        raise unknown("drive", drive, drives, table.source)
    if not drives:
        return table, []
    chosen = drive or drives[0]
    others = tuple(d for d in drives if d != chosen)
    chosen_columns = {
        name: values
        for name, values in table.columns.items()
        if not any(re.match(rf"{re.escape(other)}[ _.:/-]", name) for other in others)
    }
    question = Question(
        "drive", drives, f"several drives stand in the file: {', '.join(drives)}; say --drive NAME"
    )
    return replace(table, columns=chosen_columns), [] if drive else [question]


def _answer(role: str, text: str, table: RawTable) -> GuessedColumn:
    """Return the column of an answer, ``COLUMN`` or ``COLUMN [SIZE]``, with its unit and scale."""
    if role not in known_roles():
        raise unknown("role", role, known_roles(), "--role")
    if text in table.columns:
        return GuessedColumn(text, role)
    name, size = split_unit(text)
    if name not in table.columns:
        raise unknown("column", name, table.columns, table.source)
    number, _, unit = size.partition(" ")
    place = f"--role {role}={text}"
    try:
        scale = float(number)
    except ValueError:
        scale, unit = 1.0, size
    if not (math.isfinite(scale) and scale > 0.0):
        raise InputError(f"{place}: {size!r} must be above 0")
    units = known_roles()[role].units
    unit = drive_unit(unit or "1", units)
    unit_among((*units, "m/s") if role == "motor_speed" else units, unit, place)
    return GuessedColumn(name, role, unit, scale=scale)


def _kind(item: GuessedColumn, stated: str) -> str:
    """Return the kind of quantity a column's unit says; ``other`` for one that no motion has."""
    if stated.strip().lower() in _COUNTS:
        return "counts"
    if not item.unit:
        return "other" if stated.strip() else ""
    return _KINDS.get(parse_unit(item.unit).dimension, "other")


_KINDS = {
    parse_unit(unit).dimension: kind
    for unit, kind in (("rad", "angle"), ("m", "length"), ("rad/s", "turning"), ("m/s", "sliding"))
}


def _joint_candidates(table: RawTable, columns: Mapping[str, GuessedColumn]) -> list[Candidate]:
    """Return the columns whose unit allows a role of motion, and which no other role has."""
    chosen = []
    for name, item in columns.items():
        if item.role and item.role not in KINDS:
            continue
        kind = _kind(item, table.units.get(name, ""))
        values = table.columns[name]
        good = np.isfinite(values)
        if kind == "other" or good.sum() <= _LEAST or not np.ptp(values[good]) > 0.0:
            continue
        if not kind and _is_state(values[good]):
            continue
        index = np.arange(len(values))
        whole = np.interp(index, index[good], values[good])
        hint = role_hint(name)
        hint = item.role or (hint if hint in KINDS else "")
        known = name.strip().lower() in {*known_roles(), *known_signals()}
        exact = bool(item.role or (hint and (known or parameter_key(name) is not None)))
        scale = parse_unit(item.unit).factor if item.unit else 1.0
        chosen.append(Candidate(name, kind, scale, whole, hint, exact))
    return chosen


def _swapped(columns: Mapping[str, GuessedColumn]) -> tuple[str, str] | None:
    """Return motor's and output's position where the header of each names the other."""
    motor, output = (next((n for n, c in columns.items() if c.role == r), "") for r in (
        "motor_position", "output_position"))  # fmt: skip
    if role_hint(motor) != "output_position" or role_hint(output) != "motor_position":
        return None
    columns[motor].reasons.append(f"swapped with {output!r}: it moves as the motor does")
    columns[output].reasons.append(f"swapped with {motor!r}: it moves less")
    return motor, output


def _current_like(table: RawTable, columns: Mapping[str, GuessedColumn]) -> dict[str, Floats]:
    """Return the columns that may drive: in ampere, said to, or in no unit and of no other role."""
    chosen = {}
    for name, item in columns.items():
        values = table.columns[name]
        bare = not (item.unit or table.units.get(name, "").strip() or item.role)
        drives = item.role in _DRIVING or _is_current(item)
        if (bare or drives) and np.isfinite(values).all() and not _is_state(values):
            chosen[name] = values
    return chosen


def _is_state(values: Floats) -> bool:
    """Whether values are a few whole numbers: a mode or a flag, and no motion."""
    return bool((values == np.rint(values)).all()) and len(np.unique(values)) <= _STATES


def _settle_joint(
    joint: Joint, columns: Mapping[str, GuessedColumn], answers: Mapping[str, str]
) -> list[Question]:
    """Give the columns the roles of the best assignment; return what it leaves open."""
    questions = []
    for item in columns.values():
        if item.role in KINDS:
            item.role = None
    for role, name in joint.roles.items():
        item = columns[name]
        item.role, item.margin = role, round(joint.margins[role], 3)
        item.reasons.append(joint.reasons[role])
        if joint.others[role] and role not in answers:
            candidates = [name, *filter(None, joint.others[role])]
            listed = ", ".join(quoted(c) for c in candidates)
            text = f"which column is the {role}: {listed}? say --role {role}=COLUMN"
            questions.append(Question(role, candidates, text))
    return questions


def _counts(time: Floats, table: RawTable, columns: Mapping[str, GuessedColumn]) -> list[Question]:
    """Settle positions in counts by the speed of their shaft; ask where there is none."""
    questions = []
    speed = next((c for c in columns.values() if c.role == "motor_speed" and c.unit), None)
    for name, item in columns.items():
        if item.role not in PLACES or table.units.get(name, "").strip().lower() not in _COUNTS:
            continue
        slope = explained = 0.0
        if speed is not None and item.role == "motor_position":
            turned = np.nan_to_num(table.columns[speed.name]) * parse_unit(speed.unit or "").factor
            slope, explained = slope_and_fit(integral(time, turned), table.columns[name])
        if explained > EXPLAINED and slope:
            turn = round(2.0 * math.pi * abs(slope))
            item.unit, item.scale = "rev", 1.0 / turn
            item.reasons.append(f"{turn} counts a turn, by the speed of {speed.name!r}")  # type: ignore[union-attr]
        else:
            item.unit = None
            text = (
                f"{quoted(name)} is in counts: say what one is, "
                f"--role '{item.role}={name} [0.001 deg]'"
            )
            questions.append(Question(item.role or "", ["rad", "rev", "mm"], text))
    return questions


def _headers(
    time: Floats,
    columns: Mapping[str, GuessedColumn],
    table: RawTable,
    answers: Mapping[str, str],
) -> list[Question]:
    """Take roles other than of motion from headers; return what they leave open.

    Of two that suggest one role neither has it yet.
    """
    hints = {name: role_hint(name) for name, item in columns.items() if not item.role}
    amperes = [n for n, i in columns.items() if _is_current(i) and not i.role]
    for name in amperes:
        if hints[name] not in _CURRENT_ROLES:
            wanted = re.search(HINTS["words"]["wanted"], plain_words(name)) is not None
            hints[name] = "current_ref" if wanted else "torque_current"
    questions = _two_currents(time, table, columns, hints, amperes)
    for name, role in hints.items():
        if not role or role == "time" or role in KINDS or role in answers:
            continue
        if not _unit_allows(role, columns[name], table.units.get(name, "")):
            columns[name].reasons.append(
                f"its header suggests {role}, which is never in {table.units[name]}"
            )
            continue
        if list(hints.values()).count(role) > 1:
            columns[name].reasons.append(f"its header suggests {role}, and so does another's")
            continue
        values = table.columns[name]
        if role == "torque_voltage" and np.nanstd(values) < _STEADY * np.nanmean(values):
            columns[name].role = "supply_voltage"
            columns[name].reasons.append("a voltage that stays: the supply's")
            continue
        columns[name].role = role
        columns[name].reasons.append("by its header")
        if role == _PHASE and _in_units(name, hints, columns):
            columns[name].role, columns[name].unit = "torque_current", "A"
            columns[name].reasons.append("the other headers end in units: in A, not of phase a")
        _drop_odd_unit(columns[name])
    return questions


def _two_currents(
    time: Floats,
    table: RawTable,
    columns: Mapping[str, GuessedColumn],
    hints: dict[str, str],
    amperes: list[str],
) -> list[Question]:
    """Tell current and set point apart where headers do not: the set point leads."""
    doubtful = [n for n in amperes if hints[n] == "torque_current"]
    if len(doubtful) != 2 or "current_ref" in hints.values():
        return []
    first, second = doubtful
    pair = [table.columns[name] for name in doubtful]
    ahead = (
        lead(time, *pair) if all(np.isfinite(v).all() and np.ptp(v) > 0.0 for v in pair) else 0.0
    )
    if abs(ahead) < DOUBTFUL:
        listed = ", ".join(quoted(name) for name in doubtful)
        text = f"which column is the torque_current: {listed}? say --role torque_current=COLUMN"
        return [Question("torque_current", doubtful, text)]
    reference, measured = (first, second) if ahead > 0.0 else (second, first)
    hints[reference] = "current_ref"
    columns[reference].margin = columns[measured].margin = round(abs(ahead), 3)
    columns[reference].reasons.append(f"{measured!r} follows it")
    return []


_CURRENT_ROLES = frozenset(
    {"torque_current", "current_ref", "direct_current", "supply_current", "current_a", "current_b",
     "current_c"}
)  # fmt: skip


def _is_current(item: GuessedColumn) -> bool:
    return bool(item.unit) and parse_unit(item.unit or "").dimension == parse_unit("A").dimension


def _unit_allows(role: str, item: GuessedColumn, stated: str) -> bool:
    """Whether the unit that the file states is one of the role's."""
    if not stated.strip() or role not in known_roles():
        return True
    if not item.unit:
        return False
    dimension = parse_unit(item.unit).dimension
    return any(parse_unit(unit).dimension == dimension for unit in known_roles()[role].units)


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
        if not role and _kind(item, table.units.get(name, "")) == "other":
            continue
        if not role and _is_state(values[good]):
            continue
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


def _effort(
    time: Floats, table: RawTable, columns: Mapping[str, GuessedColumn], motion: MotionColumns
) -> list[Question]:
    """Find what drives the motion among what is left: acceleration, friction and speed explain it.

    Neither data nor a header without a unit tell a current from another effort: that is asked.
    """
    if any(item.role in _DRIVING for item in columns.values()):
        return []
    speed = np.gradient(motion.smooth, time)
    size = float(np.std(speed)) or 1.0
    parts = np.column_stack((np.gradient(speed, time), np.tanh(10.0 * speed / size), speed))
    shares: dict[str, float] = {}
    for name, item in columns.items():
        values = table.columns[name]
        good = np.isfinite(values)
        if item.role not in _PERHAPS or good.sum() < 100 or not np.ptp(values[good]) > 0.0:
            continue
        if not _unit_allows("effort", item, table.units.get(name, "")) or _is_state(values[good]):
            continue
        design = np.column_stack((parts[good], np.ones(good.sum())))
        fit = design @ np.linalg.lstsq(design, values[good], rcond=None)[0]
        shares[name] = slope_and_fit(fit, values[good])[1]
    most = max(shares.values(), default=0.0)
    near = sorted((n for n in shares if shares[n] > most - _ALIKE), key=lambda n: -shares[n])
    if not most > _CURRENT:
        return []
    best = columns[near[0]]
    why = f"acceleration, direction and speed explain {100 * most:.0f} % of it, as of an effort"
    if best.role is not None:
        best.reasons.append(why)
        return []
    best.role = "effort"
    best.reasons.append(why)
    if len(near) > 1:
        text = (
            f"which column is the effort: {', '.join(map(quoted, near))}? say --role effort=COLUMN"
        )
        return [Question("effort", near, text)]
    if best.unit and best.unit != "%":
        return []
    roles = ["torque_current", "effort"]
    text = (
        f"what is {quoted(best.name)}? a current: say --role torque_current={best.name!r}, in "
        f"another unit than A what one of its numbers is: '{best.name} [0.01 A]'; any other "
        f"effort: --role effort={best.name!r}, its unit in brackets behind it where it is known"
    )
    return [Question("effort", roles, text)]


_DRIVING = frozenset({"torque_current", "current_ref", "effort", "torque_ref"})
#: Roles that their units suggest, and none: each may be the effort of a log that has no other.
_PERHAPS = frozenset({None, "torque_voltage", "load_cell"})


def _units(columns: Mapping[str, GuessedColumn]) -> list[Question]:
    """Give what still has no unit the usual one, and say so; ask for that of a position."""
    questions = []
    for item in columns.values():
        if item.role and not item.unit and item.role in _DEFAULT_UNITS:
            item.unit = _DEFAULT_UNITS[item.role]
            item.reasons.append(f"unit not stated: {item.unit} ASSUMED")
    places = [c for c in columns.values() if c.role in (*PLACES, "command")]
    assumed = [c for c in places if any("no speed to tell" in reason for reason in c.reasons)]
    for item in assumed:
        text = (
            f"in what unit is {quoted(item.name)}? say it behind its name, "
            f"--role '{item.role}={item.name} [UNIT]'"
        )
        questions.append(Question(item.role or "", ["m", "mm", "rad", "deg"], text))
    return questions


_HEAD = """# A first map of {source}: guessed, to be read and corrected.
# Roles: `role`; what is wrong is refused at the import where the data contradict it.
# A column whose meaning is not known stands at the end as a comment.
"""


def guess_text(guess: Guess) -> str:
    """Return the map's file."""
    text = _HEAD.format(source=_comment(guess.source))
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
    lines += [
        "[[column]]",
        f"name = {json.dumps(item.name, ensure_ascii=False)}",
        f'role = "{item.role}"',
    ]
    if item.unit:
        lines.append(f"unit = {json.dumps(item.unit, ensure_ascii=False)}")
    if item.sign < 0:
        lines.append("sign = -1")
    if item.scale != 1.0:
        lines.append(f"scale = {item.scale!r}")
    return "\n".join(lines) + "\n"


def _unknown(item: GuessedColumn) -> str:
    lines = [f"# not known: {_comment(item.name)}"]
    lines += [f"# {_comment(reason)}" for reason in item.reasons]
    return "\n".join(lines) + "\n"


def _comment(text: str) -> str:
    """Foreign text on one line, without control characters."""
    return "".join(c if c.isprintable() else "?" for c in text)[:200]
