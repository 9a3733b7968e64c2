"""The signals a log may hold: their roles, their SI units, the shaft they are referred to."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from elevon.data import packaged_toml
from elevon.errors import InputError
from elevon.units import parse_unit


@dataclass(frozen=True, slots=True)
class LogSignal:
    """A signal's SI units, its own shaft (``fast``, ``slow`` or none) and what it is.

    `scaled` says how a value on the motor shaft becomes one on the slow shaft: ``angle`` divides by
    the gear ratio, ``torque`` multiplies. `drive_current`: the drive may log it as rms.
    """

    units: tuple[str, ...]
    shaft: str = ""
    scaled: str = ""
    drive_current: bool = False
    role: str = ""


_TABLES = packaged_toml("elevon.logs", "hints.toml")
_TORQUES = ("motor_torque", "brake_torque", "load_torque")  # on the motor shaft
_OF_THE_DRIVE = ("current_ref", "torque_current", "direct_current", "torque_voltage")


@lru_cache(maxsize=1)
def known_roles() -> Mapping[str, LogSignal]:
    """Return what a signal in each role is; ``time`` among them."""
    from elevon import _core

    roles = {
        role["name"]: LogSignal(
            tuple(role["units"]),
            _TABLES["shafts"].get(role["name"], ""),
            "angle" if role["name"] in _TABLES["shafts"] else "",
            role["name"] in _OF_THE_DRIVE,
            role["name"],
        )
        for role in _core.roles()
    }
    return {"time": LogSignal(("s",)), **roles}


@lru_cache(maxsize=1)
def known_signals() -> Mapping[str, LogSignal]:
    """Return every signal that a wiring can record or a log may hold, by its channel's name."""
    from elevon import _core

    roles, known = known_roles(), {"time": LogSignal(("s",))}
    for wiring in _core.wirings():
        for fidelity in wiring["fidelities"]:
            for item in _core.signals(wiring["name"], fidelity):
                torque = ("fast", "torque") if item["name"] in _TORQUES else ("", "")
                plain = LogSignal((item["unit"] or "1",), *torque)
                known.setdefault(item["name"], roles.get(item["role"] or "", plain))
    return known | {name: roles[role] for name, role in _TABLES["of_logs"].items()}


def unit_among(units: tuple[str, ...], stated: str | None, place: str) -> str:
    """Return the SI unit, of those a signal may have, that a stated unit is of; the first if none.

    Raises
    ------
    InputError
        A unit of another kind, or none that is known.
    """
    if not stated:
        return units[0]
    dimension = parse_unit(stated, place).dimension
    for unit in units:
        if parse_unit(unit).dimension == dimension:
            return unit
    raise InputError(f"{place}: unit {stated!r}; expected {' or '.join(units)}, or the like")


def safe_name(foreign: str, used: set[str]) -> str:
    """Return a channel name for a foreign column: ASCII, at most 31 characters, not yet used."""
    text = re.sub(r"[^A-Za-z0-9]+", "_", foreign).strip("_") or "column"
    text = text if text[0].isalpha() else f"column_{text}"
    stem = f"extra_{text}"[:27].rstrip("_")
    name, number = stem, 2
    while name.lower() in {other.lower() for other in used}:
        name, number = f"{stem}_{number}", number + 1
    return name
