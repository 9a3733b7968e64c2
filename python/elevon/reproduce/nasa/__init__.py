"""Nominal behaviour and faults of the NASA test stand's ballscrew actuator."""

from elevon.reproduce.nasa.baseline import reproduce_baseline
from elevon.reproduce.nasa.baseline_rows import BaselineResult
from elevon.reproduce.nasa.capability import Capability
from elevon.reproduce.nasa.profiles import PROFILES, MotionProfile, profile_scenario
from elevon.reproduce.nasa.separation import reproduce_separation
from elevon.reproduce.nasa.separation_rows import SeparationResult
from elevon.reproduce.nasa.thermal import ThermalResult, reproduce_thermal

__all__ = [
    "PROFILES",
    "BaselineResult",
    "Capability",
    "MotionProfile",
    "SeparationResult",
    "ThermalResult",
    "profile_scenario",
    "reproduce_baseline",
    "reproduce_separation",
    "reproduce_thermal",
]
