"""A log of a screw's servo: its channels by role, smoothed alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.role_log import CalibrationRoleLog, role_channels
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.recording import Recording

__all__ = [
    "CORNERS",
    "ScrewLog",
    "balanced",
    "motor_ratio",
    "preloaded",
    "screw_log",
    "slope",
    "smoothed",
]

Bools = npt.NDArray[np.bool_]
_NEEDED = ("torque_current",)
#: What shows the motor's speed, the best first.
MOTION = ("motor_speed", "motor_position", "output_speed", "output_position")
_LOAD = ("load", "load_cell")
_WIDTH = 0.05  # s of the polynomials that smooth all channels alike
#: Eighth order, in the order in which a convolution takes it.
_STENCIL = np.array([-3, 32, -168, 672, 0, -672, 168, -32, 3]) / 840.0
_SLOPES = {"acceleration": "motor_speed", "current_slope": "torque_current"}
_SLOWEST = 0.01  # s between samples, from which a log shows temperatures only
_MOVES = 0.05  # of the largest speed: below it the friction's sign is open
CORNERS = (
    0.06,
    0.1,
)  # s about a reversal or a limit that do not count; the second is a choice as good
_LIMIT = 0.98  # of the largest set point of the current: the drive is limited


@dataclass(frozen=True)
class ScrewLog(CalibrationRoleLog):
    """A log on the clock of the motor's speed."""

    @property
    def quick(self) -> bool:
        """Whether the motion is sampled quickly enough for balances."""
        return self.period < _SLOWEST

    @property
    def loaded(self) -> bool:
        """Whether the force on the ram was measured."""
        return any(role in self.roles for role in _LOAD)

    @cached_property
    def smooth(self) -> dict[str, Floats]:
        """All channels, and slopes of speed, position and current, through one smoother."""
        slopes = {
            name: slope(self.roles[role], self.period)
            for name, role in _SLOPES.items()
            if role in self.roles
        }
        channels = {**self.roles, **slopes}
        return {role: smoothed(values, self.period) for role, values in channels.items()}

    @cached_property
    def moving(self) -> Bools:
        """Samples that count in a balance: in motion, apart from reversals and limits."""
        return self.apart(CORNERS[0])

    def apart(self, corner: float) -> Bools:
        """Return the samples in motion, so long apart from reversals and limits."""
        speed = self.smooth["motor_speed"]
        away = np.abs(speed) < _MOVES * float(np.max(np.abs(speed)))
        if "current_ref" in self.roles:
            size = np.abs(self.roles["current_ref"])
            top = float(np.max(size))
            away |= (size > _LIMIT * top) & (np.median(size) < 0.5 * top)
        width = 2 * round(corner / self.period) + 1
        near = np.convolve(away.astype(float), np.ones(width), mode="same") > 0.5
        edge = (self.time < _WIDTH) | (self.time > self.time[-1] - _WIDTH)
        return np.asarray(~near & ~edge)


def smoothed(values: Floats, period: float) -> Floats:
    """Values through the polynomials that smooth all channels alike."""
    from scipy.signal import savgol_filter

    width = max(5, 2 * round(0.5 * _WIDTH / period) + 1)
    return np.asarray(savgol_filter(values, width, 3), dtype=np.float64)


def slope(values: Floats, period: float) -> Floats:
    """Slope by central differences of eighth order: in a balance it is smoothed like the rest.

    The slope of a polynomial through the smoother's window is smoothed more than the values are:
    at the corners of a trapezoid that made masses 10 % too large.
    """
    padded = np.pad(values, 4, mode="edge")
    return np.asarray(np.convolve(padded, _STENCIL / period, mode="valid"), dtype=np.float64)


def screw_log(recording: Recording, name: str, ratio: float) -> ScrewLog:
    """Return what the calibration needs of a recording, by the roles it states.

    Parameters
    ----------
    recording : Recording
        With the role ``torque_current`` and one of the motion's.
    name : str
        Of the log.
    ratio : float
        Motor angle over the ram's travel [rad/m]: a log without the motor's speed has it from what
        else it shows of the motion.

    Raises
    ------
    InputError
        No torque current, nothing of the motion, or a log that is too short.
    """
    parts = role_channels(recording, name, _NEEDED)
    roles, time = parts["roles"], parts["time"]
    motion = next((role for role in MOTION if role in roles), None)
    if motion is None:
        raise InputError(f"{name}: nothing of the motion was recorded; one of {', '.join(MOTION)}")
    if motion != "motor_speed":
        scale = 1.0 if motion == "motor_position" else ratio
        speed = np.gradient(roles[motion], time) if motion.endswith("position") else roles[motion]
        roles["motor_speed"] = scale * speed
    return ScrewLog(**parts)


def motor_ratio(actuator: Actuator) -> float:
    """Return the motor's angle over the ram's travel, rad/m."""
    value = actuator.parameters.value
    return value("gear.ratio") / value("screw.lead")


def preloaded(actuator: Actuator) -> bool:
    """Whether the actuator has a preloaded screw with an efficiency in each direction."""
    from elevon.parameters.records import records

    return {"screw.preload", "screw.efficiency_aiding"} <= records(actuator.wiring).keys()


def balanced(recordings: Sequence[Recording]) -> bool:
    """Whether the balances suit: torque, motion and load in every log."""
    return all(
        set(_NEEDED) <= set(recording.roles)
        and any(role in recording.roles for role in MOTION)
        and any(role in recording.roles for role in _LOAD)
        for recording in recordings
    )
