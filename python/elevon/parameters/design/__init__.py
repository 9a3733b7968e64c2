"""An actuator from few numbers: what ``[design]`` may hold, the rules that derive the rest."""

from elevon.parameters.design.derive import (
    Derivation,
    Given,
    derive,
    design_scenario,
    quantities,
    read_design,
)

__all__ = ["Derivation", "Given", "derive", "design_scenario", "quantities", "read_design"]
