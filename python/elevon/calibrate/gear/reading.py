"""What all balances of the drive read in logs: of a stand, or of the model run again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.calibrate.gear.by_current import gains_by_current
from elevon.calibrate.gear.log import GearLog
from elevon.calibrate.gear.motor import Motor, driving, motor_constants
from elevon.calibrate.gear.train import Balance, Constants, torque_balance
from elevon.calibrate.level import Level, as_values

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["Reader", "Reading"]


@dataclass(frozen=True)
class Reading:
    """Numbers, why others are not among them, and the balances themselves."""

    levels: dict[str, Level]
    reasons: dict[str, str]
    motor: Motor
    balance: Balance


@dataclass(frozen=True)
class Reader:
    """The balances, with what they take as it is.

    Attributes
    ----------
    actuator : Actuator
        First values.
    settled : Actuator
        With what the stages before have determined.
    friction : mapping of str to float
        Knots that a rig has determined.
    inertia : tuple of ndarray
        Places of the ram [m] and what turns and swings beside the motor's own inertia [kg m2].
    gains : bool
        Whether the unit's gains are read from the current as well.
    """

    actuator: Actuator
    settled: Actuator
    friction: Mapping[str, float]
    inertia: tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]
    gains: bool

    def __call__(self, logs: Sequence[GearLog]) -> Reading:
        """Return what the logs show."""
        parts = driving(logs, self.actuator)
        motor = motor_constants(parts, self.actuator)
        known = Constants(self.settled, motor, self.friction, self.inertia)
        balance = torque_balance(parts, known)
        levels, reasons = {**motor.levels, **balance.levels}, {**motor.reasons, **balance.reasons}
        if self.gains:
            values: dict[str, str | float] = {**as_values(motor.levels)}
            ready = self.settled.with_values(values, source="calibration")
            gains, missing = gains_by_current(logs, ready, motor)
            levels, reasons = levels | gains, reasons | missing
        return Reading(levels, reasons, motor, balance)
