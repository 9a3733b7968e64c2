"""Who may speak to the bench: the page's own origin, a token where the network can reach it."""

from __future__ import annotations

import hmac
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import urlsplit

from elevon.documents import check_depth
from elevon.errors import InputError

MOST_BYTES = 64 * 1024
"""Of a message."""
_LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})

#: Nothing from elsewhere, no inline script; styles of its own sheet.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


@dataclass(frozen=True)
class Guard:
    """The rules of one server.

    Attributes
    ----------
    host : str
        Address it listens on.
    token : str
        Asked for where that is not loopback; empty: none.
    """

    host: str = "127.0.0.1"
    token: str = ""

    @property
    def local(self) -> bool:
        """Whether only this machine reaches it."""
        return self.host in _LOOPBACK

    def refuses(self, headers: Mapping[str, str], token: str) -> str | None:
        """Return why a request is refused; None where it is not.

        A page of another site may send requests to this machine: the browser names its origin, and
        the name it used for this server.
        """
        host = headers.get("host", "")
        name = urlsplit(f"//{host}").hostname or ""
        if self.local and name not in _LOOPBACK:
            return f"host {host!r:.60} is not this machine"
        origin = headers.get("origin")
        if origin is not None and urlsplit(origin).netloc != host:
            return f"origin {origin!r:.60} is not this page"
        if self.token and not hmac.compare_digest(token.encode(), self.token.encode()):
            return "the token is missing or wrong"
        return None


def message_of(text: str | bytes) -> dict[str, object]:
    """Read one JSON object.

    Raises
    ------
    InputError
        Longer than 64 KiB, no JSON, no object, NaN, nested too deeply.
    """
    if len(text) > MOST_BYTES:
        raise InputError(f"a message of {len(text)} bytes; at most {MOST_BYTES}")
    try:
        read = json.loads(
            text,
            parse_constant=_refused,
            parse_float=_finite,
            parse_int=lambda digits: int(_short(digits)),
        )
    except (ValueError, RecursionError) as error:
        raise InputError(f"no JSON: {str(error)[:80]}") from error
    if not isinstance(read, dict):
        raise InputError(f"a JSON object is expected, not {type(read).__name__}")
    check_depth(read, "message")
    return read


def _refused(name: str) -> float:
    raise ValueError(f"{name} is no number")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:20]} is beyond floats")
    return value


def _short(digits: str) -> str:
    if len(digits) > 18:
        raise ValueError(f"{digits[:20]}... is too long a whole number")
    return digits
