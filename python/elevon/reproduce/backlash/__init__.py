"""Backlash of the Torino bench: measured, calculated, simulated and recovered."""

from elevon.reproduce.backlash.campaign import BacklashResult, RowResult, reproduce_backlash
from elevon.reproduce.backlash.estimate import PlayEstimate, play_from_encoder

__all__ = [
    "BacklashResult",
    "PlayEstimate",
    "RowResult",
    "play_from_encoder",
    "reproduce_backlash",
]
