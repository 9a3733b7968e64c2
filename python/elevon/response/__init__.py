"""Frequency response of an actuator at work, its open loops, and linear models of it."""

from elevon.response.estimate import AgreementBand, FrequencyResponse, band_of
from elevon.response.linear import LinearModel, linearise
from elevon.response.loop import LoopResponse, Margin, Margins, loop_response, margins
from elevon.response.measure import frequency_response

__all__ = [
    "AgreementBand",
    "FrequencyResponse",
    "LinearModel",
    "LoopResponse",
    "Margin",
    "Margins",
    "band_of",
    "frequency_response",
    "linearise",
    "loop_response",
    "margins",
]
