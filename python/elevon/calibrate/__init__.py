"""Parameters from logs: identifiability, fit, intervals, validation.

>>> from elevon.calibrate import calibrate, read_logs  # doctest: +SKIP
>>> result = calibrate(read_logs(["log.csv"]), Actuator.load("torino-rotary"))  # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from elevon.calibrate.calibration import Calibration, calibrate
    from elevon.calibrate.log import BenchLog, read_logs
    from elevon.calibrate.validation import Validation, validate

__all__ = ["BenchLog", "Calibration", "Validation", "calibrate", "read_logs", "validate"]

_HOMES = {
    "BenchLog": "log",
    "read_logs": "log",
    "Calibration": "calibration",
    "calibrate": "calibration",
    "Validation": "validation",
    "validate": "validation",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
