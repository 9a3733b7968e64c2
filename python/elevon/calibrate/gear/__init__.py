"""Calibration of an actuator with a control unit of its own and tables of friction.

The friction comes from a rig that moves the ram, the motor from the electrical balance, the train
from the torque balance while the motor drives, the unit's gains from its own set points.
"""

from elevon.calibrate.gear.log import GearLog, gear_log
from elevon.calibrate.gear.result import calibrate_gear

__all__ = ["GearLog", "calibrate_gear", "gear_log"]
