"""The signals a log may hold: their SI unit and the shaft they are referred to."""

from __future__ import annotations

import re
from dataclasses import dataclass

__all__ = ["SIGNALS", "LogSignal", "safe_name"]


@dataclass(frozen=True, slots=True)
class LogSignal:
    """A signal's SI unit, its own shaft (``fast``, ``slow`` or none) and whether it is electrical.

    `scaled` tells how a value on the fast shaft becomes one on the slow shaft: ``angle`` divides by
    the gear ratio, ``torque`` multiplies.
    """

    unit: str
    shaft: str = ""
    scaled: str = ""
    drive_current: bool = False


_FAST_ANGLE = ("fast", "angle")
_SLOW_ANGLE = ("slow", "angle")

SIGNALS: dict[str, LogSignal] = {
    "command": LogSignal("rad", *_SLOW_ANGLE),
    "user_position": LogSignal("rad", *_SLOW_ANGLE),
    "encoder_position": LogSignal("rad", *_SLOW_ANGLE),
    "user_speed": LogSignal("rad/s", *_SLOW_ANGLE),
    "motor_position": LogSignal("rad", *_FAST_ANGLE),
    "resolver_position": LogSignal("rad", *_FAST_ANGLE),
    "motor_speed": LogSignal("rad/s", *_FAST_ANGLE),
    "speed_ref": LogSignal("rad/s", *_FAST_ANGLE),
    "current_ref": LogSignal("A", drive_current=True),
    "current_q_meas": LogSignal("A", drive_current=True),
    "current_d_meas": LogSignal("A", drive_current=True),
    "voltage_q_ref": LogSignal("V", drive_current=True),
    "current_a_meas": LogSignal("A"),
    "current_b_meas": LogSignal("A"),
    "current_c_meas": LogSignal("A"),
    "supply_voltage": LogSignal("V"),
    "winding_temperature": LogSignal("K"),
    "motor_torque": LogSignal("N m", "fast", "torque"),
    "brake_torque": LogSignal("N m", "fast", "torque"),
    "load_torque": LogSignal("N m", "fast", "torque"),
    "load_cell_force": LogSignal("N"),
    "load_cell_torque": LogSignal("N m"),
    "trigger": LogSignal("1"),
}


def safe_name(foreign: str, taken: set[str]) -> str:
    """Return a channel name for a foreign column: ASCII, at most 31 characters, not yet taken."""
    text = re.sub(r"[^A-Za-z0-9]+", "_", foreign).strip("_") or "column"
    text = text if text[0].isalpha() else f"column_{text}"
    stem = f"extra_{text}"[:27].rstrip("_")
    name, number = stem, 2
    while name.lower() in {other.lower() for other in taken}:
        name, number = f"{stem}_{number}", number + 1
    return name
