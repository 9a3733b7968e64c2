"""Calibration by runs of a servo's own closed loop on recorded demands: few channels suffice."""

from elevon.calibrate.stages.closed_loop.log import loop_log
from elevon.calibrate.stages.closed_loop.result import calibrate_loop, predict

__all__ = ["calibrate_loop", "loop_log", "predict"]
