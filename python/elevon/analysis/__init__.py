"""What campaigns teach: effects of factors on a response."""

from elevon.analysis.effects import EffectEstimate, Effects, effects_of
from elevon.analysis.response import CampaignResponse, read_response

__all__ = ["CampaignResponse", "EffectEstimate", "Effects", "effects_of", "read_response"]
