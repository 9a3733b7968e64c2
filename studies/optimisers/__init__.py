"""The usual comparison: severities by a population search on a reduced-order model's misfit."""

from studies.optimisers.cost import CAUSES, MonitoringModel
from studies.optimisers.methods import METHODS, search

__all__ = ["CAUSES", "METHODS", "MonitoringModel", "search"]
