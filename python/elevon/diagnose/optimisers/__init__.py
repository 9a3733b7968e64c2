"""The usual comparison: severities by a population search on a low model's misfit."""

from elevon.diagnose.optimisers.cost import CAUSES, Monitor
from elevon.diagnose.optimisers.methods import METHODS, search

__all__ = ["CAUSES", "METHODS", "Monitor", "search"]
