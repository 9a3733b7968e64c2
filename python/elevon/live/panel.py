"""The real bench's watch table: enable, home, move, stop, reset, and what must come before what.

Test-bench thesis of the Politecnico di Torino, figures 43 to 45: parameters of the command are
submitted, the axis is enabled and homed, `move_pos_abs` runs the command and stops it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from elevon.errors import InputError, unknown

if TYPE_CHECKING:
    from elevon.live.unit import LiveUnit


ACTIONS = ("enable", "disable", "home", "move", "stop", "reset")
_HOME = 2.0  # s that homing takes. ASSUMED: slow against every actuator's speed limit


@dataclass
class WatchTable:
    """The switches of the bench.

    Attributes
    ----------
    enabled, homed, moving : bool
        As in the thesis' watch table.
    block : mapping
        The command that was submitted and that `move` runs.
    """

    enabled: bool = False
    homed: bool = False
    moving: bool = False
    block: Mapping[str, Any] = field(default_factory=dict)
    _home_at: float | None = None

    def refresh(self, unit: LiveUnit) -> None:
        """Update the switches after an event: homing that has ended, an error."""
        if unit.status[0] != "ok":
            self.enabled = self.homed = self.moving = False
            self._home_at = None
        if self._home_at is not None and unit.time >= self._home_at:
            self.homed, self._home_at = True, None

    def to_dict(self) -> dict[str, object]:
        """Return the switches for display."""
        return {
            "enabled": self.enabled,
            "homed": self.homed,
            "homing": self._home_at is not None,
            "moving": self.moving,
            "block": dict(self.block),
        }

    def run(self, unit: LiveUnit, command: Mapping[str, object]) -> None:
        """Run a command at once, the switches as an operator would have set them."""
        unit.command(command)
        self.block = dict(command)
        self.enabled = self.homed = self.moving = True
        self._home_at = None

    def submit(self, unit: LiveUnit, command: Mapping[str, object]) -> None:
        """Keep a command for `move`; one that runs already is replaced."""
        unit.check_command(command)
        self.block = dict(command)
        if self.moving:
            unit.command(command)

    def act(self, unit: LiveUnit, action: str) -> None:
        """Operate a switch.

        Raises
        ------
        InputError
            An interlock; the message says what must come first.
        """
        if action not in ACTIONS:
            raise unknown("action", action, ACTIONS, "panel")
        self.refresh(unit)
        if unit.status[0] != "ok" and action != "reset":
            raise InputError(f"panel: {action}: the drive reports {unit.status[0]}: reset first")
        getattr(self, f"_{action}")(unit)

    def _enable(self, unit: LiveUnit) -> None:
        if not self.enabled:
            unit.hold()
        self.enabled = True

    def _disable(self, unit: LiveUnit) -> None:
        self._stop(unit)
        self.enabled = self.homed = False
        self._home_at = None

    def _home(self, unit: LiveUnit) -> None:
        if not self.enabled:
            raise InputError("panel: home: the axis is not enabled: enable first")
        if self.moving:
            raise InputError("panel: home: a command runs: stop first")
        if unit.mode == "position":
            unit.ramp_home(_HOME)
            self.homed, self._home_at = False, unit.time + _HOME
        else:
            self.homed = True

    def _move(self, unit: LiveUnit) -> None:
        for switch, first in ((self.enabled, "enable"), (self.homed, "home")):
            if not switch:
                raise InputError(f"panel: move: {first} first")
        if not self.block:
            raise InputError("panel: move: no command was submitted")
        unit.command(self.block)
        self.moving = True

    def _stop(self, unit: LiveUnit) -> None:
        unit.hold()
        self.moving = False

    def _reset(self, unit: LiveUnit) -> None:
        if unit.status[0] != "ok":
            unit.restart()
        else:
            unit.hold()
        self.enabled = self.homed = self.moving = False
        self._home_at = None
