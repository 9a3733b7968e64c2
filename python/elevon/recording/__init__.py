"""Recordings: named channels on one or several clocks, simulated or measured alike."""

from elevon.recording.channel import Channel, Clock
from elevon.recording.recording import Recording

__all__ = ["Channel", "Clock", "Recording"]
