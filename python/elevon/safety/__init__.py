"""The safety campaign of an actuator: failures in many situations, hazards, how likely they are."""

from __future__ import annotations

from elevon.safety.campaign import safety
from elevon.safety.hazards import Hazard, Watched, lasting
from elevon.safety.probability import Exposure, Frequency, Occurrence, frequency
from elevon.safety.result import SafetyResult

__all__ = [
    "Exposure",
    "Frequency",
    "Hazard",
    "Occurrence",
    "SafetyResult",
    "Watched",
    "frequency",
    "lasting",
    "safety",
]
