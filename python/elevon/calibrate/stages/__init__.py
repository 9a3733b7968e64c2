"""Calibration by stages: each states what it needs of the logs, and what it gives.

A stage is chosen by what the actuator has, and says itself why the logs do not show its numbers.
"""

from elevon.calibrate.stages.context import motor_ratio, role_log
from elevon.calibrate.stages.flow import STAGES, calibrate_parts

__all__ = ["STAGES", "calibrate_parts", "motor_ratio", "role_log"]
