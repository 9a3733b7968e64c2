"""An actuator from few numbers: what ``[design]`` may hold, the rules that derive the rest."""

from elevon.parameters.design.derive import Derivation, derive
from elevon.parameters.design.quantities import Given, quantities, read_design
from elevon.parameters.design.scenario import design_scenario

__all__ = ["Derivation", "Given", "derive", "design_scenario", "quantities", "read_design"]
