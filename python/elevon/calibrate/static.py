"""Static friction: which of two ways a log allows, and what neither of them sees.

A shaft that is held moves off at an instant, and the torque of that instant is the static friction
(`elevon.calibrate.breakaway`). A shaft on bristles creeps from the reversal on, and its friction is
followed through the creep (`elevon.calibrate.presliding`). How far the shaft deflects while the
torque turns decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.calibrate.breakaway import breakaway_torque, stuck_stretches
from elevon.calibrate.motion import motion_of
from elevon.calibrate.presliding import presliding_friction, reversals, usable_logs
from elevon.estimate.regression import Regression
from elevon.logs.log import Log

_FEWEST = 4  # reversals with a standstill
_STUCK = 0.02  # s of a standstill at least
_SLOW = 0.1  # of the dry friction: what it gives the shaft in a sample is a speed near rest
_LONG = (
    3.0  # of the motion in one sample near rest: a longer give is followed, a shorter one is none
)
#: ASSUMED: torque ripple of a switched drive, of the static friction. A shaft breaks away on the
#: ripple's top; a current that is filtered, or sampled in step with the drive, shows its middle. A
#: PWM of 10 kHz in the model: 5 %.
_RIPPLE = 0.06


@dataclass(frozen=True)
class StaticFriction:
    """Static friction.

    Attributes
    ----------
    value, std : float
        And its deviation [N m].
    degrees : float
        Degrees of freedom of the deviation.
    unseen : float
        What it may be higher by, whatever the log shows [N m].
    how : str
        How it was read.
    """

    value: float
    std: float
    degrees: float
    unseen: float
    how: str


def static_friction(
    logs: Sequence[Log], plant: Regression, constant: float
) -> StaticFriction | None:
    """Estimate static friction by the way that the logs allow.

    Parameters
    ----------
    logs : sequence of Log
        With the motor's angle; those whose brake acted unmeasured are passed over.
    plant : Regression
        The torque balance.
    constant : float
        Torque constant [N m/A].

    Returns
    -------
    StaticFriction or None
        None with fewer than four reversals, or breakaways.
    """
    slow = _SLOW * plant["dry"] / plant["inertia"] * max(log.period for log in logs)
    if not slow > 0.0:
        return None
    if _gives(logs, plant, slow):
        creep = presliding_friction(logs, plant, constant)
        if creep is None:
            return None
        how = (
            "peak of the friction that the creep before sliding shows; the shaft deflects as "
            f"bristles of {creep.stiffness:.2g} N m/rad, and how friction falls from there is open"
        )
        return StaticFriction(creep.static, creep.std, creep.degrees, 0.0, how)
    offset = plant["offset" if "offset" in plant.names else "constant"]
    torque_level = breakaway_torque(
        logs, constant=constant, offset=offset, lag=plant["lag"], slow=slow
    )
    if torque_level is None:
        return None
    how = "torque at which the shaft breaks away; ripple that the log does not show lowers it"
    return StaticFriction(*torque_level, _RIPPLE * torque_level[0], how)


def _gives(logs: Sequence[Log], plant: Regression, slow: float) -> bool:
    """Return whether the shaft deflects further than rounding while its torque turns.

    Reversals without a standstill say nothing in either direction; where there are no others the
    deflection is followed.
    """
    lengths = []
    for log in usable_logs(logs):
        current = motion_of(log).current
        small = slow * log.period
        stuck = stuck_stretches(log.motor, max(2, round(_STUCK / log.period)), small)
        for before, after in reversals(log):
            for a, b in ((a, b) for a, b in stuck if before <= a and b <= after):
                turn = abs(float(current[b] - current[a])) / (2.0 * plant["dry"])
                if turn > 0.2:
                    lengths.append(abs(float(log.motor[b] - log.motor[a])) / (turn * small))
    return len(lengths) < _FEWEST or float(np.median(lengths)) > _LONG
