"""What headers say of columns, and the time: which column it is, and in what unit."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from elevon.arrays import Floats
from elevon.data import packaged_toml
from elevon.errors import FormatError, InputError, quoted
from elevon.logs.formats.table import RawTable
from elevon.logs.maps.agreement import evened, slope_and_fit
from elevon.logs.maps.column_map import (
    drive_columns,
    drive_unit,
    known_roles,
    known_signals,
    parameter_key,
)
from elevon.units import Unit, parse_unit

_TIME = re.compile(r"^(x?ms|x|t|t_?ms|t_?s|zeit.*|.*time.*|.*timestamp.*|seconds?|sec)$")
HINTS = packaged_toml("elevon.logs", "hints.toml")
_SUFFIXES: Mapping[str, str] = HINTS["suffixes"]
_PER_SECOND = frozenset({"mm", "cm", "m", "rad", "deg", "rev"})
_SPEED_UNITS = ("rad/s",)


@dataclass(slots=True)
class GuessedColumn:
    """A column: its role and its unit, where they are known, and why."""

    name: str
    role: str | None = None
    unit: str | None = None
    sign: int = 1
    scale: float = 1.0
    margin: float | None = None
    reasons: list[str] = field(default_factory=list)


def role_hint(header: str) -> str:
    """Return the role a header suggests; empty where it says nothing (``column_3``)."""
    text = plain_words(_without_unit(header))
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
    groups = {name for name, words in HINTS["words"].items() if re.search(words, text)}
    return next((role for role, *words in HINTS["rules"]["all"] if groups.issuperset(words)), "")


def unit_hint(header: str, stated: str) -> str:
    """Return the unit that a file states or a header's last word suggests; empty for none."""
    name = header.strip()
    tail = re.split(r"[_\s]+", name)[-1]
    if stated or ("/" in tail and tail != name):
        return _known_unit(drive_unit(stated or tail, _SPEED_UNITS))
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
EXPLAINED = 0.9  # of a position by the integral of its speed
PLACES = ("output_position", "motor_position")
_SPEEDS = ("output_speed", "motor_speed")


def _settle_unit(
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
    for place, unit in _stated(PLACES, table, columns):
        for rate, per_time in _stated(_SPEEDS, table, columns):
            if per_time.dimension != parse_unit(f"{unit.text}/s").dimension:
                continue
            slope, explained = slope_and_fit(np.cumsum(rate * steps), place)
            for name, scale in TIME_UNITS.items():
                if explained > EXPLAINED and abs(slope / scale - 1.0) < _NEAR:
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


def settle_time(table: RawTable, columns: Mapping[str, GuessedColumn]) -> Floats:
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
    _settle_unit(entry, table, columns)
    scale = TIME_UNITS.get(entry.unit or "", 1.0)
    return np.asarray(evened(table.columns[name]) * scale, dtype=np.float64)


def plain_words(header: str) -> str:
    """Return a header in lower case, in ASCII, with underlines between its words."""
    text = unicodedata.normalize("NFKD", header.replace("ß", "ss")).encode("ascii", "ignore")
    return re.sub(r"[^a-z0-9]+", "_", text.decode().lower()).strip("_")
