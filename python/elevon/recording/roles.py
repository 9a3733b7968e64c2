"""Which channel of a recording backlashes which role, whatever the channels are called.

A simulated recording has it from its wiring, a log from its column map: ``meta["roles"]``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from elevon.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from elevon.recording.channel import Channel
    from elevon.recording.recording import Recording


def roles_of(recording: Recording) -> dict[str, str]:
    """Return role to channel name, of the channels that are there."""
    stated: Any = recording.meta.get("roles")
    if not isinstance(stated, Mapping):
        return {}
    return {str(role): str(name) for role, name in stated.items() if name in recording}


def channel_of(recording: Recording, role: str) -> Channel:
    """Return the channel that has a role.

    Raises
    ------
    InputError
        None does; the message lists the roles that are played.
    """
    roles = roles_of(recording)
    if role not in roles:
        known = ", ".join(roles) or "none: say them in a column map"
        raise InputError(
            f"the recording has no {role!r}{did_you_mean(role, roles)}; roles: {known}"
        )
    return recording[roles[role]]
