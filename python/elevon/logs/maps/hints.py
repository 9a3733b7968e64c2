"""What the header of a column suggests: a role and a unit, never more than a suggestion."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from elevon.data import packaged_toml
from elevon.errors import InputError
from elevon.logs.maps.columns import drive_columns, parameter_key
from elevon.logs.maps.signals import known_roles, known_signals
from elevon.units import parse_unit

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
