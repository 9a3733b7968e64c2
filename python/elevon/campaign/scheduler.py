"""Whether a Dask scheduler answers at an address: asked before the library is, which waits long."""

from __future__ import annotations

import re
import socket
from threading import Thread

from elevon.errors import InputError

LIMIT = 10.0
"""Seconds within which a wrong address is reported, in all."""

_ADDRESS = re.compile(r"(?:(tcp|tls)://)?(\[[0-9A-Fa-f:.]+\]|[^\s/:\[\]]+):(\d{1,5})")

_GREETING = 2**16
"""Bytes of a scheduler's first message, at most; it has some 100."""


def check_scheduler(address: str) -> None:
    """Raise `InputError` where no Dask scheduler answers at an address, within half of `LIMIT`.

    A scheduler greets whoever connects: eight bytes with the length of its message, then the
    message. Whatever else listens there is silent, or sends what is no such length; the library
    would wait for the one and make room for the other. Behind ``tls://`` only the connection is
    tried.
    """
    parts = _ADDRESS.fullmatch(address)
    if parts is None or not 0 < int(parts[3]) < 2**16:
        raise InputError(
            f"--scheduler {address!r}: is no address; give tcp://HOST:PORT, such as "
            "tcp://localhost:8786"
        )
    tls = parts[1] == "tls"
    outcome: list[bytes | OSError | UnicodeError] = []
    place = (parts[2].strip("[]"), int(parts[3]))
    # In a thread of its own: to look up a name may take longer than any limit of a connection.
    probe = Thread(target=lambda: outcome.append(_probed(place, tls=tls)), daemon=True)
    probe.start()
    probe.join(LIMIT / 2.0)
    answer = outcome[0] if outcome else TimeoutError()
    if isinstance(answer, TimeoutError):
        raise InputError(f"--scheduler {address}: no scheduler answers within {LIMIT / 2.0:g} s")
    if isinstance(answer, (OSError, UnicodeError)):
        why = getattr(answer, "strerror", None) or answer
        raise InputError(f"--scheduler {address}: no scheduler answers: {why}")
    length = int.from_bytes(answer, "little")
    if not tls and (len(answer) < 8 or not 0 < length < _GREETING):
        raise InputError(f"--scheduler {address}: what answers there is no Dask scheduler")


def _probed(place: tuple[str, int], *, tls: bool) -> bytes | OSError | UnicodeError:
    """Return the first bytes of whoever listens at a place, or the error."""
    try:
        with socket.create_connection(place, timeout=LIMIT / 4.0) as peer:
            return b"" if tls else _first(peer)
    except (OSError, UnicodeError) as error:
        return error


def _first(peer: socket.socket) -> bytes:
    """Return the first eight bytes of a peer, fewer where it closes."""
    data = b""
    while len(data) < 8:
        more = peer.recv(8 - len(data))
        if not more:
            break
        data += more
    return data
