"""A log as the balances need it: on the clock of what they balance, with the motor's speed."""

from __future__ import annotations

import math

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.logs.log import Log
from elevon.recording import Recording

_FEWEST = 100  # samples
#: Friction per torque of the motor, where the law of friction knows of it; the laws that do not.
LOAD_SHARE, LAWS_WITHOUT_LOAD = "friction.load_motor", ("borello", "stribeck")
#: Share of the highest speed over which friction falls from rest to motion. ASSUMED: no log at
#: 100 Hz settles it; half and twice as much are part of the intervals of a fit in closed loop.
FALL = 0.02
#: What shows the motor's speed, the best first.
MOTION = ("motor_speed", "motor_position", "output_speed", "output_position")


def role_log(recording: Recording, name: str, actuator: Actuator) -> Log:
    """Return what the calibration needs of a recording, by the roles it states.

    The clock is that of the output's position for an actuator with a control unit of its own, of
    the torque current for a servo. A log without the motor's speed has it from what else it shows
    of the motion.

    Raises
    ------
    InputError
        A role that is needed is missing, nothing of the motion was recorded, or the log is too
        short.
    """
    servo = "control.position_gain" in actuator.parameters
    log = Log.of(recording, name, clock="torque_current" if servo else "output_position")
    if len(log.time) < _FEWEST:
        raise InputError(f"{name}: {len(log.time)} samples; at least {_FEWEST}")
    if log.has("motor_speed"):
        return log
    return log.with_channels(motor_speed=_speed(log, motor_ratio(actuator)))


def motor_ratio(actuator: Actuator) -> float:
    """Return the motor's angle over the output's coordinate, rad/rad or rad/m."""
    known, value = actuator.parameters, actuator.parameters.value
    stages = ("gear.ratio",) if "gear.ratio" in known else ("gear.ratio_first", "gear.ratio_second")
    lead = value("screw.lead") if "screw.lead" in known else 1.0
    return math.prod(value(path) for path in stages) / lead


def grows_with_torque(top_speed: float) -> dict[str, str | float]:
    """Return the choices with which friction grows with the motor's torque alone.

    Parameters
    ----------
    top_speed : float
        Highest of the logs [rad/s].
    """
    return {
        "friction.law": "load_dependent", "friction.stribeck_speed": FALL * top_speed,
        "friction.load_external": 0.0, "friction.load_motor_stribeck": 0.0,
        "friction.load_external_stribeck": 0.0,
    }  # fmt: skip


def geared(actuator: Actuator) -> bool:
    """Return whether the motor's torque passes a gear or a screw, which may lose a share of it."""
    return motor_ratio(actuator) != 1.0


def _speed(log: Log, ratio: float) -> Floats:
    """Motor's speed from what else was recorded of the motion, the best first."""
    motion = next((role for role in MOTION[1:] if log.has(role)), None)
    if motion is None:
        one = ", ".join(MOTION)
        raise InputError(f"{log.name}: nothing of the motion was recorded; one of {one}")
    values = np.gradient(log[motion], log.time) if motion.endswith("position") else log[motion]
    return np.asarray((1.0 if motion == "motor_position" else ratio) * values)
