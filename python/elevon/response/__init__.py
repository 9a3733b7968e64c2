"""Frequency response of an actuator at work, and linear models of the low-fidelity one."""

from elevon.response.estimate import FrequencyResponse
from elevon.response.linear import LinearModel, linearise
from elevon.response.measure import frequency_response

__all__ = ["FrequencyResponse", "LinearModel", "frequency_response", "linearise"]
