"""Who moves the bench: one viewer at a time, and programs on this machine where none does."""

from __future__ import annotations

import secrets
import time as clock
from threading import Lock

from elevon.errors import ElevonError

_IDLE = 60.0  # s after which another viewer may take over


class ControlError(ElevonError):
    """Somebody else has the bench."""

    exit_code = 2


class Control:
    """The viewers that are connected, and which of them has control."""

    def __init__(self) -> None:
        self._viewers: set[str] = set()
        self._holder = ""
        self._last = 0.0
        self._lock = Lock()

    @property
    def holder(self) -> str:
        """The viewer in control; empty: none."""
        return self._holder

    @property
    def viewers(self) -> int:
        """How many are connected."""
        return len(self._viewers)

    def join(self) -> str:
        """Return the name of a new viewer."""
        name = secrets.token_urlsafe(9)
        with self._lock:
            self._viewers.add(name)
        return name

    def leave(self, name: str) -> None:
        """Forget a viewer; what it held is free."""
        with self._lock:
            self._viewers.discard(name)
            if self._holder == name:
                self._holder = ""

    def release(self, name: str) -> None:
        """Give control up."""
        with self._lock:
            if self._holder == name:
                self._holder = ""

    def claim(self, name: str) -> None:
        """Take control where nobody has it, or has not used it for a minute.

        Parameters
        ----------
        name : str
            A viewer; empty or unknown: a program, which acts where no viewer has control and holds
            nothing.

        Raises
        ------
        ControlError
            A viewer has it.
        """
        with self._lock:
            now = clock.monotonic()
            busy = bool(self._holder) and now - self._last < _IDLE
            if self._holder and self._holder != name and (busy or name not in self._viewers):
                raise ControlError("another viewer has control; it is free when that one leaves")
            if name in self._viewers:
                self._holder, self._last = name, now
