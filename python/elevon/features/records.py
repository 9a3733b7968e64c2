"""The catalogue of features, as the core has it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache

from elevon import _core
from elevon.errors import unknown

#: The roles that features are made of, in the order of the core.
ROLES: tuple[str, ...] = tuple(record["name"] for record in _core.feature_roles())


@cache
def players(role: str) -> tuple[str, ...]:
    """Return the signals that have a role in any wiring, what a sensor shows before what is true.

    They serve where neither the wiring nor a log's column map states its roles.
    """
    # sensors stand behind what they sense
    names = [
        signal["name"]
        for wiring in _core.wirings()
        for fidelity in wiring["fidelities"]
        for signal in reversed(_core.signals(wiring["name"], fidelity))
        if signal["role"] == role
    ]
    return tuple(dict.fromkeys(names))


def assign_roles(
    names: Iterable[str],
    given: Mapping[str, str] | None = None,
    stated: Mapping[str, str] | None = None,
) -> dict[str, str]:
    """Return the signal that serves each role, for the roles that have one.

    Parameters
    ----------
    names : iterable of str
        Signals that are there.
    given : mapping of str to str, optional
        Role to signal, as the caller says.
    stated : mapping of str to str, optional
        Role to signal, as the wiring or the log's column map says: else the first of `players`.

    Raises
    ------
    UnknownNameError
        A role or a signal that is not there.
    """
    there = list(names)
    roles = {}
    for role in ROLES:
        candidates = [(stated or {}).get(role), *players(role)]
        chosen = next((name for name in candidates if name in there), None)
        if chosen is not None:
            roles[role] = chosen
    for role, name in (given or {}).items():
        if role not in ROLES:
            raise unknown("role", role, ROLES, "roles")
        if name not in there:
            raise unknown("signal", name, there, f"roles: {role}")
        roles[role] = name
    return roles


def comparable(roles: Mapping[str, str], units: Mapping[str, str]) -> dict[str, str]:
    """Leave out a command that is of another kind than the output: there is no error to track."""
    result = dict(roles)
    command, output = roles.get("command"), roles.get("output_position")
    if command and output and units[command] != units[output]:
        del result["command"]
    return result


#: Stands for every feature that the columns and the rate allow.
ALL = "all"


@dataclass(frozen=True)
class FeatureRecord:
    """One feature.

    Attributes
    ----------
    name, text : str
        Name and definition.
    unit : str
        SI; ``{role}`` stands for the unit of that role's column.
    family : str
        Features that are summed up together; a family's name stands for all of them.
    roles : tuple of str
        The columns it needs.
    minimum_rate : float
        Hz; 0 where any rate will do.
    """

    name: str
    unit: str
    text: str
    family: str
    roles: tuple[str, ...]
    minimum_rate: float

    def unit_of(self, units: Mapping[str, str]) -> str:
        """Return the unit, given that of each role's column."""
        text = re.sub(r"\{(\w+)\}", lambda match: units[match[1]], self.unit)
        return "1" if text == "1 rad" else text


@lru_cache(maxsize=1)
def feature_records() -> Mapping[str, FeatureRecord]:
    """Return every feature by name, in the order in which they are listed."""
    from elevon import _core

    return {
        item["name"]: FeatureRecord(**{**item, "roles": tuple(item["roles"])})
        for item in _core.feature_records()
    }


def families() -> list[str]:
    """Return the names of the families."""
    return list(dict.fromkeys(record.family for record in feature_records().values()))


def wanted_records(
    names: Iterable[str], roles: Iterable[str], rate: float, place: str
) -> tuple[list[FeatureRecord], list[str]]:
    """Return the features that names, families or ``all`` stand for.

    Parameters
    ----------
    names : iterable of str
        Features, families, or ``all``.
    roles : iterable of str
        Those that have a column.
    rate : float
        Hz.
    place : str
        For errors.

    Returns
    -------
    list of FeatureRecord, list of str
        In the order given, each once; and the names of those given that cannot be. A
        feature of a family, or of ``all``, that lacks a column or the rate is left out.

    Raises
    ------
    UnknownNameError
        No such feature or family.
    """
    known, groups, there = feature_records(), families(), set(roles)
    chosen: dict[str, FeatureRecord] = {}
    lacking: list[str] = []
    for name in names:
        if name in known:
            group = [known[name]]
        elif name == ALL or name in groups:
            group = [r for r in known.values() if name in (ALL, r.family)]
        else:
            raise unknown("feature", name, [*known, *groups, ALL], place)
        able = [r for r in group if there.issuperset(r.roles) and rate >= r.minimum_rate]
        chosen.update((r.name, r) for r in able)
        if not able:
            lacking.append(name)
    return list(chosen.values()), lacking
