"""Parameters from logs: identifiability, fit, intervals, validation.

>>> from elevon.calibrate import calibrate, read_logs  # doctest: +SKIP
>>> result = calibrate(read_logs(["log.csv"]), Actuator.load("torino-rotary"))  # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from elevon.calibrate.calibration import calibrate
    from elevon.calibrate.outcome import Calibration
    from elevon.calibrate.validation import Validation, validate
    from elevon.logs.log import Log
    from elevon.logs.read import read_drive_logs as read_logs

__all__ = ["Calibration", "Log", "Validation", "calibrate", "read_logs", "validate"]

_HOMES = {
    "Log": ("logs.log", "Log"),
    "read_logs": ("logs.read", "read_drive_logs"),
    "Calibration": ("calibrate.outcome", "Calibration"),
    "calibrate": ("calibrate.calibration", "calibrate"),
    "Validation": ("calibrate.validation", "Validation"),
    "validate": ("calibrate.validation", "validate"),
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    module, attribute = _HOMES[name]
    return getattr(import_module(f"elevon.{module}"), attribute)
