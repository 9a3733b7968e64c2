"""The usual comparison: severities by a population search on a reduced-order model's misfit."""

from elevon.diagnose.optimisers.cost import CAUSES, MonitoringModel
from elevon.diagnose.optimisers.methods import METHODS, search

__all__ = ["CAUSES", "METHODS", "MonitoringModel", "search"]
