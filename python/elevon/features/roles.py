"""Which signal serves which role."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from elevon.errors import unknown

__all__ = ["ROLES", "assign_roles", "comparable"]

#: Signals that serve each role where the wiring or the log's column map does not say it: the first
#: that is there, what a sensor shows before what is true.
ROLES: Mapping[str, tuple[str, ...]] = {
    "command": ("command",),
    "output_position": ("encoder_position", "user_position"),
    "motor_position": ("resolver_position", "motor_position"),
    "motor_speed": ("resolver_speed", "speed_meas", "motor_speed"),
    "torque_current": ("current_q_meas", "current_q", "current_line", "current_ref"),
    "current_a": ("current_a_meas", "current_a"),
    "current_b": ("current_b_meas", "current_b"),
    "current_c": ("current_c_meas", "current_c"),
    "temperature": ("winding_temperature",),
    "leg_transitions": ("leg_transitions",),
    "vibration": ("vibration",),
}


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
        Role to signal, as the wiring or the log's column map says: else the first of `ROLES`.

    Raises
    ------
    UnknownNameError
        A role or a signal that is not there.
    """
    there = list(names)
    roles = {}
    for role, usual in ROLES.items():
        candidates = [(stated or {}).get(role), *usual]
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
    kept = dict(roles)
    command, output = roles.get("command"), roles.get("output_position")
    if command and output and units[command] != units[output]:
        del kept["command"]
    return kept
