"""The safety campaign of a control unit: many failures in many situations, judged by hazards."""

from __future__ import annotations

from elevon.safety.campaign import SafetyResult, safety
from elevon.safety.hazards import HAZARDS, Hazard, observe
from elevon.safety.rows import Row, population

__all__ = ["HAZARDS", "Hazard", "Row", "SafetyResult", "observe", "population", "safety"]
