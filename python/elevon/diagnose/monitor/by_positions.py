"""Windows of a turning servo, read by its positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.diagnose.engine.replay import Replay, replay
from elevon.diagnose.engine.table import FeatureVector
from elevon.diagnose.monitor.cutter import CutWindow, WindowCutter
from elevon.diagnose.monitor.windows import NO_MOTION, OTHER, Day, Windows, apart, stretch, usable
from elevon.diagnose.positions.log import RUN_IN, noted_command
from elevon.diagnose.positions.reading import PositionReading, logged_features
from elevon.errors import InputError
from elevon.logs.drive import drive_channels, drive_log

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.candidates import CandidateFault
    from elevon.logs.log import Log

_LEAST = 400  # samples of a window that may be used
_MOVING = 0.1  # of the highest speed
_MODELLED = 20.0  # s of a baseline that the model runs
#: Without these, and one of the currents, a stream cannot be watched.
NEEDED = ("speed_ref", "motor_speed", "motor_position", "output_position")
CURRENTS = ("torque_current", "current_ref")  # the measured one first
#: All that is read of a stream. ``brake_torque``: on the motor's shaft [N m], as a baseline's load
#: cell gives it.
ROLES = (*NEEDED, *CURRENTS, "torque_voltage", "brake_torque")


class PositionWindows(Windows):
    """Windows of a turning servo; from day to day and window to window its features' own spread.

    Parameters
    ----------
    actuator : Actuator
        The healthy unit.
    baselines : sequence of Log
        Of it.
    window : float, optional
        Width [s]; default: the period of a noted sine.
    """

    def __init__(
        self, actuator: Actuator, baselines: Sequence[Log], window: float | None = None
    ) -> None:
        self.actuator, self.roles = actuator, ROLES
        self.baselines = [drive_log(log) for log in baselines]
        first = self.baselines[0]
        self.width = _period(first, window)
        self._motion = _motion(first)
        self._top = float(np.nanmax(np.where(first.good, np.abs(first.speed), 0.0), initial=0.0))

    def ready(self, log: Log) -> Log:
        """Return a log as it is fed."""
        return drive_channels(log)

    def watched(self, name: str, roles: Sequence[str]) -> tuple[str, ...]:
        """Return those roles of a day that are watched."""
        missing = [role for role in NEEDED if role not in roles]
        if not any(role in roles for role in CURRENTS):
            missing.append(" or ".join(CURRENTS))
        if missing:
            raise InputError(
                f"{name}: no channel has the role {', '.join(missing)}; watching needs both "
                "positions, speed, its set point and a torque current; roles: "
                f"{', '.join(roles) or 'none'}"
            )
        return tuple(role for role in ROLES if role in roles)

    def cutter(self, day: Day) -> WindowCutter:
        """Return what cuts a day."""
        current = next(role for role in CURRENTS if role in day.roles)
        speed = day.roles.index("motor_speed")
        needed = day.at(*NEEDED, current)
        return WindowCutter(self.width, RUN_IN, _MOVING * self._top, speed, needed)

    def read(self, day: Day, window: CutWindow, *, any_motion: bool = False) -> FeatureVector | str:
        """Return the features of a window, or why it is not used."""
        if not usable(window, _LEAST):
            return NO_MOTION
        log = drive_log(day.log(window))
        if not any_motion and apart(_motion(log), self._motion):
            return OTHER
        return self._features(log) or NO_MOTION

    def _features(self, log: Log) -> FeatureVector | None:
        """Return the features; None where it does not move both ways or lacks samples."""
        if not log.has("output_position", "motor_position"):
            raise InputError(f"{log.name}: watching needs both positions")
        good = log.good & np.isfinite(log.motor) & np.isfinite(log.output)
        top = float(np.abs(log.speed[good]).max()) if good.any() else 0.0
        ways = [int((good & (way * log.speed > _MOVING * top)).sum()) for way in (1.0, -1.0)]
        if good.sum() < _LEAST or top < 1.0 or min(ways) < _LEAST // 4:
            return None
        noted = noted_command(log, self.actuator.parameters.value("control.speed_limit"))
        gain = None if noted is None else (noted.gain, noted.gain_std)
        return logged_features(replace(log, gain=gain, good=good), self.actuator)

    def model(self, candidates: Sequence[CandidateFault]) -> Replay:
        """Return what the model shows in a window, healthy and with each fault."""
        reach = max(_MODELLED, 2.0 * self.width) + RUN_IN
        return replay(
            PositionReading(stretch(self.baselines[0], 0.0, reach), self.actuator), candidates
        )


def _period(log: Log, window: float | None) -> float:
    """Return the width of a window [s]: the one given, or one period of a noted sine."""
    if window is not None:
        return window
    note = log.note
    frequency = note.parameters.get("frequency", 0.0) if note is not None else 0.0
    if note is None or note.waveform != "sine" or not frequency > 0.0:
        raise InputError(
            f"{log.name}: its note names no sine, so the window must be given: one period of the "
            "motion, or a whole number of them; a motion that does not repeat (a chirp, a brake on "
            "a ramp) is not watched: elevon diagnose takes such a log as a whole"
        )
    return 1.0 / frequency


def _motion(log: Log) -> tuple[float, float, float]:
    """Return what tells one motion from another: spread of position, RMS speed, brake's mean."""
    brake = float(np.mean(log.brake.level)) if log.brake.measured and len(log.brake.level) else 0.0
    speed = float(np.sqrt(np.nanmean(log.speed**2)))
    return float(np.nanstd(log.output)), speed, brake
