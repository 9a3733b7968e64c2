"""Which signal serves which role: the roles that features use, of those of the core."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache

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
