"""What the header of a column suggests: a role and a unit, never more than a suggestion."""

from __future__ import annotations

import re
from collections.abc import Callable

from elevon.errors import InputError
from elevon.logs.maps.columns import drive_columns, parameter_key
from elevon.logs.maps.signals import known_roles, known_signals
from elevon.units import parse_unit

_TIME = re.compile(r"^(x?ms|x|t|t_?ms|t_?s|zeit.*|.*time.*|.*timestamp.*|seconds?|sec)$")
_WANTED = re.compile(r"demand|command|cmd|set_?p|setpoint|target|desired|ref|soll|_set$|_dem$|_sp$")
_MOTOR = re.compile(r"motor|resolver|fast|rotor|_m$|^m_")
_SPEED = re.compile(r"speed|veloc|rpm|omega|drehzahl|^n$|^v$|^w$|_vel|geschw")
_CURRENT = re.compile(r"curr|amp(ere)?s?$|^i$|^i_?[abcdq]\b|^i_?(q|d)|strom|_i$")
_VOLTAGE = re.compile(r"volt|^u$|^u_|spannung|vbus|v_?dc")
_TEMPERATURE = re.compile(r"temp|thermo")
_FORCE = re.compile(r"force|load|kraft|torque|cell|moment")
_VIBRATION = re.compile(r"acc|vib")
_POSITION = re.compile(
    r"pos|angle|displ|stroke|travel|encoder|resolver|lvdt|^x$|^s$|weg|lage|actual"
)
_SUPPLY = re.compile(r"supply|bus|link|dc|source|batt")
_PHASE = re.compile(r"(?:^|_|phase)([abc])(?:$|_)")
_SUFFIXES = {
    "mm": "mm", "cm": "cm", "um": "um", "m": "m", "ms": "ms", "us": "us", "s": "s", "sec": "s",
    "deg": "deg", "rad": "rad", "rev": "rev", "rpm": "rpm", "a": "A", "ma": "mA", "v": "V",
    "n": "N", "kn": "kN", "nm": "N m", "degc": "degC", "mms": "mm/s", "mmps": "mm/s",
    "rads": "rad/s", "radps": "rad/s", "kgf": "kgf", "hz": "Hz",
}  # fmt: skip
#: What stands before a last word `s` and makes a speed of it: ``speed_mm_s``.
_PER_SECOND = frozenset({"mm", "cm", "m", "rad", "deg", "rev"})


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
    wanted = bool(_WANTED.search(text))
    for words, role in _KINDS:
        if words.search(text):
            return role(text, wanted)
    return "command" if wanted else ""


def _voltage(text: str, _wanted: bool) -> str:
    return "supply_voltage" if _SUPPLY.search(text) else "torque_voltage"


def _speed(_text: str, wanted: bool) -> str:
    return "speed_ref" if wanted else "motor_speed"


def _position(text: str, wanted: bool) -> str:
    if wanted:
        return "command"
    return "motor_position" if _MOTOR.search(text) else "output_position"


def _current(text: str, wanted: bool) -> str:
    if wanted:
        return "current_ref"
    if _SUPPLY.search(text):
        return "supply_current"
    phase = _PHASE.search(text)
    if phase is not None:
        return f"current_{phase.group(1)}"
    return "direct_current" if re.search(r"i_?d(_|$)|direct|field", text) else "torque_current"


#: Words of a header and what they suggest, the first that stand in it.
_KINDS: tuple[tuple[re.Pattern[str], Callable[[str, bool], str]], ...] = (
    (_TEMPERATURE, lambda _text, _wanted: "temperature"),
    (_CURRENT, _current),
    (_VOLTAGE, _voltage),
    (_SPEED, _speed),
    (_POSITION, _position),
    (_FORCE, lambda _text, _wanted: "load_cell"),
    (_VIBRATION, lambda _text, _wanted: "vibration"),
)


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
