"""Diagnosis by the model: what moved in a log, which fault moves it so, how far, how surely."""

from elevon.diagnose.engine.answer import Cause, Diagnosis
from elevon.diagnose.engine.diagnosis import diagnose

__all__ = ["Cause", "Diagnosis", "diagnose"]
