"""Acts that a bench does by itself, each at its instant."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from elevon.errors import ArgumentTypeError, ElevonError, InputError, unknown

_SLACK = 1e-6  # s: instants are whole samples, written in decimals


@dataclass
class Script:
    """Steps as a journal holds them.

    Attributes
    ----------
    mode : str
        Of the command at the start; empty: as it is.
    steps : deque of (float, mapping)
        Instant from the start [s], and what is done.
    error : str
        Why it ended before its last step.
    """

    mode: str = ""
    steps: deque[tuple[float, dict[str, Any]]] = field(default_factory=deque)
    error: str = ""
    _begun: float | None = None

    @classmethod
    def read(cls, given: object, known: Sequence[str]) -> Script:
        """Read steps, times rising.

        Raises
        ------
        InputError
            No list of tables, a time that is none or falls, an act that is not known.
        """
        if not isinstance(given, list) or not all(isinstance(step, Mapping) for step in given):
            raise ArgumentTypeError(f"repeat: {given!r:.60} is no list of steps")
        script = cls()
        for number, step in enumerate(given):
            acts = dict(step)
            time, mode = acts.pop("time", None), acts.pop("mode", "")
            last = script.steps[-1][0] if script.steps else 0.0
            if isinstance(time, bool) or not isinstance(time, (int, float)) or time < last:
                raise InputError(f"repeat: step {number}: time = {time!r:.20}: must rise from 0 s")
            for key in acts:
                if key not in known or key == "repeat":
                    raise unknown("key", key, known, f"repeat: step {number}")
            script.mode = script.mode or str(mode)
            script.steps.append((float(time), acts))
        return script

    def due(self, now: float, act: Callable[[Mapping[str, object]], object]) -> None:
        """Do the steps whose instant has come; the first call is the start."""
        self._begun = now if self._begun is None else self._begun
        while self.steps and self.steps[0][0] <= now - self._begun + _SLACK:
            try:
                act(self.steps.popleft()[1])
            except ElevonError as error:
                self.error = str(error)
                self.steps.clear()

    def to_dict(self) -> dict[str, object]:
        """Return how it stands."""
        return {"left": len(self.steps), "error": self.error}
