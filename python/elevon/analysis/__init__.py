"""What campaigns teach: effects of factors on a response, and surrogates of it."""

from elevon.analysis.effects import Effects, Term, effects_of
from elevon.analysis.response import Response, read_response

__all__ = ["Effects", "Response", "Term", "effects_of", "read_response"]
