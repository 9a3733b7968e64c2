"""All rules, by the number of a design or the path of the parameter that each derives."""

from __future__ import annotations

from collections.abc import Mapping

from elevon.parameters.design.control_rules import CONTROL
from elevon.parameters.design.design_rules import DESIGN
from elevon.parameters.design.motor_rules import MOTOR
from elevon.parameters.design.rule import Rule
from elevon.parameters.design.train_rules import TRAIN

#: The first rule of a name whose needs are given serves.
RULES: Mapping[str, tuple[Rule, ...]] = {**DESIGN, **MOTOR, **TRAIN, **CONTROL}
