"""What is done on the demonstration's bench."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from elevon.bench.procedure import Procedure, load_procedure

HELD_OUT = "held-out"
"""Name of the log that is kept from the calibration."""
LOADED = "loaded"
"""Of the logs calibrated on, the one whose brake acts."""


def demo_procedure() -> Procedure:
    """Return the procedure: three logs to calibrate on, one kept back."""
    return load_procedure(Path(str(files("elevon.demo") / "bench.toml")))
