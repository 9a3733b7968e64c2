"""Which way of calibration suits an actuator and what its logs show."""

from __future__ import annotations

from collections.abc import Sequence

from elevon.actuator import Actuator
from elevon.calibrate.stages.log import MOTION
from elevon.calibrate.stages.smooth import LOAD
from elevon.logs.log import Log


def preloaded(actuator: Actuator) -> bool:
    """Whether the actuator has a preloaded screw with an efficiency in each direction."""
    from elevon.parameters.records import records

    return {"screw.preload", "screw.efficiency_aiding"} <= records(actuator.wiring).keys()


def balanced(logs: Sequence[Log]) -> bool:
    """Whether the balances suit: torque, motion and load in every log."""
    return all(
        log.has("torque_current")
        and any(log.has(role) for role in MOTION)
        and any(log.has(role) for role in LOAD)
        for log in logs
    )
