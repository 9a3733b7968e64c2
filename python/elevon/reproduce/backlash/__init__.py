"""Backlash of the Torino bench: measured, calculated, simulated and recovered."""

from elevon.reproduce.backlash.campaign import BacklashResult, RowResult, reproduce_backlash
from elevon.reproduce.backlash.estimate import BacklashEstimate, backlash_from_encoder

__all__ = [
    "BacklashEstimate",
    "BacklashResult",
    "RowResult",
    "backlash_from_encoder",
    "reproduce_backlash",
]
