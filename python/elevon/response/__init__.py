"""Frequency response of an actuator at work, its open loops, and linear models of it."""

from elevon.response.band import AgreementBand, band_of
from elevon.response.estimate import FrequencyResponse
from elevon.response.linear import LinearModel, linearise
from elevon.response.loop import LoopResponse, loop_response
from elevon.response.margins import Margin, Margins, margins
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
