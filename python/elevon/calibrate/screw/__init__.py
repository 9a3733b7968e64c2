"""Calibration of a servo with a preloaded screw from logs that show its torque, motion and load."""

from elevon.calibrate.screw.log import ScrewLog, balanced, motor_ratio, preloaded, screw_log
from elevon.calibrate.screw.result import calibrate_screw

__all__ = ["ScrewLog", "balanced", "calibrate_screw", "motor_ratio", "preloaded", "screw_log"]
